//! Why the published closed loop of simulation feedforward can be worse than the benchmark, shown by
//! taking its second damping away.
//!
//! Plant G (motor speed to position, G_x, and to load pressure, G_p), PI C, pressure feedback F, loop
//! L = C G_x + F G_p. With model and plant alike, the benchmark's error E becomes
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
use crate::{motion_test::Run, motion_test::run};
use hydroboom_control::command::AxisCommand;
use hydroboom_control::feedback::benchmark::BenchmarkInput;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_virtual_crane::VirtualCrane;
use serde::Serialize;

/// RMS and peak tracking errors on one plant along one course.
#[derive(Clone, Debug, Serialize)]
pub struct DoubleDamping {
    /// Name of the plant.
    pub plant: String,
    /// Name of the course.
    pub course: String,
    /// The benchmark controller.
    pub benchmark: TrackingError,
    /// Simulation feedforward in closed loop, as published: damped in the simulation and again on the
    /// plant.
    pub damped_twice: TrackingError,
    /// The same with the pressure feedback acting on p − p_sim: damped once.
    pub damped_once: TrackingError,
    /// Whether each of the three, in this order, came to rest where its reference rested.
    pub stable: [bool; 3],
}

impl DoubleDamping {
    /// Each law with its error, and whether it came to rest: an error beside a sustained oscillation tells of that.
    pub fn laws(&self) -> [(&'static str, TrackingError, bool); 3] {
        let [benchmark, twice, once] = self.stable;
        [
            ("benchmark", self.benchmark, benchmark),
            ("published: damped twice", self.damped_twice, twice),
            ("pressure feedback on p - p_sim: damped once", self.damped_once, once),
        ]
    }
}

/// The three along a course: two from `runs` on the plant, where both have been run along it, and the
/// one that damps once. `plant_name` is for the table.
///
/// # Errors
///
/// [`LabError`] when a crane cannot be simulated.
pub fn double_damping(
    model: &Description,
    plant_name: &str,
    plant: &Description,
    course: &dyn Course,
    runs: &[Run],
) -> Result<DoubleDamping, LabError> {
    let known = |strategy| -> Result<(TrackingError, bool), LabError> {
        let of = |run: &Run| (run.metrics().tracking_error(), run.sustained_oscillation.is_none());
        let name = course.name();
        match runs.iter().find(|run| run.strategy == strategy && run.course == name) {
            Some(run) => Ok(of(run)),
            None => Ok(of(&run(model, plant, strategy, course)?)),
        }
    };
    let (benchmark, first) = known(Strategy::BenchmarkClosedLoop)?;
    let (damped_twice, second) = known(Strategy::SimulationFeedforwardClosedLoop)?;
    let (damped_once, third) = damped_once(model, plant, course)?;
    Ok(DoubleDamping {
        plant: plant_name.into(),
        course: course.name(),
        benchmark,
        damped_twice,
        damped_once,
        stable: [first, second, third],
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
        metrics.add(&Sample { time, reference, signals, load_changed: false, truth, command });
        if k < periods {
            crane.advance(&command).map_err(LabError::during("damped once"))?;
        }
    }
    Ok((metrics.tracking_error(), !metrics.oscillates()))
}
