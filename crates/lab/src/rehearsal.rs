//! Open loop by rehearsal: model following leads a model that stands in for the machine, and what that is told, amended, the machine is told, too.

use crate::LabError;
use crate::amended::amended;
use crate::closed_loop::scenario::Course;
use crate::following::Following;
use crate::hindsight::Log;
use crate::stand_in::StandIn;
use hydroboom_control::command::AxisCommand;
use hydroboom_control::learner::Learner;
use hydroboom_control::measurement::AxisSignals;
use hydroboom_description::Description;

/// What is known of a machine once a cycle is over.
pub(crate) struct Rehearsal<'a> {
    /// The model that is followed.
    pub model: &'a Description,
    /// What model following has learned of the machine.
    pub learner: &'a Learner,
    /// The model of the machine that stands in for it.
    pub machine: &'a Description,
}

impl Rehearsal<'_> {
    /// What to tell the machine along a course, each control period. It is read to be at `stroke` \[m\], and has been told as much since it
    /// rested where the course begins.
    ///
    /// The loop on the model is as good as the loop on the machine, and no better: what it is off there is known, and amended.
    ///
    /// # Errors
    ///
    /// [`LabError`] when either model has no rest there, or cannot go the way.
    pub(crate) fn told(
        &self,
        course: &dyn Course,
        came: &[AxisCommand<f64>],
        stroke: f64,
    ) -> Result<Vec<AxisCommand<f64>>, LabError> {
        let here = self.here(came, course.reference(0.0).position)?;
        // by how much the machine is farther out than what stands in for it
        let farther = stroke - here.signals().stroke;
        let told = self.led(here.clone(), farther, course)?;
        let mut read = Vec::with_capacity(told.len());
        let mut stand_in = here.clone();
        for command in &told {
            read.push(read_of(&stand_in, farther));
            stand_in.advance(command).map_err(LabError::during("the rehearsal once more"))?;
        }
        amended(&here, &Log { told: &told, read: &read }, course)
    }

    /// What stands in for the machine, where it has come to from its rest at `start` \[m\]: what friction holds, and the oil with it, hangs on how it
    /// came there.
    fn here(&self, came: &[AxisCommand<f64>], start: f64) -> Result<StandIn, LabError> {
        let mut stand_in = StandIn::new(self.machine, start)?;
        let during = LabError::during("what came before the rehearsal");
        came.iter().try_for_each(|command| stand_in.advance(command)).map_err(during)?;
        Ok(stand_in)
    }

    /// What leads it along the course.
    fn led(
        &self,
        stand_in: StandIn,
        farther: f64,
        course: &dyn Course,
    ) -> Result<Vec<AxisCommand<f64>>, LabError> {
        // drive and sensors are late, but not by a dead time all of it: the loop around one that is 16 ms late rings on at rest
        let lead = self.model.numbers.following_lead;
        let sooner = self.machine.numbers.following_lead - lead;
        let mut machine = stand_in.late_by(lead);
        let start = course.reference(0.0).position;
        let reading = read_of(&machine, farther);
        let mut following = Following::resumed(self.model, self.learner, &reading, start)?;
        let period = machine.motor().period();
        let periods = (course.duration() / period).round() as u64;
        let command = |k: u64| {
            let ahead = |after: f64| course.reference(k as f64 * period + after + sooner);
            let reading = read_of(&machine, farther);
            let command = following.command(&ahead, course.speed(), &reading)?;
            machine.advance(&command).map_err(LabError::during("the rehearsal"))?;
            Ok(AxisCommand { holding_valve: 1.0, ..command })
        };
        (0..periods).map(command).collect()
    }
}

/// What would be read of a machine that is so much farther out than what stands in for it \[m\].
fn read_of(stand_in: &StandIn, farther: f64) -> AxisSignals<f64> {
    let mut reading = stand_in.signals();
    reading.stroke += farther;
    reading
}
