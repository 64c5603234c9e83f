//! Machine on the local interface in simulated time, with faults of either end and of the connection.
//! Judged on the machine: its motor stands and its pilots are shut in time, and its piston stays within the
//! stopping distance.

use hydroboom_control::command::AxisCommand;
use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::fault::Cause;
use hydroboom_control::supervision::limits::{Limits, MachineStatus};
use hydroboom_control::supervision::supervisor::State;
use hydroboom_control::supervision::waiting::Waiting;
use hydroboom_description::Description;
use hydroboom_design::limits;
use hydroboom_machine_interface::datagram::{
    Body, Hello, LONGEST, MOST_AXES, MeasuredAxis, Measurement, Peer, VERSION, decode, encode,
};
use hydroboom_machine_interface::session::{Session, WATCHDOG};
use hydroboom_machine_interface::signal::{MEASURED, MachineState};
use hydroboom_realtime::bus_task::{BusError, BusTask, SILENT};
use hydroboom_realtime::control_task::{ControlTask, Record};
use hydroboom_realtime::course::Course;
use hydroboom_realtime::desk::Desk;
use hydroboom_realtime::local_lockstep::LocalLockstep;
use hydroboom_realtime::operator::Operator;
use hydroboom_realtime::simulation_task::SimulationTask;
use hydroboom_virtual_crane::VirtualCrane;
use std::net::{Ipv4Addr, UdpSocket};
use std::sync::Arc;

const STRATEGY: Strategy = Strategy::BenchmarkClosedLoop;
const PERIOD: f64 = 1e-3;
const HELD: AxisCommand<f64> = AxisCommand { motor_speed: 0.0, holding_valve: 0.0 };
/// Watchdog time of the machine \[periods\].
const WATCHDOG_PERIODS: u32 = WATCHDOG.as_millis() as u32;

/// Disturbance of a measurement in transit.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Spoilt {
    Silent,
    CheckSum,
    NotFinite,
    Repeated,
    OtherSession,
}

/// Virtual crane behind the interface, with a watchdog of its own.
struct Machine {
    socket: UdpSocket,
    session: Session,
    crane: VirtualCrane,
    command: AxisCommand<f64>,
    is_enabled: bool,
    enables: bool,
    fault: u16,
    silent: u32,
    is_held: bool,
    is_deaf: bool,
    sampled: u64,
    before: Vec<u8>,
}

impl Machine {
    fn new(crane: VirtualCrane, port: u16) -> Self {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        socket.connect((Ipv4Addr::LOCALHOST, port)).unwrap();
        socket.set_nonblocking(true).unwrap();
        Self {
            socket,
            session: Session::new(0),
            crane,
            command: HELD,
            is_enabled: false,
            enables: true,
            fault: 0,
            silent: 0,
            is_held: false,
            is_deaf: false,
            sampled: 0,
            before: Vec::new(),
        }
    }

    fn ask(&self) {
        let hello = Hello {
            peer: Peer::SimulatedMachine,
            period: (PERIOD * 1e9) as u32,
            newest_version: VERSION,
            axes: 1,
            firmware: 0,
            ranges: [[[f64::NAN; 2]; MEASURED.len()]; MOST_AXES],
        };
        let mut bytes = [0; LONGEST];
        let length = encode(&Default::default(), &Body::Hello(hello), &mut bytes);
        self.socket.send(&bytes[..length]).unwrap();
    }

    fn begin(&mut self) {
        let mut bytes = [0; LONGEST];
        let length = self.socket.recv(&mut bytes).unwrap();
        let (header, _) = decode(&bytes[..length]).unwrap();
        self.session = Session::new(header.session);
    }

    /// Samples and sends a measurement, intact or disturbed.
    fn send(&mut self, spoilt: Option<Spoilt>) {
        let signals = self.crane.signals().to_array();
        let state = match (self.fault, self.is_enabled) {
            (0, true) => MachineState::Enabled,
            (0, false) => MachineState::Ready,
            _ => MachineState::Fault,
        };
        let mut sent = Measurement {
            sampled: self.sampled,
            state,
            fault: self.fault,
            count: 1,
            ..Default::default()
        };
        sent.axes[0] = MeasuredAxis { signals, ..Default::default() };
        if spoilt == Some(Spoilt::NotFinite) {
            sent.axes[0].signals[2] = f64::NAN;
        }
        let mut header = self.session.next_header(self.sampled);
        if spoilt == Some(Spoilt::OtherSession) {
            header.session ^= 1;
        }
        let mut bytes = [0; LONGEST];
        let length = encode(&header, &Body::Measurement(sent), &mut bytes);
        match spoilt {
            Some(Spoilt::Silent) => return,
            Some(Spoilt::CheckSum) => bytes[length / 2] ^= 1,
            Some(Spoilt::Repeated) => {
                self.socket.send(&self.before).unwrap();
                return;
            }
            _ => self.before = bytes[..length].to_vec(),
        }
        self.socket.send(&bytes[..length]).unwrap();
    }

