//! Linear model-predictive control: the motor speeds of the next half second that cost least, of which the first is taken.

use super::box_qp::BoxQp;
use super::kalman_filter::KalmanFilter;
use super::linear_plant::{ALL, LinearPlant, MOVES};
use super::lqg::Weights;
use crate::LabError;
use hydroboom_control::command::Command;
use hydroboom_control::controller::{Controller, ControllerStatus, SimulatedState};
use hydroboom_control::feedback::benchmark::BenchmarkInput;
use hydroboom_control::measurement::Measurement;
use hydroboom_control::reference::preview::Preview;
use hydroboom_description::Description;
use nalgebra::{DMatrix, DVector, SMatrix, vector};

/// Blocks in which the motor speed is constant, and their length \[s\].
const BLOCKS: usize = 25;
const BLOCK: f64 = 0.02;
/// Steps of the solver in a period; it begins where the last period's ended.
const STEPS: u32 = 30;

/// Those of LQG, which its costs have to be compared with.
pub const MPC: Weights = super::LQG;

/// Model-predictive control of the linear plant.
pub(super) struct LinearMpc {
    /// Sampled with the control period, for the observer, and with a block's length.
    plant: LinearPlant,
    blocks: LinearPlant,
    filter: KalmanFilter,
    /// From motor speeds to all states to come.
    response: DMatrix<f64>,
    /// Costs of all states to come, and of a motor speed.
    costs: DMatrix<f64>,
    by_speed: f64,
    program: BoxQp,
    speeds: DVector<f64>,
    /// Rod-side area over piston area.
    area_ratio: f64,
}

impl LinearMpc {
    pub(super) fn new(model: &Description, weights: &Weights) -> Result<Self, LabError> {
        let period = model.numbers.control_period;
        let plant = LinearPlant::new(model, period)?;
        let blocks = LinearPlant::new(model, BLOCK)?;
        let filter = KalmanFilter::new(&plant, &weights.drift, period)?;
        let (a, b) = blocks.moving();
        let (q, r) = weights.costs();
        let (to_go, _) = weights.feedback(&blocks)?;
        let mut response = DMatrix::zeros(MOVES * BLOCKS, BLOCKS);
        let mut column = b;
        for lag in 0..BLOCKS {
            for k in 0..BLOCKS - lag {
                let place = (MOVES * (k + lag), k);
                response.view_mut(place, (MOVES, 1)).copy_from(&column);
            }
            column = a * column;
        }
        let mut costs = DMatrix::zeros(MOVES * BLOCKS, MOVES * BLOCKS);
        for k in 0..BLOCKS {
            // what comes after the last block costs what it costs with feedback
            let cost: &SMatrix<f64, MOVES, MOVES> = if k + 1 < BLOCKS { &q } else { &to_go };
            costs.view_mut((MOVES * k, MOVES * k), (MOVES, MOVES)).copy_from(cost);
        }
        let by_speed = r[0];
        let hessian = response.transpose() * &costs * &response
            + DMatrix::identity(BLOCKS, BLOCKS) * by_speed;
        let program = BoxQp::new(hessian);
        let speeds = DVector::zeros(BLOCKS);
        let area_ratio = model.cylinder().area_ratio();
        Ok(Self { plant, blocks, filter, response, costs, by_speed, program, speeds, area_ratio })
    }
}

impl Controller for LinearMpc {
    fn start(&mut self, measurement: &Measurement, _delay_cycles: u32) {
        let signals = &measurement.axes[0].signals;
        self.filter.start(&BenchmarkInput::of(signals, self.area_ratio));
        self.speeds.fill(0.0);
    }

    fn update(
        &mut self,
        measurement: &Measurement,
        preview: &Preview<f64>,
        _simulated: Option<&SimulatedState>,
    ) -> Command {
        let signals = &measurement.axes[0].signals;
        self.filter.correct(&BenchmarkInput::of(signals, self.area_ratio));
        // where the crane goes with the motor turning as the reference takes it, and by how much that is wrong
        let mut state: nalgebra::SVector<f64, ALL> = self.filter.state;
        let mut lacking = DVector::zeros(MOVES * BLOCKS);
        let mut own = DVector::zeros(BLOCKS);
        for k in 0..BLOCKS {
            let [now, then, after] = [k, k + 1, k + 2].map(|k| preview.at(k as f64 * BLOCK));
            let disturbances = self.filter.disturbances();
            let of = |a: f64, b: f64| (b - a) / BLOCK;
            let (_, speed) =
                self.blocks.wanted(&now, of(now.velocity, then.velocity), disturbances);
            own[k] = speed;
            let (pressure, holding) = self.blocks.rest(now.position);
            state = self.blocks.a * state + self.blocks.b * vector![speed - holding, pressure];
            let (wanted, _) =
                self.blocks.wanted(&then, of(then.velocity, after.velocity), disturbances);
            let off = state.fixed_rows::<MOVES>(0) - wanted;
            lacking.rows_mut(MOVES * k, MOVES).copy_from(&off);
        }
        let limit = self.plant.speed_limit();
        // in motor speeds themselves, which have limits: u = own + change
        let slope = self.response.transpose() * (&self.costs * (lacking - &self.response * &own))
            - &own * self.by_speed;
        self.program.least(&slope, &mut self.speeds, limit, STEPS);
        self.filter.predict(&self.plant, signals.motor_speed);
        Command::released([self.speeds[0]])
    }

    fn status(&self) -> ControllerStatus {
        ControllerStatus { is_closed_loop: true, ..ControllerStatus::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::super::lqg::LQG;
    use super::*;
    use hydroboom_control::measurement::AxisSignals;
    use hydroboom_control::reference::profile::SetPoint;

    /// What comes after the horizon costs what feedback of least cost takes, and so the horizon changes nothing where no limit is met.
    #[test]
    fn without_a_limit_to_meet_it_is_the_feedback_of_least_cost() {
        let model = Description::uia_single_boom().unwrap();
        let mut mpc = LinearMpc::new(&model, &LQG).unwrap();
        let (_, gain) = LQG.feedback(&mpc.blocks).unwrap();
        let still = SetPoint { position: 0.2, velocity: 0.0 };
        let (rest, holding) = mpc.blocks.wanted(&still, 0.0, [0.0; 2]);
        let off: nalgebra::SVector<f64, MOVES> = [2e-3, -0.01, 3e5].into();
        let at = rest + off;
        mpc.filter.state.fixed_rows_mut::<MOVES>(0).copy_from(&at);
        let signals = AxisSignals { stroke: at[0], pressure_a: at[2], ..AxisSignals::default() };
        let measurement = Measurement::new(1, 0.0, [signals]);
        let preview = Preview::at_rest(model.numbers.control_period, still.position);
        // the filter, which the measured motor speed moves on, is set back each time; the solver goes on where it was
        let estimated = mpc.filter.state;
        for _ in 0..200 {
            mpc.filter.state = estimated;
            mpc.update(&measurement, &preview, None);
        }
        let wanted = holding - (gain * off)[0];
        assert!((mpc.speeds[0] - wanted).abs() < 1e-6, "{} for {wanted}", mpc.speeds[0]);
        assert!((wanted - holding).abs() > 0.5, "nothing was asked for");
    }
}
