//! Open loop by rehearsal: model following leads a model that stands in for the machine, and what that is told the machine is told, too.

use crate::LabError;
use crate::following::Following;
use crate::stand_in::StandIn;
use hydroboom_control::{Command, Learner, Measured, Reading, Reference};
use hydroboom_description::Description;

/// What a rehearsal begins with.
pub(crate) struct Beginning {
    /// The model that is followed.
    pub model: Description,
    /// What model following has learned of the machine.
    pub learner: Learner,
    /// What the machine has been told since it rested at the start of the course, each control period: it goes straight on.
    pub told: Vec<Command<f64>>,
}

/// Model following beside a model of the machine.
pub(crate) struct Rehearsal {
    following: Following,
    machine: StandIn,
    /// By how much the machine's motor is later than the stand-in's \[s\]: so much sooner it is told.
    sooner: f64,
    /// By how much the machine is farther out than the stand-in \[m\].
    farther: f64,
}

impl Rehearsal {
    /// With a model of a machine that is read to be at `stroke` \[m\], and rested at `start` \[m\] before it was told anything.
    ///
    /// # Errors
    ///
    /// [`LabError`] when either model has no rest there, or the machine's cannot go the way it came.
    pub(crate) fn new(
        beginning: &Beginning,
        machine: &Description,
        start: f64,
        stroke: f64,
    ) -> Result<Self, LabError> {
        let Beginning { model, learner, told } = beginning;
        let mut stand_in = StandIn::new(machine, start)?;
        // what friction holds, and the oil with it, hangs on how the machine came here
        for command in told {
            stand_in
                .advance(command)
                .map_err(LabError::during("what came before the rehearsal"))?;
        }
        // drive and sensors are late, but not by a dead time all of it: the loop around one that is 16 ms late rings on at rest
        let lead = model.numbers.following_lead;
        let sooner = machine.numbers.following_lead - lead;
        let machine = stand_in.late_by(lead);
        let farther = stroke - machine.reading().stroke;
        let (reading, measured) = read_of(&machine, farther);
        let following = Following::resumed(model, learner, &reading, &measured, start)?;
        Ok(Self { following, machine, sooner, farther })
    }

    /// Motor speed \[rev/s\] for the coming period, in which the rehearsal moves on. `ahead` is where the reference is so many seconds from now, `fastest`
    /// its largest velocity \[m/s\].
    ///
    /// # Errors
    ///
    /// [`LabError`] when either model leaves what it holds for.
    pub(crate) fn speed(
        &mut self,
        ahead: &dyn Fn(f64) -> Reference<f64>,
        fastest: f64,
    ) -> Result<f64, LabError> {
        let (reading, measured) = read_of(&self.machine, self.farther);
        let sooner = |after: f64| ahead(after + self.sooner);
        let command = self.following.command(&sooner, fastest, &reading, &measured)?;
        self.machine.advance(&command).map_err(LabError::during("the rehearsal"))?;
        Ok(command.motor_speed)
    }
}

/// What would be read of a machine that is so much farther out than what stands in for it \[m\].
fn read_of(stand_in: &StandIn, farther: f64) -> (Reading<f64>, Measured<f64>) {
    let (mut reading, mut measured) = (stand_in.reading(), stand_in.measured());
    reading.stroke += farther;
    measured.stroke += farther;
    (reading, measured)
}
