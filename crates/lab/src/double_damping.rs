//! Explanation why simulation feedforward in closed loop, as published, can be worse than the benchmark:
//! its second damping is removed for comparison.
//!
//! Plant G (motor speed to position, G_x, and to load pressure, G_p), PI C, pressure feedback F, loop
//! L = C G_x + F G_p. With identical model and plant the benchmark's error E becomes
//!
//! ```text
//! published:                    n = n_s + C e − F p           E' = (E + F G_p)/(1 + L)
//! pressure differences only:    n = n_s + C e − F (p − p_s)   E'' = E (1 + F G_p)/(1 + L)
//! ```

use crate::LabError;
use crate::closed_loop::metrics::{Metrics, TrackingError};
use crate::closed_loop::sample::Sample;
use crate::closed_loop::scenario::Course;
use crate::closed_loop::simulated_crane::SimulatedCrane;
use crate::{motion_test::Run, motion_test::attempted};
use hydroboom_control::command::AxisCommand;
use hydroboom_control::feedback::benchmark::BenchmarkInput;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_virtual_crane::VirtualCrane;
use serde::Serialize;

/// RMS and peak tracking errors of the three control laws on one plant along one course.
#[derive(Clone, Debug, Serialize)]
pub struct DoubleDamping {
    /// Name of the plant.
    pub plant: String,
    /// Name of the course.
    pub course: String,
    /// Tracking error of the benchmark controller.
    pub benchmark: TrackingError,
    /// Tracking error of simulation feedforward in closed loop as published: damped in the simulation and again on the
    /// plant.
    pub damped_twice: TrackingError,
    /// Tracking error with pressure feedback on the difference p − p_s to the simulation: damped once.
    pub damped_once: TrackingError,
    /// Whether each of the three laws, in this order, came to rest where its reference rested.
    pub stable: [bool; 3],
    /// Reason why the simulation of a law stopped before the course's end, in the same order; none if it ran to the
    /// end. A stopped law has no errors.
    pub stopped: [Option<String>; 3],
}

impl DoubleDamping {
    /// Name of each law with its tracking error, or a note in place of the error of a sustained oscillation or a stop.
    pub fn laws(&self) -> [(&'static str, Result<TrackingError, &'static str>); 3] {
        let names =
            ["benchmark", "published: damped twice", "pressure feedback on p - p_sim: damped once"];
        let errors = [self.benchmark, self.damped_twice, self.damped_once];
        std::array::from_fn(|k| {
            let found = match (&self.stopped[k], self.stable[k]) {
                (Some(_), _) => Err("stopped"),
                (None, false) => Err("unstable"),
                (None, true) => Ok(errors[k]),
            };
            (names[k], found)
        })
    }
}

/// Result of a controller: tracking error, whether it came to rest, and why it stopped.
type ControllerResult = (TrackingError, bool, Option<String>);

/// Compares the three laws along a course. Two come from `runs` on the plant, if both were run along it; the law that
/// damps once is simulated. `plant_name` is for the table.
///
/// # Errors
///
/// [`LabError::Plant`] if a crane has no state of rest. A law whose simulation leaves the model's range of validity is
/// no error: it is [`stopped`](DoubleDamping::stopped).
pub fn double_damping(
    model: &Description,
    plant_name: &str,
    plant: &Description,
    course: &dyn Course,
    runs: &[Run],
) -> Result<DoubleDamping, LabError> {
    let known = |strategy| -> Result<ControllerResult, LabError> {
        let of = |run: &Run| {
            let error = match run.stopped {
                None => run.metrics().tracking_error(),
                Some(_) => TrackingError::UNFINISHED,
            };
            (error, run.is_stable(), run.stopped.clone())
        };
        let name = course.name();
        match runs.iter().find(|run| run.strategy == strategy && run.course == name) {
            Some(run) => Ok(of(run)),
            None => Ok(of(&attempted(model, plant, strategy, course)?)),
        }
    };
    let first = known(Strategy::BenchmarkClosedLoop)?;
    let second = known(Strategy::SimulationFeedforwardClosedLoop)?;
    let third = match damped_once(model, plant, course) {
        Ok((error, stable)) => (error, stable, None),
        Err(LabError::Simulation { error, .. }) => {
            (TrackingError::UNFINISHED, false, Some(error.to_string()))
        }
        Err(other) => return Err(other),
    };
    Ok(DoubleDamping {
        plant: plant_name.into(),
        course: course.name(),
        benchmark: first.0,
        damped_twice: second.0,
        damped_once: third.0,
        stable: [first.1, second.1, third.1],
        stopped: [first.2, second.2, third.2],
    })
}

fn damped_once(
    model: &Description,
    plant: &Description,
    course: &dyn Course,
) -> Result<(TrackingError, bool), LabError> {
    let law = model.benchmark();
    let area_ratio = model.cylinder().area_ratio();
    let start = course.reference(0.0).position;
    let mut crane = VirtualCrane::new(plant, &plant.start(start))?;
    let mut simulated = SimulatedCrane::new(model, start)?;
    let simulated_input =
        |crane: &SimulatedCrane| BenchmarkInput::of_simulated(&crane.state().axes[0]);
    let beyond = |crane: &VirtualCrane, simulated: &BenchmarkInput<f64>| {
        let input = BenchmarkInput::of(&crane.signals(), area_ratio);
        BenchmarkInput { load_pressure: input.load_pressure - simulated.load_pressure, ..input }
    };
    let of_simulated = simulated_input(&simulated);
    let mut memory = law.start(&beyond(&crane, &of_simulated));
    let mut simulated_memory = law.start(&of_simulated);
    let mut simulated_speed = 0.0;
    let period = model.numbers.control_period;
    let periods = (course.duration() / period).round() as u64;
    let mut metrics = Metrics::new();
    for k in 0..=periods {
        let time = k as f64 * period;
        let reference = course.reference(time);
        let of_simulated = simulated_input(&simulated);
        let input = beyond(&crane, &of_simulated);
        let velocity = law.velocity_feedforward(&reference);
        let wanted = law.update(&mut simulated_memory, &reference, &of_simulated, velocity);
        simulated_speed = law.limits.follow(simulated_speed, wanted, law.period);
        simulated.advance(simulated_speed)?;
        let motor_speed = law.update(&mut memory, &reference, &input, simulated_speed);
        let command = AxisCommand { motor_speed, holding_valve: 1.0 };
        let (signals, truth) = (crane.signals(), crane.truth());
        metrics.add(&Sample {
            time,
            reference,
            signals,
            load_changed: false,
            truth,
            command,
            periods_without_solution: 0,
        });
        if k < periods {
            crane.advance(&command).map_err(LabError::during("damped once"))?;
        }
    }
    Ok((metrics.tracking_error(), !metrics.oscillates()))
}
