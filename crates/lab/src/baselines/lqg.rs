//! A plain LQG: state feedback of least quadratic cost on what a Kalman filter believes of the machine.

use super::kalman_filter::KalmanFilter;
use super::linear_plant::{LinearPlant, MOVES};
use super::riccati::least_cost;
use super::{Shown, Steers};
use crate::LabError;
use hydroboom_control::feedback::benchmark::BenchmarkInput;
use hydroboom_description::Description;
use nalgebra::{SMatrix, SVector, matrix};

/// Weights and noise that a linear baseline is designed by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// What costs as much as each other: errors of position \[m\], velocity \[m/s\], load pressure \[Pa\], and motor speed \[rev/s\].
    pub alike: [f64; 4],
    /// How far each state drifts in a second of its own accord, by standard deviation: position \[m\], velocity \[m/s\], load pressure \[Pa\], and the
    /// acceleration \[m/s²\] and rate of the pressure \[Pa/s\] that nobody knows of.
    pub drift: [f64; 5],
}

/// Found as [`RETUNED`](super::REOPTIMISED) was, by `reoptimise lqg`.
pub const LQG: Weights =
    Weights { alike: [1e-3, 2.13e-2, 1.58e6, 3.74], drift: [1e-5, 1.51e-3, 1.65e6, 0.241, 4.26e6] };

/// A cost of what moves.
pub(super) type CostToGo = SMatrix<f64, MOVES, MOVES>;
/// Motor speed by what moves.
pub(super) type Feedback = SMatrix<f64, 1, MOVES>;

impl Weights {
    /// Costs of what moves, and of the motor's speed.
    pub(super) fn costs(&self) -> (SMatrix<f64, MOVES, MOVES>, SMatrix<f64, 1, 1>) {
        let [position, velocity, pressure, speed] = self.alike.map(|size| 1.0 / (size * size));
        let states: SVector<f64, MOVES> = [position, velocity, pressure].into();
        (SMatrix::from_diagonal(&states), matrix![speed])
    }

    /// Cost-to-go of a crane, and the feedback of least cost.
    pub(super) fn feedback(&self, crane: &LinearPlant) -> Result<(CostToGo, Feedback), LabError> {
        let (a, b) = crane.moving();
        let (q, r) = self.costs();
        least_cost(&a, &b, &q, &r)
            .ok_or(LabError::NoBaseline("no feedback of least cost settles for this crane"))
    }
}

/// It at work.
pub(super) struct Lqg {
    crane: LinearPlant,
    filter: KalmanFilter,
    gain: Feedback,
    period: f64,
}

impl Lqg {
    pub(super) fn new(
        model: &Description,
        weights: &Weights,
        measured: &BenchmarkInput<f64>,
    ) -> Result<Self, LabError> {
        let period = model.numbers.control_period;
        let crane = LinearPlant::new(model, period)?;
        let filter = KalmanFilter::new(&crane, &weights.drift, measured, period)?;
        let (_, gain) = weights.feedback(&crane)?;
        Ok(Self { crane, filter, gain, period })
    }
}

impl Steers for Lqg {
    fn speed(&mut self, shown: &Shown<'_>) -> f64 {
        self.filter.correct(shown);
        let next = (shown.ahead)(self.period);
        let acceleration = (next.velocity - shown.reference.velocity) / self.period;
        let (wanted, speed) =
            self.crane.wanted(&shown.reference, acceleration, self.filter.disturbances());
        let believed = self.filter.state.fixed_rows::<MOVES>(0).into_owned();
        self.filter.predict(&self.crane, shown.reading.motor_speed);
        let limit = self.crane.speed_limit();
        (speed + (self.gain * (wanted - believed))[0]).clamp(-limit, limit)
    }
}
