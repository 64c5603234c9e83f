//! Monitor of position against delivered flow with the baseline of one healthy cycle.

use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::fault::Cause;
use hydroboom_control::supervision::limits::Limits;
use hydroboom_control::supervision::supervisor::State;
use hydroboom_description::Description;
use hydroboom_design::limits;
use hydroboom_realtime::control_task::Record;
use hydroboom_realtime::fault::{Fault, WrongPosition};
use hydroboom_realtime::flow_baseline::FlowBaseline;
use hydroboom_realtime::lockstep::Lockstep;
use hydroboom_realtime::operator::Operator;
use hydroboom_realtime::trouble::{Tampering, Trouble};

const STRATEGY: Strategy = Strategy::BenchmarkClosedLoop;

struct Course {
    records: Vec<Record>,
    /// Difference between true and measured position at the end of the course \[m\].
    wrong: f64,
}

/// Course at a speed \[m/s\] with an optional fault at a time of it \[s\].
fn course(limits: Limits, speed: f64, wrong: Option<(Fault, f64)>) -> Course {
    let model = Description::uia_single_boom().unwrap();
    let machine = Description::uia_virtual().unwrap();
    let motion = machine.motion(speed);
    let mut run = Lockstep::new(&model, &machine, motion, STRATEGY).unwrap().within(limits);
    let (mut operator, mut trouble) = (Operator::automatic(1e-3), Trouble::new(&machine));
    let mut course = Course { records: vec![], wrong: 0.0 };
    let mut wrong = wrong;
    while !operator.is_done() {
        let record = run.disturbed_period(&mut operator, STRATEGY, &mut trouble).unwrap();
        trouble.pass();
        if let Some((fault, _)) = wrong.filter(|(_, at)| record.course_time >= Some(*at)) {
            trouble.tamper(Tampering::Fault(fault));
            wrong = None;
        }
        course.wrong = record.signals().stroke - run.truth().outputs.stroke;
        course.records.push(record);
    }
    course
}

fn recorded() -> (Limits, FlowBaseline) {
    let model = Description::uia_single_boom().unwrap();
    let limits = limits(&model, model.numbers.fast).unwrap();
    let good = course(limits, model.numbers.fast, None);
    let baseline = FlowBaseline::of_course(&model, &limits.flow, &good.records).unwrap();
    (Limits { flow: baseline.narrowed(limits.flow), ..limits }, baseline)
}

#[test]
fn a_drift_is_found_before_10_mm_and_a_gain_of_5_percent_within_a_stroke() {
    let (narrowed, baseline) = recorded();
    // flow gain of the virtual crane's pump, without its slip
    let machine = Description::uia_virtual().unwrap();
    assert!((baseline.gain / machine.numbers.flow_gain - 1.0).abs() < 0.01, "{baseline:?}");
    assert!(baseline.residual < 1e-3, "{baseline:?}");
    let model = Description::uia_single_boom().unwrap();
    let (slow, fast) = (model.numbers.slow, model.numbers.fast);
    let motion = machine.motion(fast);
    let at_rest = motion.rest + motion.travel_time() + 1.0;
    let cases = [
        (WrongPosition::Drift2, fast, at_rest, 10e-3),
        (WrongPosition::Drift2, slow, 3.0, 10e-3),
        // a stroke is 400 mm here
        (WrongPosition::Gain5, fast, 0.0, 0.05 * 0.4),
        (WrongPosition::Gain5, slow, 0.0, 0.05 * 0.4),
    ];
    for (wrong, speed, at, most) in cases {
        let found = course(narrowed, speed, Some((Fault::Position(wrong), at)));
        let end = found.records.last().unwrap();
        assert_eq!(end.decision.state, State::Fault, "{wrong:?} at {speed} m/s is not found");
        assert_eq!(end.decision.cause, Some(Cause::PositionFlowDisagree), "{wrong:?}");
        assert!(found.wrong.abs() < most, "{wrong:?}: {} m wrong when found", found.wrong);
    }
}

#[test]
fn a_healthy_machine_agrees_with_its_baseline_cycle_after_cycle() {
    let (narrowed, _) = recorded();
    let model = Description::uia_single_boom().unwrap();
    for speed in [model.numbers.slow, model.numbers.fast] {
        let end = course(narrowed, speed, None).records.last().unwrap().decision;
        assert_eq!((end.state, end.cause), (State::Holding, None), "at {speed} m/s");
    }
}

#[test]
fn a_baseline_file_is_read_back_and_refused_for_another_crane() {
    let (_, baseline) = recorded();
    let model = Description::uia_single_boom().unwrap();
    let path = std::env::temp_dir().join(format!("hydroboom-baseline-{}", std::process::id()));
    std::fs::write(&path, baseline.text()).unwrap();
    let back = FlowBaseline::read(&model, &path).unwrap();
    assert!((back.gain - baseline.gain).abs() < 1e-12 && back.digest == baseline.digest);
    assert!(back.recorded_at > 1_700_000_000);
    let mut other = model.clone();
    other.set("cylinder.piston_mm=70").unwrap();
    let refused = FlowBaseline::read(&other, &path).unwrap_err().to_string();
    assert!(refused.contains("another crane file"), "{refused}");
    for (from, to, key) in [
        ("\"flow_gain\": ", "\"flow_gain\": 1", "flow_gain"),
        ("\"leakage_factor\": ", "\"leakage_factor\": 1e9, \"x\": ", "leakage_factor"),
        ("\"crane_digest\"", "\"digest\"", "another crane file"),
    ] {
        std::fs::write(&path, baseline.text().replace(from, to)).unwrap();
        let refused = FlowBaseline::read(&model, &path).unwrap_err().to_string();
        assert!(refused.contains(key), "{refused}");
    }
    std::fs::remove_file(&path).unwrap();
    // a stopped course is refused
    let limits = limits(&model, model.numbers.fast).unwrap();
    let stopped = course(limits, model.numbers.fast, Some((Fault::OperatorGone, 3.0)));
    let refused = FlowBaseline::of_course(&model, &limits.flow, &stopped.records).unwrap_err();
    assert!(refused.to_string().contains("operator-lost"), "{refused}");
}
