//! Feedforward computed off line. The closed loop is simulated on the identified model and corrected there
//! by iterative learning control. Its commands are replayed on the machine without feedback.

use super::drive_delay::as_one_lag;
use super::iterative_learning_control::IterativeLearning;
use super::margins::exceeded;
use super::replay::replayed;
use super::stages::Stages;
use crate::LabError;
use crate::closed_loop::scenario::Course;
use crate::closed_loop::simulation::{Loop, Now};
use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::{AxisSignals, Measurement};
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::reference::trajectory::Trajectory;
use hydroboom_description::Description;
use hydroboom_design::scheduled_lqr::scheduled_lqr_controller;
use hydroboom_virtual_crane::{VirtualCrane, surrogate};

/// Learning cycles on the model, after which its error is about 0.01 mm.
const CYCLES: usize = 4;

/// Commands along a course for a machine measured at `stroke` \[m\]. `past` are its commands since it
/// rested at the start of the course. The model keeps its margins under the result.
///
/// # Errors
///
/// [`LabError::Design`] if there is no scheduled LQR for the model; [`LabError::Plant`] if it has no state of rest at
/// the start. [`LabError::Simulation`] if its state leaves the range of validity; [`LabError::Margins`] if it exceeds
/// its margins; [`LabError::Stopped`] on request.
pub(crate) fn feedforward(
    model: &Description,
    course: &dyn Course,
    past: &[AxisCommand<f64>],
    stroke: f64,
    stages: &Stages<'_>,
) -> Result<Vec<AxisCommand<f64>>, LabError> {
    let machine = surrogate(model);
    let here = after(&machine, past, course.reference(0.0).position, stages)?;
    let offset = stroke - here.signals().stroke;
    let commands = closed_loop(model, &machine, here.clone(), offset, course, stages)?;
    let learning = IterativeLearning::new(model, course, commands.len())?;
    let mut correction = learning.no_correction();
    for _ in 0..CYCLES {
        let corrected = learning.corrected(&commands, &correction);
        let (mut record, _) = replayed(&corrected, &mut here.clone(), course, stages)?;
        record.readings.iter_mut().for_each(|reading| reading.stroke += offset);
        correction = learning.learn(&correction, &record.readings, course);
    }
    let corrected = learning.corrected(&commands, &correction);
    within_margins(model, &corrected, here, course, stages)?;
    Ok(corrected)
}

/// Refuses commands under which a machine exceeds a crane's margins.
///
/// # Errors
///
/// [`LabError::Margins`] in that case; other errors if the machine cannot be simulated.
pub(crate) fn within_margins(
    crane: &Description,
    commands: &[AxisCommand<f64>],
    mut machine: VirtualCrane,
    course: &dyn Course,
    stages: &Stages<'_>,
) -> Result<(), LabError> {
    let (record, _) = replayed(commands, &mut machine, course, stages)?;
    let exceeded = exceeded(crane, &record, course);
    if exceeded.is_empty() { Ok(()) } else { Err(LabError::Margins(exceeded.join("; "))) }
}

/// Model after past commands, from rest at `start` \[m\]. The pressure that friction holds at rest depends
/// on the motion before.
fn after(
    machine: &Description,
    past: &[AxisCommand<f64>],
    start: f64,
    stages: &Stages<'_>,
) -> Result<VirtualCrane, LabError> {
    let mut machine = VirtualCrane::new(machine, &machine.start(start))?;
    for (k, command) in past.iter().enumerate() {
        stages.within_run(k, past.len())?;
        machine.advance(command).map_err(LabError::during("the cycle before, on the model"))?;
    }
    if !past.is_empty() {
        stages.done(1.0);
    }
    Ok(machine)
}

/// Commands of the scheduled LQR along the course. The known dead time is removed from the loop, and the
/// reference is advanced by it.
fn closed_loop(
    model: &Description,
    machine: &Description,
    surrogate: VirtualCrane,
    offset: f64,
    course: &dyn Course,
    stages: &Stages<'_>,
) -> Result<Vec<AxisCommand<f64>>, LabError> {
    let ahead = Ahead { course, lead: machine.numbers.drive_dead_time };
    let mut machine = surrogate.without_dead_time();
    let period = machine.period();
    let measured = |number: u64, machine: &VirtualCrane| {
        let time = number as f64 * period;
        Measurement::new(number + 1, time, [with_offset(machine.signals(), offset)])
    };
    let controller = Box::new(scheduled_lqr_controller(&as_one_lag(model))?);
    let mut controlled = Loop::start(model, controller, 0, &ahead, &measured(0, &machine))?;
    let periods = (course.duration() / period).round() as u64;
    let mut commands = Vec::with_capacity(periods as usize);
    for number in 0..periods {
        stages.within_run(number as usize, periods as usize)?;
        let now = Now { course: &ahead, period, number };
        let [command] = controlled.command(now, &measured(number, &machine))?.axes;
        machine.advance(&command).map_err(LabError::during("the closed loop on the model"))?;
        commands.push(command);
    }
    stages.done(1.0);
    Ok(commands)
}

/// Signals of a machine whose position exceeds its model's by an offset \[m\].
fn with_offset(signals: AxisSignals<f64>, offset: f64) -> AxisSignals<f64> {
    AxisSignals { stroke: signals.stroke + offset, ..signals }
}

/// Course advanced in time.
struct Ahead<'a> {
    course: &'a dyn Course,
    /// Lead time \[s\].
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

#[cfg(test)]
mod tests {
    use super::super::drive_delay::with_drive;
    use super::*;

    /// The same short motion keeps the margins of the crane file, and exceeds those of one with lower
    /// pressure limits.
    #[test]
    fn commands_that_exceed_a_margin_are_not_issued() {
        let mut model = with_drive(&Description::uia_single_boom().unwrap());
        for set in
            ["motion.ramp_s=0.4", "motion.end_mm=150", "motion.dwell_s=0.3", "motion.rest_s=0.3"]
        {
            model.set(set).unwrap();
        }
        let course = model.motion(model.numbers.fast);
        let go_on = |_: f64| true;
        let start = Trajectory::reference(&course, 0.0).position;
        let of =
            |model: &Description| feedforward(model, &course, &[], start, &Stages::new(6, &go_on));
        assert!(of(&model).unwrap().len() > 1000);
        model.set("supervision.pressure_bar=60").unwrap();
        let refused = of(&model).unwrap_err().to_string();
        assert!(refused.contains("supervision.pressure_bar allows 60.0"), "{refused}");
    }
}
