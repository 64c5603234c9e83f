//! Feedforward computed off line: the closed loop is simulated on the identified model, corrected by iterative learning control there, and its commands are
//! replayed on the machine without feedback.

use super::iterative_learning_control::{IterativeLearning, LearningSettings};
use super::surrogate::Surrogate;
use crate::LabError;
use crate::closed_loop::scenario::Course;
use crate::closed_loop::simulation::{Loop, Now};
use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::{AxisSignals, Measurement};
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::reference::trajectory::Trajectory;
use hydroboom_description::Description;
use hydroboom_design::scheduled_lqr::scheduled_lqr_controller;

/// Cycles of learning on the model: its error is a hundredth of a millimetre by then.
const CYCLES: usize = 4;

/// Commands along a course for a machine that is read at `stroke` \[m\] and was commanded `past` since it rested where the course begins.
///
/// # Errors
///
/// [`LabError`] when there is no scheduled LQR for the model, or the model has no rest there, or leaves what it holds for.
pub(crate) fn feedforward(
    model: &Description,
    course: &dyn Course,
    past: &[AxisCommand<f64>],
    stroke: f64,
) -> Result<Vec<AxisCommand<f64>>, LabError> {
    let here = after(model, past, course.reference(0.0).position)?;
    let offset = stroke - here.signals().stroke;
    let commands = closed_loop(model, here.clone(), offset, course)?;
    let settings = LearningSettings::default();
    let learning = IterativeLearning::new(model, course, commands.len(), settings)?;
    let mut correction = learning.no_correction();
    for _ in 0..CYCLES {
        let corrected = learning.corrected(&commands, &correction);
        let mut readings = here.clone().run(&corrected)?.readings;
        readings.iter_mut().for_each(|reading| reading.stroke += offset);
        correction = learning.learn(&correction, &readings, course);
    }
    Ok(learning.corrected(&commands, &correction))
}

/// The model after past commands, from its rest at `start` \[m\]: the pressure that friction holds at rest depends on how the piston came there.
fn after(
    model: &Description,
    past: &[AxisCommand<f64>],
    start: f64,
) -> Result<Surrogate, LabError> {
    let mut surrogate = Surrogate::new(model, start)?;
    let during = LabError::during("the cycle before, on the model");
    past.iter().try_for_each(|command| surrogate.advance(command)).map_err(during)?;
    Ok(surrogate)
}

/// Commands of the scheduled LQR along the course. The known dead time is left out of the loop, and the reference taken ahead by it.
fn closed_loop(
    model: &Description,
    surrogate: Surrogate,
    offset: f64,
    course: &dyn Course,
) -> Result<Vec<AxisCommand<f64>>, LabError> {
    let ahead = Ahead { course, lead: surrogate.motor().dead_time() };
    let mut machine = surrogate.without_dead_time();
    let period = machine.motor().period();
    let measured = |number: u64, machine: &Surrogate| {
        let time = number as f64 * period;
        Measurement::new(number + 1, time, [with_offset(machine.signals(), offset)])
    };
    let controller = Box::new(scheduled_lqr_controller(model)?);
    let mut controlled = Loop::start(model, controller, 0, &ahead, &measured(0, &machine))?;
    let periods = (course.duration() / period).round() as u64;
    let command = |number: u64| {
        let now = Now { course: &ahead, period, number };
        let [command] = controlled.command(now, &measured(number, &machine))?.axes;
        machine.advance(&command).map_err(LabError::during("the closed loop on the model"))?;
        Ok(command)
    };
    (0..periods).map(command).collect()
}

/// Signals of a machine that is farther out than its model by an offset \[m\].
fn with_offset(signals: AxisSignals<f64>, offset: f64) -> AxisSignals<f64> {
    AxisSignals { stroke: signals.stroke + offset, ..signals }
}

/// A course that is ahead of another.
struct Ahead<'a> {
    course: &'a dyn Course,
    /// Lead \[s\].
    lead: f64,
}

impl Trajectory for Ahead<'_> {
    fn reference(&self, t: f64) -> SetPoint<f64> {
        self.course.reference(t + self.lead)
    }
    fn duration(&self) -> f64 {
        self.course.duration() - self.lead
    }
    fn speed(&self) -> f64 {
        self.course.speed()
    }
}

impl Course for Ahead<'_> {
    fn name(&self) -> String {
        self.course.name()
    }
}
