//! Number of operations of a control period under the scheduled LQR.
//! `cargo bench -p hydroboom-realtime --bench control_period_operations`
//!
//! Estimator, control law and preview run with numbers that [count](counted) their operations, and in
//! parallel with `f64`. The machine is the reduced model itself, commanded by the `f64` version. Both
//! versions must be bit-identical. There are two courses, one at 120 mm/s and one faster than the motor, so
//! that the reference governor limits its speed. At full speed a part of the payload is removed, so that
//! the controller predicts alternatives (rollout).
//!
//! For each part the table shows the period of median count and the one of largest count. The counts
//! include the weighting of interpolations.

mod counted;

use counted::{Counted, KINDS, Operation, Operations, operations};
use hydroboom_control::estimation::extended_kalman_filter::EstimatorInput;
use hydroboom_control::estimation::reduced_model::{MachineState, ReducedModel};
use hydroboom_control::estimation::state_estimator::StateEstimator;
use hydroboom_control::feedback::scheduled_lqr::ScheduledLqr;
use hydroboom_control::reference::preview::Preview;
use hydroboom_control::reference::profile::OutAndBack;
use hydroboom_description::Description;
use hydroboom_design::scheduled_lqr::{designed, known_delay};
use std::error::Error;
use std::fmt::Debug;

/// Speed of the faster course over the largest piston speed that the motor allows.
const FASTER: f64 = 1.2;
/// Time of the payload change \[s\], and new payload over the first.
const LOAD_CHANGE: f64 = 3.5;
const PAYLOAD: f64 = 0.7;
/// Piston-side pressure minus load pressure \[Pa\].
const BEYOND: f64 = 1.5e5;
/// Share of the distance to its command that the motor covers in a period.
const DRIVE_SHARE: f64 = 0.15;

/// The same estimator with counting numbers.
fn counting_estimator(estimator: &StateEstimator<f64>) -> StateEstimator<Counted> {
    StateEstimator {
        filter: estimator.filter.map(Counted),
        drive: estimator.drive.map(Counted),
        drive_coefficient: Counted(estimator.drive_coefficient),
        slew: Counted(estimator.slew),
        free_slew: Counted(estimator.free_slew),
        measurement_delay_cycles: estimator.measurement_delay_cycles,
        command_delay_cycles: estimator.command_delay_cycles,
    }
}

fn counting_law(law: &ScheduledLqr<f64>) -> ScheduledLqr<Counted> {
    ScheduledLqr {
        model: law.model.map(Counted),
        settings: law.settings.map(Counted),
        governor: law.governor.map(Counted),
        rollout: law.rollout.map(Counted),
        motor_speed: Counted(law.motor_speed),
        slew: Counted(law.slew),
        period: Counted(law.period),
    }
}

fn counting_motion(motion: &OutAndBack<f64>) -> OutAndBack<Counted> {
    OutAndBack {
        start: Counted(motion.start),
        end: Counted(motion.end),
        speed: Counted(motion.speed),
        ramp: Counted(motion.ramp),
        dwell: Counted(motion.dwell),
        rest: Counted(motion.rest),
        profile: motion.profile,
    }
}

/// The machine at rest at a piston position \[m\] with a payload \[kg\].
fn at_rest(model: &ReducedModel<f64>, position: f64, payload: f64) -> MachineState<f64> {
    let at = model.at(position, payload);
    MachineState {
        position: position - at.compliance * at.holding_pressure,
        velocity: 0.0,
        load_pressure: at.holding_pressure,
        friction: 0.0,
        disturbance: 0.0,
        unknown_flow: 0.0,
        payload,
        transition_pressure: model.oil.transition_pressure,
    }
}

fn measured(model: &ReducedModel<f64>, z: &MachineState<f64>, speed: f64) -> EstimatorInput<f64> {
    EstimatorInput {
        position: model.piston(z),
        position_is_good: 1.0,
        load_pressure: z.load_pressure,
        load_pressure_is_good: 1.0,
        rod_side_term: BEYOND,
        motor_speed: speed,
    }
}

/// Operations of each part in one period.
struct Period {
    preview: Operations,
    filter: Operations,
    drive: Operations,
    prediction: Operations,
    /// Without the prediction over the delays, which is shown separately.
    law: Operations,
}

