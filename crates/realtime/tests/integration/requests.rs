//! Requests of operators who have left have no effect.

use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::fault::Cause;
use hydroboom_control::supervision::supervisor::State;
use hydroboom_description::Description;
use hydroboom_realtime::control_task::Record;
use hydroboom_realtime::desk::Desk;
use hydroboom_realtime::lockstep::{Lockstep, Pace, run};
use hydroboom_realtime::session::{Attendant, Ending, Lookout, Order, Session};
use std::sync::Arc;

/// Action at the desk.
#[derive(Clone, Copy)]
enum Act {
    /// Someone takes the operator's role without a time limit.
    Take,
    /// The role is given back, as when its page is closed.
    Leave,
    Start,
    Emergency,
    Reset,
    Close,
}

/// Executes actions at given times \[s\] and stores the records.
struct Script {
    session: Session,
    desk: Arc<Desk>,
    acts: Vec<(f64, Act)>,
    records: Vec<Record>,
}

impl Attendant for Script {
    fn see(&mut self, record: &Record) {
        self.session.see(record);
        self.records.push(*record);
    }

    fn orders(&mut self) -> Vec<Order> {
        let now = self.session.last().map_or(0.0, |r| r.time);
        while self.acts.first().is_some_and(|(time, _)| *time <= now) {
            match self.acts.remove(0).1 {
                Act::Take => {
                    self.desk.take_role(3600.0);
                }
                Act::Leave => self.desk.leave_role(),
                // also when a page would refuse the start
                Act::Start => self.desk.start(),
                Act::Emergency => self.desk.emergency_stop(),
                Act::Reset => self.desk.reset(),
                Act::Close => self.desk.close(),
            }
        }
        self.session.orders()
    }
}

fn play(acts: Vec<(f64, Act)>) -> Vec<Record> {
    let strategy = Strategy::BenchmarkClosedLoop;
    let model = Description::uia_single_boom().unwrap();
    let machine = Description::uia_virtual().unwrap();
    let desk = Arc::new(Desk::new(strategy));
    desk.leave_role();
    let session = Session::new(&model);
    let mut script = Script { session, desk: Arc::clone(&desk), acts, records: vec![] };
    let motion = machine.motion(model.numbers.fast);
    let lockstep = Lockstep::new(&model, &machine, motion, strategy).unwrap();
    let lookout = Lookout { desk: &desk, attendant: &mut script, ending: Ending::OnceClosed };
    run(lockstep, &machine, lookout, Pace::Free).unwrap();
    script.records
}

fn states(records: &[Record]) -> Vec<State> {
    let mut states: Vec<State> = records.iter().map(|r| r.decision.state).collect();
    states.dedup();
    states
}

fn acts(record: &&Record) -> bool {
    record.decision.command.motor_speed != 0.0 || record.decision.command.holding_valve != 0.0
}

#[test]
fn a_new_operator_does_not_inherit_a_start_request() {
    // during the fault, in Ready, and in Holding just before the page is closed, which is a fault of its
    // own
    for (asked, ends_in) in [(2.05, State::Holding), (2.3, State::Holding), (2.98, State::Fault)] {
        let of_the_first = [(1.0, Act::Take), (2.0, Act::Emergency), (2.1, Act::Reset)];
        let mut script: Vec<(f64, Act)> = of_the_first.to_vec();
        script.extend([(asked, Act::Start), (3.0, Act::Leave)]);
        script.extend([(23.0, Act::Take), (40.0, Act::Close)]);
        script.sort_by(|a, b| a.0.total_cmp(&b.0));
        let records = play(script);
        let later = records.iter().filter(|r| r.time > 3.1);
        assert_eq!(later.clone().filter(acts).count(), 0, "asked for at {asked} s");
        let last = records.last().unwrap();
        assert_eq!(last.decision.state, ends_in, "asked for at {asked} s");
        assert!(records.iter().any(|r| r.decision.cause == Some(Cause::EmergencyStop)));
    }
}

#[test]
fn a_present_operator_can_start_once_the_load_is_held() {
    // not before, and not at the moment of taking the role, because the load is not held yet
    let records = play(vec![
        (0.9, Act::Start),
        (1.0, Act::Take),
        (1.0, Act::Start),
        (2.0, Act::Start),
        (40.0, Act::Close),
    ]);
    use State::{Holding, Moving, Ready, Stopping};
    assert_eq!(states(&records), [Ready, Holding, Moving, Stopping, Holding]);
    assert_eq!(records.iter().filter(|r| r.time < 2.0).filter(acts).count(), 0);
}

#[test]
fn giving_back_the_role_during_the_proof_prevents_the_release() {
    // pre-loading takes almost three seconds
    let script = |more: &[(f64, Act)]| {
        let mut script = vec![(1.0, Act::Take), (2.0, Act::Start), (3.5, Act::Leave)];
        script.extend(more);
        script.push((12.0, Act::Close));
        play(script)
    };
    let given_back = script(&[]);
    assert_eq!(given_back.last().unwrap().decision.cause, Some(Cause::OperatorLost));
    // the role is taken by another operator in the same period
    let handed_over = script(&[(3.5, Act::Take)]);
    assert_eq!(handed_over.last().unwrap().decision.state, State::Holding);
    for records in [given_back, handed_over] {
        assert!(records.iter().filter(|r| r.time < 3.5).any(|r| acts(&r)), "it was not begun");
        assert!(records.iter().all(|r| r.decision.command.holding_valve == 0.0));
        assert_eq!(records.iter().filter(|r| r.time > 4.5).filter(acts).count(), 0);
    }
}

#[test]
fn an_emergency_stop_before_supervision_starts_is_not_lost() {
    let records = play(vec![(0.0, Act::Emergency), (0.5, Act::Take), (3.0, Act::Close)]);
    let end = records.last().unwrap().decision;
    assert_eq!((end.state, end.cause), (State::Fault, Some(Cause::EmergencyStop)));
    assert_eq!(records.iter().filter(acts).count(), 0);
}
