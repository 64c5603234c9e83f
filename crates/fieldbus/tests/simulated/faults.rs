//! Faults of the bus and of what is on it: their names, the periods until they are found, and that none resets itself.

use crate::bench::enabled;
use crate::bench::{Shared, SimulatedLink, bus, table};
use hydroboom_control::command::Command;
use hydroboom_control::measurement::Validity;
use hydroboom_device_simulator::al_status_code::AlStatusCode;
use hydroboom_device_simulator::applications::{INJECTED_FAULT, SAFE_STOP_TIME, SAFE_TORQUE_OFF};
use hydroboom_device_simulator::device::Fault as DeviceFault;
use hydroboom_device_simulator::mailbox::Emergency;
use hydroboom_fieldbus::bus::Bus;
use hydroboom_fieldbus::fault::Fault;
use hydroboom_fieldbus::machine::{FieldbusMachine, MachineState};
use hydroboom_fieldbus::time::{now, simulate};
use hydroboom_realtime::machine::Machine;

/// Positions of the devices.
const DRIVE: usize = 1;
const INPUTS: usize = 2;

struct Running {
    bus: Bus<SimulatedLink>,
    behind: Shared,
    machine: FieldbusMachine,
    sequence: u64,
}

impl Running {
    /// Enabled, at speed, load released.
    fn new() -> Self {
        let (mut bus, behind) = bus(table(|_| {}));
        let machine = bus.take_machine().unwrap();
        let mut running = Self { bus, behind, machine, sequence: 0 };
        running.rest();
        running.cycles(50);
        assert_eq!(running.machine.state(), MachineState::Enabled);
        assert!(running.is_moving());
        running
    }

    fn cycle(&mut self, command: Option<Command>) {
        self.bus.measure();
        if let Some(command) = command {
            self.sequence += 1;
            self.machine.write(self.sequence, &enabled(command));
        }
        self.bus.act();
    }

    /// A cycle with a command that is at rest.
    fn rest(&mut self) {
        self.cycle(Some(Command::default()));
    }

    fn cycles(&mut self, count: u32) {
        (0..count).for_each(|_| self.cycle(Some(Command::released([10.0]))));
    }

    /// Cycles until there is a fault, at most so many.
    fn until_found(&mut self, most: u32) -> Option<(Fault, u32)> {
        for cycle in 1..=most {
            self.cycles(1);
            if let Some(fault) = self.bus.fault() {
                return Some((fault, cycle));
            }
        }
        None
    }

    fn is_moving(&self) -> bool {
        let command = self.behind.borrow().command;
        command.motor_speed > 9.0 && command.holding_valve == 1.0
    }

    fn is_safe(&self) -> bool {
        let command = self.behind.borrow().command;
        command.motor_speed == 0.0 && command.holding_valve == 0.0
    }

    fn inject(&mut self, device: usize, fault: DeviceFault) {
        let devices = self.bus.link_mut().segment.devices_mut();
        devices[device].inject(fault, now());
    }

    fn set(&mut self, key: (u16, u8), value: i64) {
        self.bus.link_mut().segment.devices_mut()[DRIVE].dictionary.set_number(key, value);
    }
}

type Injection = fn(&mut Running);

/// Faults: how they are made, how they are mended, what they are called, and in how many periods they are found at
/// most.
const FAULTS: [(Injection, Injection, Fault, u32); 11] = [
    (
        |r| r.bus.link_mut().segment.lose_frames(1000),
        |r| r.bus.link_mut().segment.lose_frames(0),
        Fault::FramesLost,
        4,
    ),
    (|r| r.bus.link_mut().late = Some((8, 400_000)), |_| {}, Fault::FramesLost, 4),
    (
        |r| r.inject(DRIVE, DeviceFault::FramesIgnored(8)),
        |_| {},
        Fault::DeviceSilent { device: 1 },
        4,
    ),
    (
        |r| r.bus.link_mut().segment.connect(2),
        |r| r.bus.link_mut().segment.connect(4),
        Fault::DeviceSilent { device: 2 },
        4,
    ),
    (
        |r| r.bus.link_mut().segment.connect(0),
        |r| r.bus.link_mut().segment.connect(4),
        Fault::FramesLost,
        4,
    ),
    (
        |r| r.inject(INPUTS, DeviceFault::StateDrop(AlStatusCode::BackgroundWatchdog)),
        |_| {},
        Fault::StateDropped { device: 2, code: 0x2a },
        1,
    ),
    (
        |r| r.inject(DRIVE, DeviceFault::StateDrop(AlStatusCode::PllError)),
        |_| {},
        Fault::StateDropped { device: 1, code: 0x32 },
        1,
    ),
    (
        |r| r.inject(DRIVE, DeviceFault::Sync0Missing),
        |r| r.bus.link_mut().segment.devices_mut()[DRIVE].clear_faults(),
        Fault::StateDropped { device: 1, code: 0x2c },
        4,
    ),
    // the bus task was held up: the drive misses its frames before its watchdog ends
    (|_| simulate(now() + 30_000_000), |_| {}, Fault::StateDropped { device: 1, code: 0x1a }, 1),
    (|r| r.set(INJECTED_FAULT, 0x3220), |_| {}, Fault::Drive { device: 1, code: 0x3220 }, 2),
    (
        |r| r.set(SAFE_TORQUE_OFF, 1),
        |r| r.set(SAFE_TORQUE_OFF, 0),
        Fault::SafeTorqueOff { device: 1 },
        2,
    ),
];

