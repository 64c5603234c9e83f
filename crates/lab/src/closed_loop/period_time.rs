//! Execution time of a control period on this computer.

use crate::LabError;
use crate::closed_loop::controller_choice::ControllerChoice;
use crate::closed_loop::scenario::{Course, due};
use crate::closed_loop::simulation::{Loop, Now};
use hydroboom_control::command::Command;
use hydroboom_control::controller::{Controller, ControllerStatus, SimulatedState};
use hydroboom_control::measurement::Measurement;
use hydroboom_control::reference::preview::Preview;
use hydroboom_description::Description;
use hydroboom_design::scheduled_lqr::known_delay;
use hydroboom_virtual_crane::VirtualCrane;
use serde::Serialize;
use statrs::statistics::{Data, OrderStatistics};
use std::time::Instant;

/// Execution time of a control period: estimator and control law, without the simulation beside the
/// machine.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PeriodTime {
    /// Timed controller.
    #[serde(rename = "strategy")]
    pub controller: ControllerChoice,
    /// Median over the control periods of a course \[us\].
    pub median_us: f64,
    /// 99.9th percentile over the control periods of a course \[us\].
    pub percentile_99_9_us: f64,
}

/// Controller that records the execution time of every period \[us\].
struct Timed {
    controller: Box<dyn Controller>,
    times: Vec<f64>,
}

impl Controller for Timed {
    fn start(&mut self, measurement: &Measurement, delay_cycles: u32) {
        self.controller.start(measurement, delay_cycles);
    }

    fn update(
        &mut self,
        measurement: &Measurement,
        preview: &Preview<f64>,
        simulated: Option<&SimulatedState>,
    ) -> Command {
        let begin = Instant::now();
        let command = self.controller.update(measurement, preview, simulated);
        self.times.push(begin.elapsed().as_secs_f64() * 1e6);
        command
    }

    fn status(&self) -> ControllerStatus {
        self.controller.status()
    }
}

/// Execution times of controllers along a course on one crane, run one after the other. Each period counts
/// with its minimum over the runs, which excludes the load by other programs. Zero `runs` count as one.
///
/// # Errors
///
/// [`LabError::Plant`] if the crane has no state of rest; [`LabError::Design`], [`LabError::NoBaseline`] or
/// [`LabError::NoOscillation`] if a controller cannot be designed. [`LabError::Simulation`] if a state leaves the
/// model's range of validity.
pub fn period_times(
    model: &Description,
    crane: &Description,
    controllers: &[ControllerChoice],
    course: &dyn Course,
    runs: u32,
) -> Result<Vec<PeriodTime>, LabError> {
    controllers
        .iter()
        .map(|controller| {
            let mut least = timed(model, crane, *controller, course)?;
            for _ in 1..runs {
                let again = timed(model, crane, *controller, course)?;
                least.iter_mut().zip(again).for_each(|(least, time)| *least = least.min(time));
            }
            let mut data = Data::new(least);
            let mut share = |tau: f64| data.quantile(tau);
            let [median_us, percentile_99_9_us] = [0.5, 0.999].map(&mut share);
            Ok(PeriodTime { controller: *controller, median_us, percentile_99_9_us })
        })
        .collect()
}

/// Execution times of the periods of a run \[us\].
fn timed(
    model: &Description,
    crane: &Description,
    choice: ControllerChoice,
    course: &dyn Course,
) -> Result<Vec<f64>, LabError> {
    let mut crane = VirtualCrane::new(crane, &crane.start(course.reference(0.0).position))?;
    let period = model.numbers.control_period;
    let periods = (course.duration() / period).round() as u64;
    let times = Vec::with_capacity(periods as usize);
    let controller = Box::new(Timed { controller: choice.controller(model)?, times });
    let measurement = crane.measurement();
    let mut controlled = Loop::start(model, controller, known_delay(model), course, &measurement)?;
    let mut loads = course.loads();
    let during = format!("{}, {}", choice.name(), course.name());
    for number in 0..periods {
        if let Some(mass) = due(&mut loads, number as f64 * period) {
            crane.set_payload(mass)?;
        }
        let measurement = crane.measurement();
        let now = Now { course, period, number };
        let [command] = controlled.command(now, &measurement)?.axes;
        crane.advance(&command).map_err(LabError::during(&during))?;
    }
    Ok(controlled.controller.times)
}