/// Operations of every period of the course at a speed \[m/s\].
fn course(
    description: &Description,
    (estimator, law): &(StateEstimator<f64>, ScheduledLqr<f64>),
    speed: f64,
) -> Vec<Period> {
    let motion = description.motion(speed);
    let (model, period) = (estimator.filter.model, law.period);
    let delay = estimator.command_delay_cycles;
    let counting = (counting_estimator(estimator), counting_law(law), counting_motion(&motion));

    let mut z = at_rest(&model, motion.start, description.numbers.payload);
    let mut speed = model.leakage(z.load_pressure);
    let first = measured(&model, &z, speed);
    let mut estimated = estimator.start(&first);
    let regulator = law.settled_regulator(estimator, &estimated);
    let mut state = law.start(regulator, estimator, &estimated, motion.start);
    let mut preview = Preview::new(period, |after| motion.reference(after));

    let mut estimated_counting = counting.0.start(&first.map(Counted));
    let regulator = counting.1.settled_regulator(&counting.0, &estimated_counting);
    let mut state_counting =
        counting.1.start(regulator, &counting.0, &estimated_counting, Counted(motion.start));
    let mut preview_counting = Preview::new(Counted(period), |after| counting.2.reference(after));

    let (mut readings, mut commands) = (vec![first; delay + 1], vec![speed; delay + 1]);
    let mut periods = Vec::new();
    for k in 0..(motion.duration() / period).ceil() as usize {
        let time = k as f64 * period;
        if time >= LOAD_CHANGE {
            z.payload = PAYLOAD * description.numbers.payload;
        }
        let command = law.update(&mut state, estimator, &estimated, &preview);
        let (_, prediction) = operations(|| counting.0.predict(&estimated_counting));
        let (command_counting, with_prediction) = operations(|| {
            let estimated = &estimated_counting;
            counting.1.update(&mut state_counting, &counting.0, estimated, &preview_counting)
        });
        assert_eq!(command.to_bits(), command_counting.0.to_bits(), "command at {time} s");

        commands.push(command);
        let arrived = commands[commands.len() - 1 - delay];
        let way = (DRIVE_SHARE * (arrived - speed)).clamp(-law.slew, law.slew);
        z = model.step(&z, speed + 0.5 * way, BEYOND, period);
        speed += way;
        readings.push(measured(&model, &z, speed));
        let read = readings[readings.len() - 1 - delay];

        estimator.update(&mut estimated, &read, command);
        let read = read.map(Counted);
        let mut alone = estimated_counting.filter;
        let ((), filter) = operations(|| counting.0.filter.update(&mut alone, &read));
        let ((), with_filter) = operations(|| {
            counting.0.update(&mut estimated_counting, &read, command_counting);
        });

        let now = time + period;
        preview.advance(|after| motion.reference(now + after));
        let ((), preview) = operations(|| {
            preview_counting.advance(|after| counting.2.reference(Counted(now) + after));
        });
        periods.push(Period {
            preview,
            filter,
            drive: with_filter - filter,
            prediction,
            law: with_prediction - prediction,
        });
    }
    // all state variables, bit by bit
    assert_alike("estimator", &estimated, &estimated_counting);
    assert_alike("law", &state, &state_counting);
    assert_alike("preview", &preview, &preview_counting);
    periods
}

/// Compares by the debug text, which differs for every value of a floating-point number.
fn assert_alike(what: &str, plain: &impl Debug, counting: &impl Debug) {
    assert_eq!(format!("{plain:?}"), format!("{counting:?}"), "{what} at the end of the course");
}

/// Work of the control law in a period.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Work {
    Law,
    /// First period of a rollout decision.
    SamplesReference,
    /// Every other period.
    PredictsAlternative,
}

/// Classification by the functions called. Only a prediction evaluates a power, and inverse dynamics along
/// the reference ahead evaluate more hyperbolic tangents than the law itself.
fn work(law: &Operations, least: u64) -> Work {
    if law.of(Operation::Exponential) > 0 {
        Work::PredictsAlternative
    } else if law.of(Operation::Tanh) > least {
        Work::SamplesReference
    } else {
        Work::Law
    }
}

/// Prints a row each for the period of median count and of largest count.
fn print(name: &str, operations: impl Iterator<Item = Operations>) {
    let mut sorted: Vec<_> = operations.collect();
    sorted.sort_by_key(|o| o.sum() + o.weighting);
    let (Some(median), Some(largest)) = (sorted.get(sorted.len() / 2), sorted.last()) else {
        println!("{name:32} in no period");
        return;
    };
    for (which, operations) in [("median", median), ("largest", largest)] {
        print!("{name:32}{:>8} {which:8}", sorted.len());
        operations.kinds.iter().for_each(|number| print!("{number:>8}"));
        println!("{:>8}{:>10}", operations.sum(), operations.weighting);
    }
}

/// Prints the table of a course.
fn table(periods: &[Period], speed: f64) {
    print!("{:32}{:>8} {:8}", format!("course of {:.0} mm/s", speed * 1e3), "periods", "");
    KINDS.iter().for_each(|kind| print!("{kind:>8}"));
    println!("{:>8}{:>10}", "sum", "weighting");
    let least = periods.iter().map(|p| p.law.of(Operation::Tanh)).min().unwrap_or(0);
    let law =
        |wanted: Work| periods.iter().map(|p| p.law).filter(move |law| work(law, least) == wanted);
    print("preview", periods.iter().map(|p| p.preview));
    print("estimator", periods.iter().map(|p| p.filter + p.drive + p.prediction));
    print("  filter", periods.iter().map(|p| p.filter));
    print("  drive identification", periods.iter().map(|p| p.drive));
    print("  prediction over the delays", periods.iter().map(|p| p.prediction));
    print("law", law(Work::Law));
    print("  reference sampled (rollout)", law(Work::SamplesReference));
    print("  alternative predicted (rollout)", law(Work::PredictsAlternative));
}

fn main() -> Result<(), Box<dyn Error>> {
    let description = Description::uia_single_boom()?;
    let controller = designed(&description, known_delay(&description) as usize)?;
    let (_, law) = &controller;
    let fastest = law.motor_speed / law.model.revolutions_per_metre();
    for speed in [description.numbers.fast, FASTER * fastest] {
        table(&course(&description, &controller, speed), speed);
    }
    Ok(())
}