    /// Receives commands and advances by a period.
    fn go_on(&mut self) {
        let (mut bytes, mut is_new) = ([0; LONGEST], false);
        while let Ok(length) = self.socket.recv(&mut bytes) {
            if self.is_deaf {
                continue;
            }
            if let Some((_, Body::Command(command))) = self.session.accept(&bytes[..length]) {
                let axis = command.axes[0];
                self.command = AxisCommand {
                    motor_speed: axis.motor_speed,
                    holding_valve: axis.holding_valve,
                };
                self.is_enabled = command.is_enabled && self.enables && self.fault == 0;
                is_new = true;
            }
        }
        self.silent = if is_new { 0 } else { self.silent + 1 };
        if self.silent > WATCHDOG_PERIODS {
            self.is_held = true;
        } else if self.command == HELD {
            self.is_held = false;
        }
        let command = if self.is_held || !self.is_enabled { HELD } else { self.command };
        self.crane.advance(&command).unwrap();
        self.sampled += (PERIOD * 1e9) as u64;
    }

    /// Whether motor and pilots are at rest.
    fn is_safe(&self) -> bool {
        let truth = self.crane.truth();
        truth.motor_speed.abs() < 1e-3 && truth.pilot < 0.5
    }

    fn stroke(&self) -> f64 {
        self.crane.truth().outputs.stroke
    }
}

/// Both ends in one thread.
struct Rig {
    run: LocalLockstep,
    machine: Machine,
    operator: Operator,
    desk: Desk,
    limits: Limits,
}

impl Rig {
    fn new() -> Self {
        let model = Description::uia_single_boom().unwrap();
        let crane = Description::uia_virtual().unwrap();
        let motion = crane.motion(model.numbers.fast);
        let mut start = crane.start(motion.start);
        start.preload = 0.0;
        let limits = limits(&model, motion.speed).unwrap();
        let control = ControlTask::new(&model, Course::new(Arc::new(motion)), limits, STRATEGY);
        let simulation = SimulationTask::new(&model, motion.start).unwrap();
        let (mut bus, side) = BusTask::open(0, PERIOD).unwrap();
        let mut machine = Machine::new(VirtualCrane::new(&crane, &start).unwrap(), bus.port());
        machine.ask();
        bus.receive(0);
        machine.begin();
        let periods = (model.numbers.simulation_period, PERIOD);
        let run = LocalLockstep::new((control, simulation), (bus, side), periods).without_waiting();
        let operator = Operator::automatic(PERIOD);
        Self { run, machine, operator, desk: Desk::new(STRATEGY), limits }
    }

    fn period(&mut self, spoilt: Option<Spoilt>) -> Record {
        self.machine.send(spoilt);
        let record = self.run.period(&mut self.operator, &self.desk);
        self.machine.go_on();
        record
    }

    /// Runs until the piston moves at full speed.
    fn at_full_speed() -> Self {
        let mut rig = Self::new();
        for _ in 0..20_000 {
            let record = rig.period(None);
            assert_eq!(record.decision.cause, None);
            if record.course_time.is_some()
                && record.reference.velocity >= 0.99 * record.course_speed
            {
                return rig;
            }
        }
        panic!("it does not come to full speed");
    }

    /// Runs until the machine is safe. Returns the number of periods, and the piston's travel up to one
    /// second after.
    fn until_safe(&mut self, mut period: impl FnMut(&mut Self, u32)) -> (u32, f64) {
        let from = self.machine.stroke();
        let (mut safe_after, mut furthest) = (None, 0.0_f64);
        for k in 1..=1000 {
            period(self, k);
            furthest = furthest.max((self.machine.stroke() - from).abs());
            match self.machine.is_safe() {
                true => safe_after = safe_after.or(Some(k)),
                false => safe_after = None,
            }
        }
        (safe_after.unwrap_or(u32::MAX), furthest)
    }