#[test]
fn each_fault_is_found_by_its_name_stops_the_machine_and_does_not_reset_itself() {
    for (number, (inject, mend, fault, periods)) in FAULTS.into_iter().enumerate() {
        let mut running = Running::new();
        inject(&mut running);
        let found = running.until_found(20);
        assert!(
            found.is_some_and(|(f, after)| f == fault && after <= periods),
            "{number}: {found:?} for {fault:?}"
        );
        let sentence = running.bus.fault_sentence().unwrap();
        assert!(sentence.len() > 40, "{sentence}");
        // where no frame comes, the valve's own watchdog of 20 ms shuts it; a drive without frames brakes by its own
        // ramp
        running.cycles(25);
        assert_eq!(running.behind.borrow().command.holding_valve, 0.0, "{number}");
        running.cycles(125);
        assert!(running.is_safe(), "{number}: {:?}", running.behind.borrow().command);
        mend(&mut running);
        running.cycles(1000);
        assert_eq!(running.bus.fault(), Some(fault), "{number}");
        assert_eq!(running.machine.state(), MachineState::Fault(fault));
        assert!(running.is_safe(), "{number}");
    }
}

/// Safe stop 1: the drive shows the open stop circuit, and removes its torque only after it has stopped.
#[test]
fn safe_stop_1_is_a_fault_at_once_is_not_cut_and_its_drive_is_enabled_by_a_reset_only() {
    let mut running = Running::new();
    let state = |running: &Running| running.bus.statuswords().next().unwrap() & 0x6f;
    // longer than the braking time after other faults
    running.set(SAFE_STOP_TIME, 800);
    running.set(SAFE_TORQUE_OFF, 1);
    let found = running.until_found(20);
    let fault = Fault::SafeTorqueOff { device: 1 };
    assert!(found.is_some_and(|(f, after)| f == fault && after <= 2), "{found:?}");
    running.cycles(2);
    assert!(running.is_safe());
    for _ in 0..750 {
        running.cycles(1);
        assert_eq!(state(&running), 0x27, "only the drive ends its stop");
    }
    running.cycles(100);
    assert_eq!(state(&running), 0x40);
    running.set(SAFE_TORQUE_OFF, 0);
    for _ in 0..200 {
        running.cycles(1);
        assert_ne!(state(&running), 0x27, "commands alone do not enable it");
    }
    running.machine.reset_by_a_person();
    running.rest();
    running.cycles(50);
    assert_eq!((running.bus.fault(), running.is_moving()), (None, true));
}

#[test]
fn a_wrong_working_counter_is_a_fault_of_its_own_and_an_unexplained_stop_of_a_drive_too() {
    let mut running = Running::new();
    running.bus.link_mut().low = 8;
    assert_eq!(running.until_found(20), Some((Fault::WorkingCounter, 4)));

    let (mut bus, behind) = bus(table(|table| table.drives[0].stop_circuit = None));
    let machine = bus.take_machine().unwrap();
    let mut running = Running { bus, behind, machine, sequence: 0 };
    running.rest();
    running.cycles(50);
    running.set(SAFE_TORQUE_OFF, 1);
    let found = running.until_found(20);
    assert_eq!(found.map(|(fault, _)| fault), Some(Fault::DriveDisabled { device: 1 }));
}

