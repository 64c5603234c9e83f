//! State feedback scheduled over the payload.

use crate::model_following::ModelFollowing;
use hydroboom_math::Real;

/// How many payloads state feedback is designed for.
pub const PAYLOADS: usize = 6;

/// State feedback for any payload.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Schedule {
    /// Payloads \[kg\], rising.
    pub payloads: [f64; PAYLOADS],
    /// State feedback for each.
    pub laws: [ModelFollowing<f64>; PAYLOADS],
}

impl Schedule {
    /// State feedback for a payload \[kg\].
    pub fn at(&self, payload: f64) -> ModelFollowing<f64> {
        let (k, share) = self.around(payload);
        self.laws[k].between(&self.laws[k + 1], share)
    }

    /// What is not withheld of the motor beyond what is fed forward with a payload \[kg\], as a share of its speed.
    pub(crate) fn beyond(&self, payload: f64) -> f64 {
        let (k, share) = self.around(payload);
        let [below, above] = [k, k + 1].map(|k| self.laws[k].reserve.beyond);
        below + share * (above - below)
    }

    /// The number of the payload below one \[kg\], and by which share of the way to the next that is above it.
    fn around(&self, payload: f64) -> (usize, f64) {
        let last = PAYLOADS - 2;
        let k = self.payloads.partition_point(|p| *p <= payload).saturating_sub(1).min(last);
        let [below, above] = [self.payloads[k], self.payloads[k + 1]];
        (k, Real::clamp((payload - below) / (above - below), 0.0, 1.0))
    }

    /// The payload \[kg\] with which the crane rests at a load pressure \[Pa\], piston at `stroke` \[m\].
    pub fn payload(&self, stroke: f64, load_pressure: f64) -> f64 {
        let share = (load_pressure - self.empty(stroke)) / self.span(stroke);
        Real::clamp(share, 0.0, 1.0) * self.heaviest()
    }

    /// Where the crane is known, by the number of the station \[m\].
    pub(crate) fn position(&self, station: usize) -> f64 {
        let law = &self.laws[0];
        law.first + station as f64 * law.spacing
    }

    /// The heaviest payload that is thought of \[kg\].
    pub fn heaviest(&self) -> f64 {
        self.payloads[PAYLOADS - 1]
    }

    /// Payload by load pressure \[kg/Pa\], piston at `stroke` \[m\].
    pub(crate) fn per_pressure(&self, stroke: f64) -> f64 {
        self.heaviest() / self.span(stroke)
    }

    /// Load pressure \[Pa\] at which the crane rests without payload, piston at `stroke` \[m\].
    pub(crate) fn empty(&self, stroke: f64) -> f64 {
        self.laws[0].station(stroke).rest.load_pressure
    }

    fn span(&self, stroke: f64) -> f64 {
        self.laws[PAYLOADS - 1].station(stroke).rest.load_pressure - self.empty(stroke)
    }
}
