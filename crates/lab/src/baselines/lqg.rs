//! LQG: state feedback of least quadratic cost on the state that a Kalman filter estimates of the machine.

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

/// Weights and noise that a linear baseline is designed by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// What costs as much as each other: errors of position \[m\], velocity \[m/s\], load pressure \[Pa\], and motor speed \[rev/s\].
    pub alike: [f64; 4],
    /// How far each state drifts in a second of its own accord, by standard deviation: position \[m\], velocity \[m/s\], load pressure \[Pa\], and the
    /// acceleration \[m/s²\] and rate of the pressure \[Pa/s\] that nobody knows of.
    pub drift: [f64; 5],
}

/// Found by `cargo run --release -p hydroboom-lab --example reoptimise`: least geometric mean of the RMS error over the published benchmark's on virtual cranes of seed 7,
/// both speeds; a crane that oscillates, and does not with the published controller, counts as much as one whose error is ten times as large.
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

/// Linear-quadratic feedback of the Kalman filter's state.
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
