//! Where the piston shall be.

use crate::motion::{Motion, Reference};

/// Where the piston shall be, over time.
pub trait Path: Send + Sync {
    /// Position and velocity at the time `t` \[s\].
    fn reference(&self, t: f64) -> Reference<f64>;
    /// Duration \[s\].
    fn duration(&self) -> f64;
    /// Largest speed \[m/s\].
    fn speed(&self) -> f64;
}

impl Path for Motion<f64> {
    fn reference(&self, t: f64) -> Reference<f64> {
        Motion::reference(self, t)
    }
    fn duration(&self) -> f64 {
        Motion::duration(self)
    }
    fn speed(&self) -> f64 {
        self.speed
    }
}
