//! Cycle under given commands without feedback: record and tracking errors.

use super::record::Record;
use super::stages::Stages;
use crate::LabError;
use crate::closed_loop::scenario::Course;
use hydroboom_control::command::AxisCommand;
use hydroboom_description::Description;
use hydroboom_virtual_crane::VirtualCrane;

/// Tracking errors of a cycle \[m\].
#[derive(Clone, Debug, Default)]
pub(crate) struct Errors {
    /// True tracking errors x − x_ref \[m\], one a control period.
    pub true_error: Vec<f64>,
    /// Measured tracking errors x − x_ref \[m\], one a control period.
    pub measured: Vec<f64>,
}

impl Errors {
    /// Appends the present errors.
    pub(crate) fn push(&mut self, machine: &VirtualCrane, reference: f64) {
        self.true_error.push(machine.truth().outputs.stroke - reference);
        self.measured.push(machine.signals().stroke - reference);
    }
}

/// Root mean square.
pub(crate) fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|e| e * e).sum::<f64>() / errors.len().max(1) as f64).sqrt()
}

/// Crane at rest at the start of a course.
pub(crate) fn at_rest(crane: &Description, course: &dyn Course) -> Result<VirtualCrane, LabError> {
    Ok(VirtualCrane::new(crane, &crane.start(course.reference(0.0).position))?)
}

/// Runs a cycle with given commands along a course.
///
/// # Errors
///
/// [`LabError::Simulation`] if the state leaves the model's range of validity; [`LabError::Stopped`] on request.
pub(crate) fn replayed(
    commands: &[AxisCommand<f64>],
    machine: &mut VirtualCrane,
    course: &dyn Course,
    stages: &Stages<'_>,
) -> Result<(Record, Errors), LabError> {
    let period = machine.period();
    let (mut record, mut errors) = (Record::new(period), Errors::default());
    for (k, command) in commands.iter().enumerate() {
        stages.within_run(k, commands.len())?;
        errors.push(machine, course.reference(k as f64 * period).position);
        record.push(*command, machine.signals());
        machine.advance(command).map_err(LabError::during("a cycle without feedback"))?;
    }
    stages.done(1.0);
    Ok((record, errors))
}
