//! Trajectory: position and velocity of the piston as functions of time.

use crate::reference::profile::{OutAndBack, SetPoint};

/// Trajectory of the piston: path and time law.
pub trait Trajectory: Send + Sync {
    /// Set point at the time `t` \[s\].
    fn reference(&self, t: f64) -> SetPoint<f64>;
    /// Duration of the trajectory \[s\].
    fn duration(&self) -> f64;
    /// Largest speed of the trajectory \[m/s\].
    fn speed(&self) -> f64;
}

impl Trajectory for OutAndBack<f64> {
    fn reference(&self, t: f64) -> SetPoint<f64> {
        OutAndBack::reference(self, t)
    }
    fn duration(&self) -> f64 {
        OutAndBack::duration(self)
    }
    fn speed(&self) -> f64 {
        self.speed
    }
}
