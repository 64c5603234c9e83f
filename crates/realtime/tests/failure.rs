//! Real-time tasks that panic: the load is held, the attendant learns the reason, and no thread waits for
//! them.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::Measurement;
use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::fault::Cause;
use hydroboom_control::supervision::limits::Limits;
use hydroboom_control::supervision::supervisor::State;
use hydroboom_description::Description;
use hydroboom_design::limits;
use hydroboom_model::Start;
use hydroboom_realtime::control_task::{ControlTask, Record};
use hydroboom_realtime::course::Course;
use hydroboom_realtime::desk::Desk;
use hydroboom_realtime::executive::{Placement, RealTime, Tasks, run};
use hydroboom_realtime::failure::Failure;
use hydroboom_realtime::machine::{Incoming, Machine, Outgoing};
use hydroboom_realtime::session::{Attendant, Ending, Lookout, Order};
use hydroboom_realtime::simulation_task::SimulationTask;
use hydroboom_virtual_crane::VirtualCrane;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, MutexGuard};

const CLOSED: Strategy = Strategy::SimulationFeedforwardClosedLoop;
const HELD: AxisCommand<f64> = AxisCommand { motor_speed: 0.0, holding_valve: 0.0 };

/// Call of a machine's function.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Call {
    Read,
    Panic,
    Write(u64, AxisCommand<f64>),
}

/// Time at which a machine panics.
#[derive(Clone, Copy)]
enum Panics {
    /// Never.
    Never,
    /// At the first call.
    AtOnce,
    /// After its valve has been open for 0.1 s.
    InMotion,
    /// The same, and at every later call.
    ForGood,
}

/// Virtual crane that advances by a period at each read, and panics.
struct Panicking {
    crane: VirtualCrane,
    command: AxisCommand<f64>,
    sequence: u64,
    open: u32,
    panics: Panics,
    has: bool,
    calls: Arc<Mutex<Vec<Call>>>,
}

impl Panicking {
    fn call(&self, call: Call) {
        self.calls.lock().unwrap_or_else(|lock| lock.into_inner()).push(call);
    }
}

impl Machine for Panicking {
    fn read(&mut self) -> Option<Incoming> {
        let panics = match self.panics {
            Panics::Never => false,
            Panics::AtOnce => true,
            Panics::InMotion | Panics::ForGood => self.open > 100,
        };
        if panics {
            self.has = true;
            self.call(Call::Panic);
            panic!("the bus has {} frames too many", self.open);
        }
        self.call(Call::Read);
        self.crane.advance(&self.command).unwrap();
        self.sequence += 1;
        let measurement = Measurement { number: self.sequence, ..self.crane.measurement() };
        Some(Incoming::new(measurement, None))
    }

    fn write(&mut self, sequence: u64, outgoing: &Outgoing) {
        let command = &outgoing.command;
        self.call(Call::Write(sequence, command.axes[0]));
        assert!(!(self.has && matches!(self.panics, Panics::ForGood)), "no bus any more");
        self.command = command.axes[0];
        self.open += u32::from(self.command.holding_valve > 0.0);
    }
}

/// Starts the course once the load is held, and stores records and failures.
struct Keeper {
    desk: Arc<Desk>,
    started: bool,
    records: Vec<Record>,
    failures: Vec<Failure>,
    /// Whether it panics itself once the load moves.
    panics: bool,
}

impl Attendant for Keeper {
    fn see(&mut self, record: &Record) {
        self.records.push(*record);
        let moves = record.course_time.is_some_and(|time| time > 0.1);
        assert!(!(self.panics && moves), "the screen is gone");
    }
    fn orders(&mut self) -> Vec<Order> {
        let is_held = self.records.last().is_some_and(|r| r.decision.state == State::Holding);
        if is_held && !self.started {
            self.started = true;
            self.desk.start();
        }
        vec![]
    }
    fn failed(&mut self, failure: &Failure) {
        self.failures.push(failure.clone());
    }
}

/// Mutual exclusion of the sessions: their threads share the same two cores.
static ALONE: Mutex<()> = Mutex::new(());

struct Session {
    keeper: Keeper,
    calls: Vec<Call>,
    /// None if the session itself panicked.
    real_time: Option<RealTime>,
    _alone: MutexGuard<'static, ()>,
}

