//! Model following, and LQG on what the machine differs from the simulated crane: what friction, leakage and pump do otherwise there
//! is believed by a Kalman filter, and made good for at once.

use super::linear_crane::{LinearCrane, MOVES};
use super::lqg::{Feedback, Weights};
use super::observer::Observer;
use super::{Shown, Steers};
use crate::LabError;
use crate::following::Following;
use hydroboom_control::{Measured, Reading};
use hydroboom_description::Description;
use nalgebra::{SVector, vector};

/// Those of LQG; `reoptimise following` searches for others.
pub const FOLLOWING_LQG: Weights = super::LQG;

/// Oil of at least this share of stiff oil's bulk modulus, where the pressure dips lowest, is stiff enough for what the filter was designed for; oil
/// of at most the other is not.
const STIFF: f64 = 0.95;
const SOFT: f64 = 0.7;

/// It at work.
pub(super) struct FollowingLqg {
    following: Following,
    crane: LinearCrane,
    observer: Observer,
    gain: Feedback,
    /// Motor speed that the simulation asked for, times what the pump is found to lack.
    share: f64,
}

impl FollowingLqg {
    pub(super) fn new(
        model: &Description,
        weights: &Weights,
        (reading, measured): (&Reading<f64>, &Measured<f64>),
        start: f64,
    ) -> Result<Self, LabError> {
        let period = model.numbers.control_period;
        let crane = LinearCrane::new(model, period)?;
        let following = Following::new(model, reading, measured, start)?;
        let (there, lacking) = following.compared(measured, &following.seen());
        let off = Measured {
            stroke: lacking.stroke - there.position,
            load_pressure: lacking.load_pressure,
        };
        let mut observer = Observer::new(&crane, &weights.drift, &off, period)?;
        // what differs at rest is held by friction
        observer.state[3] = crane.held(off.load_pressure);
        let (_, gain) = weights.feedback(&crane)?;
        Ok(Self { following, crane, observer, gain, share: 0.0 })
    }
}

impl Steers for FollowingLqg {
    fn speed(&mut self, shown: &Shown<'_>) -> Result<f64, LabError> {
        let Shown { reference, reading, measured, .. } = shown;
        let (seen, [simulated, gently]) = self.following.period(reference, reading, measured)?;
        let (there, lacking) = self.following.compared(measured, &seen);
        let off = vector![lacking.stroke - there.position, lacking.load_pressure];
        self.observer.believe(off);
        let (wanted, against) = self.crane.against(self.observer.unknown());
        let believed: SVector<f64, MOVES> = self.observer.state.fixed_rows::<MOVES>(0).into_owned();
        self.observer.move_on(&self.crane, vector![reading.motor_speed - self.share, 0.0]);
        self.share = self.following.correction() * simulated;
        let limit = self.crane.speed_limit();
        let speed = self.share + against + (self.gain * (wanted - believed))[0];
        // oil that may be soft is fed back to as model following does
        let stiffness = self.following.least_stiffness(seen.stroke);
        let stiff = ((stiffness - SOFT) / (STIFF - SOFT)).clamp(0.0, 1.0);
        Ok((stiff * speed + (1.0 - stiff) * gently).clamp(-limit, limit))
    }
}