    /// Upper bound of the piston's travel for a stop that begins after a time [s].
    fn stopping_distance(&self, after: f64) -> f64 {
        self.limits.speed * (self.limits.stopping_time() + after)
    }

    /// Periods of an immediate stop: closing time of the valve, and the motor's ramp to zero.
    fn stopping_periods(&self) -> u32 {
        let brake = self.limits.motor_speed / self.limits.motor_slew;
        ((self.limits.valve_time.max(brake) + self.limits.drive.response * 5.0) / PERIOD) as u32
    }
}

#[test]
fn a_course_runs_and_its_delay_is_that_of_the_machine() {
    let mut rig = Rig::new();
    let mut last = rig.period(None);
    while !rig.operator.is_done() && last.time < 60.0 {
        last = rig.period(None);
    }
    assert_eq!((last.decision.state, last.decision.cause), (State::Holding, None));
    (0..rig.stopping_periods()).for_each(|_| last = rig.period(None));
    assert!(rig.machine.is_safe());
    let (counters, refused) = rig.run.bus.endpoint.counters();
    assert_eq!((counters.lost, counters.dropped(), refused), (0, 0, 0));
    assert_eq!(last.status, Some(MachineStatus::Enabled));
    // measurements are sent as sampled, and the command that answers one acts at once
    assert_eq!(last.link.unwrap().delay.unwrap().cycles(), [0, 0]);
}

#[test]
fn a_machine_that_goes_silent_is_lost_and_holds_by_its_own_watchdog() {
    let mut rig = Rig::at_full_speed();
    let mut found = None;
    let (safe_after, furthest) = rig.until_safe(|rig, k| {
        let record = rig.period(Some(Spoilt::Silent));
        found = found.or(record.decision.cause.map(|cause| (k, cause)));
    });
    let (periods, cause) = found.unwrap();
    assert_eq!(cause, Cause::MachineLost);
    assert!(f64::from(periods) * PERIOD <= rig.limits.stale + 2.0 * PERIOD, "{periods}");
    assert!(safe_after <= periods + rig.stopping_periods(), "{safe_after}");
    assert!(furthest < rig.stopping_distance(rig.limits.stale), "{furthest}");
}

#[test]
fn without_a_controller_the_machine_stops_itself() {
    let mut rig = Rig::at_full_speed();
    let (safe_after, furthest) = rig.until_safe(|rig, _| rig.machine.go_on());
    assert!(safe_after <= WATCHDOG_PERIODS + 1 + rig.stopping_periods(), "{safe_after}");
    assert!(furthest < rig.stopping_distance(WATCHDOG.as_secs_f64()), "{furthest}");
}

#[test]
fn the_bus_task_holds_the_load_while_the_control_task_stalls() {
    let mut rig = Rig::at_full_speed();
    let mut ordered_after = None;
    let (safe_after, furthest) = rig.until_safe(|rig, k| {
        rig.machine.send(None);
        rig.run.stalled_period();
        rig.machine.go_on();
        if rig.machine.command == HELD {
            ordered_after = ordered_after.or(Some(k));
        }
    });
    // not by the machine's watchdog, which receives the bus task's commands
    assert_eq!(ordered_after, Some(SILENT as u32 + 1));
    assert!(!rig.machine.is_held);
    assert!(safe_after <= SILENT as u32 + 1 + rig.stopping_periods(), "{safe_after}");
    assert!(furthest < rig.stopping_distance(0.0), "{furthest}");
    // the control task resumes and first commands motion
    for k in 0..200 {
        let record = rig.period(None);
        assert_eq!(record.decision.cause, Some(Cause::WatchdogExpired), "{k}");
        assert_eq!(rig.machine.command.holding_valve, 0.0, "{k}");
    }
}

#[test]
fn after_a_short_stall_of_control_the_valve_stays_shut() {
    let mut rig = Rig::at_full_speed();
    // shorter than the watchdog times of machine and supervisor
    for _ in 0..5 {
        rig.machine.send(None);
        rig.run.stalled_period();
        rig.machine.go_on();
    }
    assert_eq!(rig.machine.command, HELD);
    let record = rig.period(None);
    assert_eq!(record.decision.cause, Some(Cause::WatchdogExpired));
    assert_eq!(rig.machine.command.holding_valve, 0.0);
}

