//! LQG: linear-quadratic state feedback on the state estimate of a Kalman filter.

use super::kalman_filter::KalmanFilter;
use super::linear_plant::{LinearPlant, MOVES};
use super::riccati::least_cost;
use crate::LabError;
use hydroboom_control::command::Command;
use hydroboom_control::controller::{Controller, ControllerStatus, SimulatedState};
use hydroboom_control::feedback::benchmark::BenchmarkInput;
use hydroboom_control::measurement::Measurement;
use hydroboom_control::reference::preview::Preview;
use hydroboom_description::Description;
use nalgebra::{SMatrix, SVector, matrix};

/// Weights of the state feedback and noise of the Kalman filter of the LQG design.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// Deviations of equal cost by Bryson's rule: position \[m\], velocity \[m/s\], load pressure \[Pa\], and motor
    /// speed \[rev/s\]. The weight of each is the reciprocal of its square.
    pub alike: [f64; 4],
    /// Process noise: standard deviation by which each state drifts in one second. The states are position
    /// \[m\], velocity \[m/s\], load pressure \[Pa\], disturbance acceleration \[m/s²\] and disturbance
    /// rate of the pressure \[Pa/s\].
    pub drift: [f64; 5],
}

/// Weights and noise in use: the result of `cargo run --release -p hydroboom-lab --example reoptimise`. It minimises
/// the geometric mean of the RMS error over the published benchmark's on virtual cranes of seed 7 at both speeds. A
/// crane that oscillates only under the LQG counts with ten times its error.
pub const LQG: Weights =
    Weights { alike: [1e-3, 2.13e-2, 1.58e6, 3.74], drift: [1e-5, 1.51e-3, 1.65e6, 0.241, 4.26e6] };

/// Cost-to-go matrix of position, velocity and load pressure.
pub(super) type CostToGo = SMatrix<f64, MOVES, MOVES>;
/// Feedback gain from position, velocity and load pressure to motor speed.
pub(super) type Feedback = SMatrix<f64, 1, MOVES>;

impl Weights {
    /// Cost matrices Q and R.
    pub(super) fn costs(&self) -> (SMatrix<f64, MOVES, MOVES>, SMatrix<f64, 1, 1>) {
        let [position, velocity, pressure, speed] = self.alike.map(|size| 1.0 / (size * size));
        let states: SVector<f64, MOVES> = [position, velocity, pressure].into();
        (SMatrix::from_diagonal(&states), matrix![speed])
    }

    /// Cost-to-go matrix of a plant, and the optimal feedback gain.
    pub(super) fn feedback(&self, crane: &LinearPlant) -> Result<(CostToGo, Feedback), LabError> {
        let (a, b) = crane.moving();
        let (q, r) = self.costs();
        least_cost(&a, &b, &q, &r).ok_or(LabError::NoBaseline(
            "the Riccati equation has no stabilising solution for this crane",
        ))
    }
}

/// Linear-quadratic feedback on the Kalman filter's state.
pub(super) struct Lqg {
    plant: LinearPlant,
    filter: KalmanFilter,
    gain: Feedback,
    /// Control period \[s\].
    period: f64,
    /// Rod-side area over piston area.
    area_ratio: f64,
}

impl Lqg {
    pub(super) fn new(model: &Description, weights: &Weights) -> Result<Self, LabError> {
        let period = model.numbers.control_period;
        let plant = LinearPlant::new(model, period)?;
        let filter = KalmanFilter::new(&plant, &weights.drift, period)?;
        let (_, gain) = weights.feedback(&plant)?;
        Ok(Self { plant, filter, gain, period, area_ratio: model.cylinder().area_ratio() })
    }
}

impl Controller for Lqg {
    fn start(&mut self, measurement: &Measurement, _delay_cycles: u32) {
        let signals = &measurement.axes[0].signals;
        self.filter.start(&BenchmarkInput::of(signals, self.area_ratio));
    }

    fn update(
        &mut self,
        measurement: &Measurement,
        preview: &Preview<f64>,
        _simulated: Option<&SimulatedState>,
    ) -> Command {
        let signals = &measurement.axes[0].signals;
        self.filter.correct(&BenchmarkInput::of(signals, self.area_ratio));
        let (now, next) = (preview.now(), preview.at(self.period));
        let acceleration = (next.velocity - now.velocity) / self.period;
        let (wanted, speed) = self.plant.wanted(&now, acceleration, self.filter.disturbances());
        let estimated = self.filter.state.fixed_rows::<MOVES>(0).into_owned();
        self.filter.predict(&self.plant, signals.motor_speed);
        let limit = self.plant.speed_limit();
        let speed = (speed + (self.gain * (wanted - estimated))[0]).clamp(-limit, limit);
        Command::released([speed])
    }

    fn status(&self) -> ControllerStatus {
        ControllerStatus { is_closed_loop: true, ..ControllerStatus::default() }
    }
}
