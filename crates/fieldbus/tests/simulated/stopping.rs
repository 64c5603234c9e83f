//! Faults of the bus while the crane moves: how far the piston goes until the machine is safe, judged on the
//! simulated machine.

use crate::bench::enabled;
use crate::bench::{Behind, Shared, SimulatedLink, segment, table};
use hydroboom_control::command::{AxisCommand, Command};
use hydroboom_description::Description;
use hydroboom_device_simulator::al_status_code::AlStatusCode;
use hydroboom_device_simulator::applications::{INJECTED_FAULT, SAFE_TORQUE_OFF};
use hydroboom_device_simulator::device::Fault as DeviceFault;
use hydroboom_fieldbus::bus::Bus;
use hydroboom_fieldbus::fault::Fault;
use hydroboom_fieldbus::link::Link;
use hydroboom_fieldbus::machine::{FieldbusMachine, MachineState};
use hydroboom_fieldbus::time::now;
use hydroboom_realtime::machine::Machine;
use hydroboom_virtual_crane::{Truth, VirtualCrane};
use std::cell::RefCell;
use std::rc::Rc;

const PERIOD: f64 = 1e-3;
/// Periods in which the crane comes to its speed, and for which it is watched after a fault.
const RUN_UP: u64 = 700;
const WATCHED: u64 = 500;
/// Process-data watchdog of the page's table \[s\], and periods from a command to what it does.
const WATCHDOG: f64 = 20e-3;
const REACHING: f64 = 2.0 * PERIOD;

struct Moving {
    bus: Bus<SimulatedLink>,
    behind: Shared,
    machine: FieldbusMachine,
    sequence: u64,
    speed: f64,
}

impl Moving {
    /// A released crane whose motor turns as for a piston speed \[m/s\].
    fn new(crane: &Description, piston_speed: f64) -> Self {
        // so that it passes the middle of its stroke
        let n = &crane.numbers;
        let begin = 0.5 * n.stroke - 0.5 * piston_speed * PERIOD * RUN_UP as f64;
        let machine = VirtualCrane::new(crane, &crane.start(begin)).unwrap();
        let behind = Rc::new(RefCell::new(Behind { crane: Some(machine), ..Behind::default() }));
        let devices = segment(&behind, |_, drive| drive.deceleration = n.motor_slew);
        let mut bus = Bus::start(table(|_| {}), SimulatedLink::new(devices)).unwrap();
        let machine = bus.take_machine().unwrap();
        let mut moving = Self { bus, behind, machine, sequence: 0, speed: 0.0 };
        // at rest, enabled, then released; the crane's time begins after that
        while moving.machine.state() != MachineState::Enabled {
            moving.command(&Command::default());
        }
        (0..5).for_each(|_| moving.command(&Command::released([0.0])));
        let speed = crane.benchmark().revolutions_per_metre * piston_speed;
        for period in 1..=RUN_UP {
            moving.speed = speed * (period as f64 / 200.0).min(1.0);
            moving.period();
        }
        moving
    }

    /// A cycle in which the crane stands still.
    fn command(&mut self, command: &Command) {
        self.bus.measure();
        self.sequence += 1;
        self.machine.write(self.sequence, &enabled(*command));
        self.bus.act();
    }

    /// A control period.
    fn period(&mut self) {
        self.bus.measure();
        self.sequence += 1;
        self.machine.write(self.sequence, &enabled(Command::released([self.speed])));
        self.behind.borrow_mut().advance();
        self.bus.act();
    }

    fn crane(&self) -> VirtualCrane {
        self.behind.borrow().crane.clone().unwrap()
    }

    fn truth(&self) -> Truth {
        self.behind.borrow().crane.as_ref().unwrap().truth()
    }

    fn stroke(&self) -> f64 {
        self.truth().outputs.stroke
    }

    fn drive(&mut self, act: impl FnOnce(&mut hydroboom_device_simulator::Device)) {
        act(&mut self.bus.link_mut().segment.devices_mut()[1]);
    }
}

