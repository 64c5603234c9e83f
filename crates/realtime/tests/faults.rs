//! A fixed share of the fault-injection campaign with every kind of fault. `hydroboom faults --all` runs
//! the rest.

use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::supervisor::State;
use hydroboom_realtime::campaign_cranes::{at_valve_end, campaign_cranes};
use hydroboom_realtime::fault::Fault;
use hydroboom_realtime::faults::{Moment, Outcome, Underway};
use hydroboom_realtime::lockstep::Lockstep;
use hydroboom_realtime::operator::Operator;
use rayon::prelude::*;

/// Largest drop of a held load \[m\].
const DROP: f64 = 3e-3;

fn judge(outcome: &Outcome, crane: &str) {
    let o = outcome;
    let what = format!(
        "{}, {:?} under {} at {} on {crane}: {:?}, moved {:.1} of {:.1} mm, safe after {:?} of {:?} s, dropped {:.2} mm",
        o.fault.name(),
        o.second,
        o.strategy.name(),
        o.moment.name(),
        o.cause,
        o.moved * 1e3,
        o.movement_bound * 1e3,
        o.safe_after,
        o.time_bound,
        o.dropped * 1e3
    );
    assert!(o.is_within_bounds(), "{what}");
    // a valve that does not shut cannot hold the load
    let holds = o.fault != Fault::ValveStuckOpen;
    assert!(!holds || o.dropped < DROP, "{what}");
}

/// Every fault alone and with a second one, with moments and strategies in turn.
#[test]
fn every_kind_of_fault_keeps_to_its_bounds() {
    let crane = &campaign_cranes().unwrap()[0];
    let motion = crane.machine.motion(crane.model.numbers.fast);
    let ways: Vec<Underway> = Strategy::ALL
        .into_iter()
        .flat_map(|strategy| Moment::ALL.map(|moment| (strategy, moment)))
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(|(strategy, moment)| {
            Underway::until(&crane.model, &crane.machine, motion, strategy, moment).unwrap()
        })
        .collect();
    let mut cases = Vec::new();
    for (k, fault) in Fault::all().into_iter().enumerate() {
        // two of the 25 combinations of strategy and moment alone, one with each second fault; the strides
        // visit every combination
        for (j, second) in [None, None].into_iter().chain(Fault::seconds().map(Some)).enumerate() {
            cases.push((&ways[(7 * k + 11 * j) % ways.len()], fault, second));
        }
    }
    cases.into_par_iter().for_each(|(way, fault, second)| {
        judge(&way.inject(fault, second), "the paper's crane");
    });
}

/// The same for another payload, lever and bore, with the fastest and the slowest valve.
#[test]
fn other_cranes_keep_to_their_bounds() {
    let mut cranes = Vec::new();
    for (k, crane) in campaign_cranes().unwrap().iter().enumerate().skip(1) {
        cranes.push(at_valve_end(crane, k % 2 == 0));
    }
    let faults = Fault::all();
    cranes.into_par_iter().enumerate().for_each(|(c, crane)| {
        let motion = crane.machine.motion(crane.model.numbers.fast);
        for (m, moment) in [Moment::PreLoad, Moment::Cruise].into_iter().enumerate() {
            let strategy = Strategy::BenchmarkClosedLoop;
            let way =
                Underway::until(&crane.model, &crane.machine, motion, strategy, moment).unwrap();
            assert_eq!(way.stopped(), None, "{} is stopped without a fault", crane.name);
            for fault in faults.iter().skip((c + m) % 4).step_by(4) {
                judge(&way.inject(*fault, None), crane.name);
            }
        }
    });
}

/// The cranes of the campaign complete their course under the benchmark controller without a fault.
#[test]
fn the_cranes_of_the_campaign_are_stable() {
    campaign_cranes().unwrap().into_par_iter().for_each(|crane| {
        let motion = crane.machine.motion(crane.model.numbers.fast);
        let strategy = Strategy::BenchmarkClosedLoop;
        let mut run = Lockstep::new(&crane.model, &crane.machine, motion, strategy).unwrap();
        let mut operator = Operator::automatic(crane.model.numbers.control_period);
        let mut last = run.period(&mut operator, strategy).unwrap();
        let (mut swing, mut periods) = (0.0_f64, 0);
        while !operator.is_done() && periods < 80_000 {
            last = run.period(&mut operator, strategy).unwrap();
            periods += 1;
            // at rest at the far end the benchmark controller has settled
            let settled = motion.rest + motion.travel_time() + 0.6 * motion.dwell;
            if last.course_time.is_some_and(|t| (settled..settled + 1.0).contains(&t)) {
                swing = swing.max(last.error().unwrap_or(0.0).abs());
            }
        }
        assert_eq!(
            (last.decision.state, last.decision.cause),
            (State::Holding, None),
            "{}",
            crane.name
        );
        assert!(swing < 2e-3, "{}: {:.2} mm at rest", crane.name, swing * 1e3);
    });
}
