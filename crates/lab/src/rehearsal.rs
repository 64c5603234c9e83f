//! Open loop by rehearsal: model following leads a model that stands in for the machine, and what that is told the machine is told, too.

use crate::LabError;
use crate::following::Following;
use crate::stand_in::StandIn;
use hydroboom_control::{Learner, Reference};
use hydroboom_description::Description;

/// Model following beside a model of the machine.
pub(crate) struct Rehearsal {
    following: Following,
    machine: StandIn,
}

impl Rehearsal {
    /// With what was learned of the machine on the way, and a model of it; from a rest at a piston position \[m\].
    ///
    /// # Errors
    ///
    /// [`LabError`] when either model has no rest there.
    pub(crate) fn new(
        model: &Description,
        learner: &Learner,
        machine: &Description,
        start: f64,
    ) -> Result<Self, LabError> {
        let machine = StandIn::new(machine, start)?;
        let (reading, measured) = (machine.reading(), machine.measured());
        let following = Following::resumed(model, learner, &reading, &measured, start)?;
        Ok(Self { following, machine })
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
        let (reading, measured) = (self.machine.reading(), self.machine.measured());
        let command = self.following.command(ahead, fastest, &reading, &measured)?;
        self.machine.advance(&command).map_err(LabError::during("the rehearsal"))?;
        Ok(command.motor_speed)
    }
}