/// Travel \[m\] of an immediate stop that begins at once: motor down by its slew, valve shut.
fn ideal_travel(mut crane: VirtualCrane, slew: f64) -> f64 {
    let (begin, speed) = (crane.truth().outputs.stroke, crane.truth().motor_speed);
    let mut travel = 0.0_f64;
    for period in 0..WATCHED {
        let left = (speed.abs() - slew * PERIOD * period as f64).max(0.0);
        let command = AxisCommand { motor_speed: speed.signum() * left, holding_valve: 0.0 };
        crane.advance(&command).unwrap();
        travel = travel.max((crane.truth().outputs.stroke - begin).abs());
    }
    travel
}

type Injection = fn(&mut Moving);

const FAULTS: [(&str, Injection, Fault); 8] = [
    (
        "cable break before the first device",
        |m| m.bus.link_mut().segment.connect(0),
        Fault::FramesLost,
    ),
    (
        "cable break behind the drive",
        |m| m.bus.link_mut().segment.connect(2),
        Fault::DeviceSilent { device: 2 },
    ),
    (
        "frames lost on their way back",
        |m| m.bus.link_mut().segment.lose_frames(u32::MAX),
        Fault::FramesLost,
    ),
    (
        "drive left OP",
        |m| m.drive(|d| d.inject(DeviceFault::StateDrop(AlStatusCode::PllError), now())),
        Fault::StateDropped { device: 1, code: 0x32 },
    ),
    (
        "SYNC0 stays away",
        |m| m.drive(|d| d.inject(DeviceFault::Sync0Missing, now())),
        Fault::StateDropped { device: 1, code: 0x2c },
    ),
    (
        "drive fault",
        |m| m.drive(|d| d.dictionary.set_number(INJECTED_FAULT, 0x3220)),
        Fault::Drive { device: 1, code: 0x3220 },
    ),
    (
        "stop circuit",
        |m| m.drive(|d| d.dictionary.set_number(SAFE_TORQUE_OFF, 1)),
        Fault::SafeTorqueOff { device: 1 },
    ),
    (
        "bus task delayed for 30 ms",
        |m| {
            for _ in 0..30 {
                m.bus.link_mut().wait(now() + 1_000_000);
                m.behind.borrow_mut().advance();
            }
        },
        Fault::StateDropped { device: 1, code: 0x1a },
    ),
];

#[test]
fn after_a_fault_the_crane_goes_no_farther_than_an_immediate_stop_and_the_time_until_it_is_known() {
    // the bus has the delay, the crane's own is off
    let mut crane = Description::uia_virtual().unwrap();
    crane.set("fieldbus.delay_cycles=0").unwrap();
    let slew = crane.numbers.motor_slew;
    for speed in [0.12, -0.12, 0.025] {
        // the same for all faults, as all of them come at the same moment
        let mut ideal = None;
        for (name, inject, fault) in FAULTS {
            let mut moving = Moving::new(&crane, speed);
            let begin = moving.stroke();
            let reached = moving.truth().outputs.velocity;
            let ideal = *ideal.get_or_insert_with(|| ideal_travel(moving.crane(), slew));
            let bound = ideal + reached.abs() * (WATCHDOG + REACHING);
            let since = now();
            inject(&mut moving);
            let (mut travel, mut safe, mut found) = ((moving.stroke() - begin).abs(), 0, None);
            for period in 1..=WATCHED {
                moving.period();
                if found.is_none() && moving.bus.fault().is_some() {
                    found = Some(period);
                }
                let truth = moving.truth();
                travel = travel.max((truth.outputs.stroke - begin).abs());
                if truth.pilot > 0.05 || truth.motor_speed.abs() > 0.2 {
                    safe = (now() - since) / 1_000_000;
                }
            }
            println!(
                "{:+.0} mm/s, {name}: found after {} periods, {:.1} mm until at rest, bound {:.1}, safe \
                after {safe} ms",
                1e3 * reached,
                found.unwrap_or(0),
                1e3 * travel,
                1e3 * bound
            );
            assert_eq!(moving.bus.fault(), Some(fault), "{name}");
            assert!(travel <= bound, "{name} at {speed} m/s: {travel} m, bound {bound} m");
            assert!(safe < WATCHED / 2, "{name} at {speed} m/s: safe after {safe} ms");
        }
    }
}