#[test]
fn after_lost_commands_the_load_stays_held() {
    let mut rig = Rig::at_full_speed();
    rig.machine.is_deaf = true;
    let mut found = None;
    let (safe_after, furthest) = rig.until_safe(|rig, k| {
        // from then on commands arrive again
        rig.machine.is_deaf = k <= 3 * WATCHDOG_PERIODS;
        let record = rig.period(None);
        found = found.or(record.decision.cause.map(|cause| (k, cause)));
    });
    let (periods, cause) = found.unwrap();
    assert_eq!(cause, Cause::WatchdogExpired);
    assert!(periods <= WATCHDOG_PERIODS + 3, "{periods}");
    assert!(safe_after <= WATCHDOG_PERIODS + 1 + rig.stopping_periods(), "{safe_after}");
    assert!(furthest < rig.stopping_distance(WATCHDOG.as_secs_f64()), "{furthest}");
}

#[test]
fn single_bad_datagrams_are_dropped_and_counted_without_a_fault() {
    let kinds = [Spoilt::CheckSum, Spoilt::NotFinite, Spoilt::Repeated, Spoilt::OtherSession];
    let mut rig = Rig::at_full_speed();
    for k in 0..400_usize {
        let spoilt = kinds.get(k / 100).copied().filter(|_| k.is_multiple_of(50));
        assert_eq!(rig.period(spoilt).decision.cause, None, "{k}");
    }
    let (counters, _) = rig.run.bus.endpoint.counters();
    let counted = [counters.check_sum, counters.not_finite, counters.sequence, counters.session];
    assert_eq!((counted, counters.lost), ([2; 4], 8));
}

#[test]
fn lost_measurements_and_a_foreign_session_are_faults() {
    let mut rig = Rig::at_full_speed();
    let mut found = None;
    let (_, furthest) = rig.until_safe(|rig, k| {
        let record = rig.period((!k.is_multiple_of(3)).then_some(Spoilt::CheckSum));
        found = found.or(record.decision.cause);
    });
    assert_eq!(found, Some(Cause::MeasurementsLost));
    assert!(furthest < rig.stopping_distance(0.3), "{furthest}");
    let mut rig = Rig::at_full_speed();
    let mut found = None;
    rig.until_safe(|rig, _| {
        let record = rig.period(Some(Spoilt::OtherSession));
        found = found.or(record.decision.cause);
    });
    assert_eq!(found, Some(Cause::MachineLost));
    assert_eq!(rig.run.bus.endpoint.counters().0.session, 1000);
}

#[test]
fn a_machine_fault_is_named_and_reset_on_the_machine_first() {
    let mut rig = Rig::at_full_speed();
    rig.machine.fault = 0x7500;
    let record = rig.period(None);
    assert_eq!(record.decision.cause, Some(Cause::MachineFault));
    assert_eq!(record.status, Some(MachineStatus::Fault { code: 0x7500 }));
    let (safe_after, _) = rig.until_safe(|rig, _| {
        rig.period(None);
    });
    assert!(safe_after <= rig.stopping_periods(), "{safe_after}");
    let reset = |rig: &mut Rig| {
        (0..3000).any(|_| {
            rig.desk.reset();
            rig.operator.listen(&rig.desk);
            rig.period(None).decision.state != State::Fault
        })
    };
    assert!(!reset(&mut rig), "reset with the machine in fault");
    rig.machine.fault = 0;
    assert!(reset(&mut rig));
}

#[test]
fn disabled_drives_prevent_a_release_and_are_a_fault_in_motion() {
    let mut rig = Rig::new();
    rig.machine.enables = false;
    let mut last = rig.period(None);
    for _ in 0..5000 {
        last = rig.period(None);
        assert!(!last.decision.releasing && rig.machine.command == HELD);
    }
    assert_eq!((last.decision.state, last.decision.waiting), (State::Holding, Waiting::Drives));
    let mut rig = Rig::at_full_speed();
    rig.machine.enables = false;
    let mut causes = (0..3).filter_map(|_| rig.period(None).decision.cause);
    assert_eq!(causes.next(), Some(Cause::MachineNotReady));
}

#[test]
fn a_port_in_use_is_reported() {
    let taken = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let port = taken.local_addr().unwrap().port();
    let error = BusTask::open(port, PERIOD).unwrap_err();
    assert!(matches!(error, BusError::Port { .. }));
    let message = error.to_string();
    assert!(
        message.contains(&port.to_string()) && message.contains("another program"),
        "{message}"
    );
}
