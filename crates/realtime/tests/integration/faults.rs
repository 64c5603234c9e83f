//! A fixed share of the fault-injection campaign with every kind of fault. `./test --campaigns` runs every pair,
//! `hydroboom faults --all` every combination of strategy and moment.

use hydroboom_control::strategy::Strategy;
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

/// Every fault alone and with every fourth of the second faults, with moments and strategies in turn.
#[test]
fn every_kind_of_fault_stays_within_its_bounds() {
    keep_to_their_bounds(4);
}

/// The same with every second fault.
#[test]
#[ignore = "campaign"]
fn campaign_every_pair_of_faults_stays_within_its_bounds() {
    keep_to_their_bounds(1);
}

/// Every fault alone, and one in `stride` pairs of faults.
fn keep_to_their_bounds(stride: usize) {
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
        // one of the 25 combinations of strategy and moment alone, one with each second fault; the strides
        // visit every combination
        for (j, second) in [None].into_iter().chain(Fault::seconds().map(Some)).enumerate() {
            if second.is_none() || (j + k) % stride == 0 {
                cases.push((&ways[(7 * k + 11 * j) % ways.len()], fault, second));
            }
        }
    }
    cases.into_par_iter().for_each(|(way, fault, second)| {
        judge(&way.inject(fault, second), "the paper's crane");
    });
}

/// The same for another payload, lever and bore, with the fastest and the slowest valve.
#[test]
fn other_cranes_stay_within_their_bounds() {
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

/// The cranes of the campaign move to the far end under the benchmark controller without a fault, and settle.
#[test]
fn the_cranes_of_the_campaign_are_stable() {
    campaign_cranes().unwrap().into_par_iter().for_each(|crane| {
        let motion = crane.machine.motion(crane.model.numbers.fast);
        let strategy = Strategy::BenchmarkClosedLoop;
        let mut run = Lockstep::new(&crane.model, &crane.machine, motion, strategy).unwrap();
        let mut operator = Operator::automatic(crane.model.numbers.control_period);
        // at rest at the far end the benchmark controller has settled
        let settled = motion.rest + motion.travel_time() + 0.6 * motion.dwell;
        let (mut swing, mut time) = (0.0_f64, 0.0);
        while time < settled + 1.0 {
            let last = run.period(&mut operator, strategy).unwrap();
            assert_eq!(last.decision.cause, None, "{}", crane.name);
            assert!(!operator.is_done(), "{} ends after {time} s", crane.name);
            time = last.course_time.unwrap_or(0.0);
            if time >= settled {
                swing = swing.max(last.error().unwrap_or(0.0).abs());
            }
        }
        assert!(swing < 2e-3, "{}: {:.2} mm at rest", crane.name, swing * 1e3);
    });
}
