//! A bus that starts in SAFEOP: measurements come, outputs stay safe, and OP is requested once drives are enabled.

use crate::bench::{Shared, SimulatedLink, enabled, segment, table};
use hydroboom_control::command::Command;
use hydroboom_device_simulator::applications::INJECTED_FAULT;
use hydroboom_device_simulator::device::{Fault as DeviceFault, State};
use hydroboom_fieldbus::bus::Bus;
use hydroboom_fieldbus::fault::Fault;
use hydroboom_fieldbus::machine::{FieldbusMachine, MachineState};
use hydroboom_fieldbus::start_up::InitialState;
use hydroboom_fieldbus::time::now;
use hydroboom_realtime::machine::{Machine, Outgoing};

/// Position of the drive on the bus.
const DRIVE: usize = 1;

struct Running {
    bus: Bus<SimulatedLink>,
    machine: FieldbusMachine,
    sequence: u64,
}

impl Running {
    /// In SAFEOP.
    fn new() -> Self {
        let link = SimulatedLink::new(segment(&Shared::default(), |_, _| {}));
        let mut bus = Bus::start_in(InitialState::SafeOp, table(|_| {}), link).unwrap();
        let machine = bus.take_machine().unwrap();
        Self { bus, machine, sequence: 0 }
    }

    /// Cycles with a command, until a condition holds; at most so many.
    fn until(
        &mut self,
        most: u32,
        outgoing: &Outgoing,
        is_met: impl Fn(&FieldbusMachine) -> bool,
    ) -> Option<u32> {
        (1..=most).find(|_| {
            self.bus.measure();
            self.sequence += 1;
            self.machine.write(self.sequence, outgoing);
            self.bus.act();
            is_met(&self.machine)
        })
    }

    fn states(&mut self) -> Vec<State> {
        self.bus.link_mut().segment.devices_mut().iter().map(|device| device.state().0).collect()
    }
}

#[test]
fn devices_stay_in_safe_op_and_measure_until_a_command_enables_drives() {
    let mut running = Running::new();
    assert_eq!(running.until(500, &Outgoing::SAFE, |m| m.state() != MachineState::Ready), None);
    assert_eq!(running.states(), [State::SafeOp; 4]);
    let incoming = running.machine.read().unwrap();
    assert!(incoming.measurement.axes[0].signals.pressure_pump_a.is_finite());
    // with and without outputs the working counter is the same
    assert_eq!(running.bus.counters().low, 0);
    let rest = enabled(Command::default());
    assert!(running.until(200, &rest, |m| m.state() == MachineState::Enabled).is_some());
    assert_eq!(running.states(), [State::Op; 4]);
    let (counters, fault) = (running.bus.counters(), running.bus.fault());
    assert_eq!((counters.low, counters.lost, counters.late_outputs, fault), (0, 0, 0, None));
}

#[test]
fn a_device_that_does_not_reach_op_is_a_fault_with_its_reason() {
    let mut running = Running::new();
    running.until(20, &Outgoing::SAFE, |_| false);
    let devices = running.bus.link_mut().segment.devices_mut();
    devices[DRIVE].inject(DeviceFault::Sync0Missing, now());
    let rest = enabled(Command::default());
    let is_fault = |m: &FieldbusMachine| matches!(m.state(), MachineState::Fault(_));
    assert!(running.until(6000, &rest, is_fault).is_some());
    let fault = running.bus.fault();
    let is_named = matches!(fault, Some(Fault::StateDropped { device: 1, code }) if code != 0);
    assert!(is_named, "{fault:?}");
    assert_eq!(running.bus.link_mut().segment.devices_mut()[DRIVE].state().0, State::SafeOp);
}

#[test]
fn a_fault_of_a_drive_is_reset_in_op_by_a_person_while_the_drive_stays_off() {
    let mut running = Running::new();
    running.until(20, &Outgoing::SAFE, |_| false);
    let drive = &mut running.bus.link_mut().segment.devices_mut()[DRIVE];
    drive.dictionary.set_number(INJECTED_FAULT, 0x3220);
    let is_fault = |m: &FieldbusMachine| matches!(m.state(), MachineState::Fault(_));
    assert!(running.until(20, &Outgoing::SAFE, is_fault).is_some());
    let drive = &mut running.bus.link_mut().segment.devices_mut()[DRIVE];
    drive.dictionary.set_number(INJECTED_FAULT, 0);
    assert_eq!(running.until(200, &Outgoing::SAFE, |m| !is_fault(m)), None, "not by itself");
    running.machine.reset_by_a_person();
    running.until(500, &Outgoing::SAFE, |_| false);
    assert_eq!(running.machine.state(), MachineState::Ready);
    assert_eq!(running.states()[DRIVE], State::Op);
}