/// Session in real time in which a course is started.
fn session(panics: Panics, attendant_panics: bool) -> Session {
    let alone = ALONE.lock().unwrap_or_else(|lock| lock.into_inner());
    let model = Description::uia_single_boom().unwrap();
    let mut machine = Description::uia_virtual().unwrap();
    machine.set("virtual.step_us=1000").unwrap();
    let motion = machine.motion(model.numbers.fast);
    let mut start: Start = machine.start(motion.start);
    start.preload = 0.0;
    let calls = Arc::new(Mutex::new(vec![]));
    let machine = Panicking {
        crane: VirtualCrane::new(&machine, &start).unwrap(),
        command: HELD,
        sequence: 0,
        open: 0,
        panics,
        has: false,
        calls: Arc::clone(&calls),
    };
    let n = &model.numbers;
    // on a busy computer deadlines are missed; this simulated machine waits, so that neither is a fault
    // here
    let limits = Limits {
        missed: u32::MAX,
        watchdog: f64::INFINITY,
        ..limits(&model, motion.speed).unwrap()
    };
    let tasks = Tasks {
        control: ControlTask::new(&model, Course::new(Arc::new(motion)), limits, CLOSED),
        simulation: SimulationTask::new(&model, motion.start).unwrap(),
        machine: Box::new(machine),
        periods: (n.simulation_period, n.control_period),
        placement: Placement::default(),
    };
    let desk = Arc::new(Desk::new(CLOSED));
    let mut keeper = Keeper {
        desk: Arc::clone(&desk),
        started: false,
        records: vec![],
        failures: vec![],
        panics: attendant_panics,
    };
    let lookout = Lookout { desk: &desk, attendant: &mut keeper, ending: Ending::OnceDone };
    let ran = catch_unwind(AssertUnwindSafe(|| run(tasks, lookout, &mut |_| {}).unwrap()));
    let calls = calls.lock().unwrap_or_else(|lock| lock.into_inner()).clone();
    Session { keeper, calls, real_time: ran.ok(), _alone: alone }
}

/// Calls before and after the panic.
fn around_the_panic(calls: &[Call]) -> (&[Call], &[Call]) {
    let at = calls.iter().position(|call| *call == Call::Panic).unwrap();
    (&calls[..at], &calls[at + 1..])
}

/// Reason of the control task's failure, which must have been reported once.
fn reason(session: &Session) -> &str {
    let real_time = session.real_time.as_ref().unwrap();
    assert_eq!(real_time.failures, session.keeper.failures);
    let [Failure::Control(why)] = &real_time.failures[..] else {
        panic!("{:?}", real_time.failures)
    };
    why
}

#[test]
fn a_control_task_that_panics_in_motion_holds_the_load_within_the_period() {
    let session = session(Panics::InMotion, false);
    let (before, after) = around_the_panic(&session.calls);
    let Some(Call::Write(last, moving)) = before.last() else { panic!("{:?}", before.last()) };
    assert_eq!(moving.holding_valve, 1.0);
    // the safe command comes with the next call, then in every period, and no other call follows
    for (k, call) in after.iter().enumerate() {
        assert_eq!(*call, Call::Write(last + 1 + k as u64, HELD));
    }
    assert!(after.len() > 200, "for {} periods", after.len());

    let why = reason(&session);
    assert!(why.contains("the bus has 101 frames too many"), "{why}");
    assert!(why.contains("failure.rs"), "where? {why}");
    let real_time = session.real_time.as_ref().unwrap();
    assert_eq!(real_time.end.state, State::Fault);
    assert_eq!(real_time.end.cause, Some(Cause::ControllerInvalid));
    assert_eq!(real_time.end.command, HELD);

    let records = &session.keeper.records;
    let begun = records.iter().position(|r| r.decision.state == State::Fault).unwrap();
    assert_eq!(records[begun - 1].decision.state, State::Moving);
    assert!(records.windows(2).all(|r| r[0].time < r[1].time));
    assert!(records[begun..].iter().all(|r| r.decision == real_time.end));
    assert_eq!(records.len() - begun + real_time.dropped as usize, after.len());
}

#[test]
fn a_panic_of_control_before_the_first_record_ends_the_session_too() {
    let session = session(Panics::AtOnce, false);
    let (before, after) = around_the_panic(&session.calls);
    assert!(before.is_empty() && after.len() > 200);
    assert_eq!(after[0], Call::Write(1, HELD));
    assert!(reason(&session).contains("frames too many"));
    assert_eq!(session.keeper.records[0].decision.state, State::Fault);
}

#[test]
fn a_machine_that_accepts_no_commands_is_left_to_its_own_watchdog() {
    let session = session(Panics::ForGood, false);
    let (_, after) = around_the_panic(&session.calls);
    assert!(matches!(after, [Call::Write(_, HELD)]), "{after:?}");
    assert!(reason(&session).contains("frames too many"));
    assert_eq!(session.real_time.unwrap().end.state, State::Fault);
}

#[test]
fn if_the_attendant_panics_the_load_is_brought_to_rest_and_held() {
    let session = session(Panics::Never, true);
    assert!(session.real_time.is_none(), "the panic was swallowed");
    let opened =
        session.calls.iter().any(|c| matches!(c, Call::Write(_, c) if c.holding_valve > 0.0));
    let held = session.calls.iter().rev().find(|call| **call != Call::Read);
    assert!(opened && matches!(held, Some(Call::Write(_, HELD))), "{held:?}");
}
