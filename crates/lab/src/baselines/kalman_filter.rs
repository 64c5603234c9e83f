//! Steady-state Kalman filter of the linear plant with disturbance states. Measurements are position and
//! load pressure.

use super::linear_plant::{ALL, LinearPlant};
use super::riccati::least_variance;
use crate::LabError;
use hydroboom_control::feedback::benchmark::BenchmarkInput;
use nalgebra::{SMatrix, SVector, matrix, vector};

/// Standard deviations of the measurement noise: position \[m\], load pressure \[Pa\].
const READINGS: [f64; 2] = [1e-5, 3e4];
/// Kalman filter of constant gain.
pub(super) struct KalmanFilter {
    gain: SMatrix<f64, ALL, 2>,
    /// Estimated state: position \[m\], velocity \[m/s\], load pressure \[Pa\], disturbance acceleration \[m/s²\] and
    /// disturbance rate of the load pressure \[Pa/s\].
    pub state: SVector<f64, ALL>,
}

impl KalmanFilter {
    /// Filter of a plant sampled with `period` \[s\]. `drift`: standard deviation by which each state
    /// drifts in one second.
    pub(super) fn new(
        crane: &LinearPlant,
        drift: &[f64; ALL],
        period: f64,
    ) -> Result<Self, LabError> {
        let reads = matrix![1.0, 0.0, 0.0, 0.0, 0.0; 0.0, 0.0, 1.0, 0.0, 0.0];
        // states scaled to similar magnitudes, so that the Riccati recursion is well conditioned
        let scale = SMatrix::<f64, ALL, ALL>::from_diagonal(&vector![1e-3, 1e-2, 1e5, 0.1, 1e6]);
        let inverse = SMatrix::<f64, ALL, ALL>::from_diagonal(&scale.diagonal().map(|s| 1.0 / s));
        let a = inverse * crane.a * scale;
        let units = SMatrix::<f64, 2, 2>::from_diagonal(&vector![1e-3, 1e5]);
        let c = units.map(|v| if v == 0.0 { 0.0 } else { 1.0 / v }) * reads * scale;
        let drift = inverse * SVector::from(*drift);
        let q = SMatrix::from_diagonal(&drift.map(|d| d * d * period));
        let read = vector![READINGS[0] / 1e-3, READINGS[1] / 1e5];
        let r = SMatrix::from_diagonal(&read.map(|d| d * d));
        let gain = least_variance(&a, &c, &q, &r).ok_or(LabError::NoBaseline(
            "the Kalman filter's Riccati equation has no stabilising solution for this crane",
        ))?;
        let back = units.map(|v| if v == 0.0 { 0.0 } else { 1.0 / v });
        Ok(Self { gain: scale * gain * back, state: SVector::zeros() })
    }

    /// Initialises at rest at the measured position.
    pub(super) fn start(&mut self, measured: &BenchmarkInput<f64>) {
        self.state = vector![measured.stroke, 0.0, measured.load_pressure, 0.0, 0.0];
    }

    /// Measurement update.
    pub(super) fn correct(&mut self, measured: &BenchmarkInput<f64>) {
        let measured = vector![measured.stroke, measured.load_pressure];
        self.state += self.gain * (measured - vector![self.state[0], self.state[2]]);
    }

    /// Time update over one period at the given motor speed \[rev/s\].
    pub(super) fn predict(&mut self, crane: &LinearPlant, motor_speed: f64) {
        let (pressure, holding) = crane.rest(self.state[0]);
        self.state = crane.a * self.state + crane.b * vector![motor_speed - holding, pressure];
    }

    /// Estimated disturbances: acceleration \[m/s²\] and rate of the load pressure \[Pa/s\].
    pub(super) fn disturbances(&self) -> [f64; 2] {
        [self.state[3], self.state[4]]
    }
}