#[test]
fn a_person_resets_a_fault_of_the_drive_and_starts_the_bus_again_after_a_broken_cable() {
    let mut running = Running::new();
    running.set(INJECTED_FAULT, 0x3220);
    running.cycles(100);
    running.machine.reset_by_a_person();
    // what still commands a motion moves nothing
    running.cycles(100);
    assert_eq!((running.bus.fault(), running.is_safe()), (None, true));
    running.rest();
    running.cycles(50);
    assert!(running.is_moving());

    running.bus.link_mut().segment.connect(2);
    running.cycles(100);
    running.bus.link_mut().segment.connect(4);
    running.machine.reset_by_a_person();
    running.cycles(100);
    let fault = Some(Fault::DeviceSilent { device: 2 });
    assert_eq!((running.bus.fault(), running.is_safe()), (fault, true));
    running.bus = running.bus.restart_by_a_person().unwrap();
    let low = running.bus.counters().low;
    running.cycles(100);
    assert!(running.is_safe());
    running.rest();
    running.cycles(50);
    assert_eq!((running.bus.fault(), running.is_moving()), (None, true));
    assert_eq!(running.bus.counters().low, low);
}

#[test]
fn single_losses_are_borne_and_the_last_measurement_ages() {
    let mut running = Running::new();
    let number = |r: &mut Running| r.machine.read().unwrap().measurement.number;
    let before = number(&mut running);
    // both frames of a cycle
    running.bus.link_mut().segment.lose_frames(2);
    running.cycles(1);
    assert_eq!(number(&mut running), before, "nothing new was measured");
    running.cycles(1);
    assert_eq!(number(&mut running), before + 1);
    // two come too late, and one comes twice
    running.bus.link_mut().late = Some((2, 700_000));
    running.cycles(3);
    running.bus.link_mut().twice = 1;
    running.cycles(3);
    // one device does not hear the first frame of a cycle: nothing of it counts
    let before = number(&mut running);
    running.inject(INPUTS, DeviceFault::FramesIgnored(1));
    running.cycles(1);
    assert_eq!(number(&mut running), before);
    running.cycles(200);
    let counters = running.bus.counters();
    assert_eq!((counters.lost, counters.low, counters.unexpected), (4, 1, 3));
    assert_eq!((running.bus.fault(), running.is_moving()), (None, true));
}

#[test]
fn a_clock_that_drifts_and_an_emergency_in_operation_are_borne() {
    let mut running = Running::new();
    // 100 ppm beside the others; a mailbox that nobody fetches
    running.inject(DRIVE, DeviceFault::Drift(100_000));
    running.inject(DRIVE, DeviceFault::Emergency(Emergency { code: 0x3220, register: 1 }));
    running.cycles(1000);
    let counters = running.bus.counters();
    assert_eq!((counters.lost, counters.low), (0, 0));
    assert_eq!((running.bus.fault(), running.is_moving()), (None, true));
}

#[test]
fn an_old_command_is_not_repeated_beyond_two_periods() {
    let mut running = Running::new();
    running.cycle(None);
    running.cycles(1);
    assert_eq!((running.bus.fault(), running.is_moving()), (None, true), "one is borne");
    running.cycle(None);
    running.cycle(None);
    assert_eq!(running.bus.fault(), Some(Fault::CommandsStopped));
    running.cycle(None);
    assert!(running.is_safe());
    // new commands are not followed before a person resets it
    running.cycles(700);
    assert!(running.is_safe());
    assert_ne!(
        running.bus.statuswords().next().unwrap() & 0x6f,
        0x27,
        "the drive is switched off after it braked"
    );
    running.machine.reset_by_a_person();
    running.rest();
    running.cycles(50);
    assert!(running.is_moving());
    // what is no number is no command
    running.cycle(Some(Command::released([f64::NAN])));
    running.cycles(1);
    assert_eq!((running.bus.fault(), running.is_safe()), (Some(Fault::CommandsStopped), true));
}

#[test]
fn a_broken_wire_makes_its_signal_absent_in_the_next_measurement_and_no_other() {
    let mut running = Running::new();
    running.behind.borrow_mut().broken.push(2);
    running.cycles(1);
    let axis = running.machine.read().unwrap().measurement.axes[0];
    assert_eq!(axis.validity.pressure_a, Validity::Absent);
    // for the supervisor, which finds it in the same period
    assert!(axis.signals.pressure_a.is_nan());
    let others = axis.validity.to_array().iter().filter(|v| **v == Validity::Good).count();
    assert_eq!(others, 6);
    // supervision is the controller's
    assert_eq!(running.bus.fault(), None);
}
