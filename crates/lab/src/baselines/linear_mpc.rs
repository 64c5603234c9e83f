//! Linear model-predictive control: the regulator's quadratic cost over a horizon, with limits of the
//! motor's speed and slew rate.
//!
//! Estimator, reduced model, weights and reference are those of the scheduled LQR. The plant is linearised
//! at the present operating point and constant over the horizon. The terminal cost is the regulator's
//! cost-to-go. Without an active limit the controller equals the regulator, except that commands are
//! constant within a block.
//!
//! Source: D. Q. Mayne, J. B. Rawlings, C. V. Rao, P. O. M. Scokaert, *Constrained model predictive
//! control: stability and optimality*, Automatica 36(6), 2000.

use super::condensed::{Block, Limit, Linear, condense};
use super::estimated_machine::{EstimatedMachine, Now};
use super::horizon::{BLOCKS, PERIODS, WEIGHTS};
use super::quadratic_program::QuadraticProgram;
use super::receding_horizon::{Optimiser, RecedingHorizon};
use super::reference_ahead::ReferenceHorizon;
use crate::LabError;
use hydroboom_control::feedback::riccati::{LinearQuadratic, Matrix, ORDER};
use hydroboom_description::Description;
use nalgebra::{SMatrix, SVector};

/// Iterations of the quadratic-program solver.
const ITERATIONS: u32 = 10;

/// Optimisation with the linear plant of the operating point.
pub(super) struct LinearMpc {
    program: QuadraticProgram<BLOCKS, BLOCKS>,
}

impl LinearMpc {
    /// Controller for a machine described by the model.
    pub(super) fn controller(model: &Description) -> Result<RecedingHorizon<Self>, LabError> {
        let optimiser = Self { program: QuadraticProgram::empty() };
        Ok(RecedingHorizon::new(EstimatedMachine::new(model)?, optimiser))
    }
}

impl Optimiser for LinearMpc {
    fn commands(
        &mut self,
        machine: &EstimatedMachine,
        now: Now<'_>,
        reference: ReferenceHorizon,
        _next: Option<[f64; BLOCKS]>,
    ) -> Option<[f64; BLOCKS]> {
        let law = &machine.law;
        let plant = law.linear_quadratic(now.estimator, now.estimated);
        let point = law.model.at(now.predicted.position, now.estimated.filter.estimate.payload);
        let (blocks, end) =
            linearised(&plant, point.compliance, &reference, &Machine::of(machine, now));
        let cost_to_go = square(&machine.regulator().cost_to_go);
        let speed = law.motor_speed;
        condense(&mut self.program, &blocks, (&cost_to_go, &end), speed);
        let change = self.program.minimum(ITERATIONS)?;
        let mut commands: [f64; BLOCKS] =
            std::array::from_fn(|k| reference.motor_speeds[k] + speed * change[k]);
        // the solution meets the limits to within the solver's tolerance only
        let (turns, reach) =
            (now.predicted.motor_speed, law.slew / now.estimated.drive.coefficient);
        commands[0] = commands[0].clamp(turns - reach, turns + reach);
        Some(commands.map(|command| command.clamp(-speed, speed)))
    }
}

/// State and limits of the machine that the blocks use.
struct Machine {
    state: SVector<f64, ORDER>,
    speed: f64,
    slew: f64,
    drive: f64,
    weights: [f64; 3],
}

impl Machine {
    fn of(machine: &EstimatedMachine, now: Now<'_>) -> Self {
        let law = &machine.law;
        Self {
            state: now.predicted.to_array().into(),
            speed: law.motor_speed,
            slew: law.slew,
            drive: now.estimated.drive.coefficient,
            weights: law.weights(),
        }
    }
}

fn square(rows: &Matrix<f64>) -> SMatrix<f64, ORDER, ORDER> {
    SMatrix::from_fn(|i, j| rows[i][j])
}

/// Blocks linearised about the reference's motor speed, and the resulting error at the end of the horizon.
fn linearised(
    plant: &LinearQuadratic<f64>,
    compliance: f64,
    horizon: &ReferenceHorizon,
    machine: &Machine,
) -> ([Block<ORDER, 1>; BLOCKS], SVector<f64, ORDER>) {
    let one = (square(&plant.transition), SVector::from(plant.input));
    let piston = SVector::from([1.0, 0.0, compliance, 0.0]);
    let reference = |k: usize| SVector::from(horizon.points[k].state.to_array());
    let mut error = machine.state - reference(0);
    let mut longer = one;
    let mut length = 1;
    let blocks = std::array::from_fn(|k| {
        while length < PERIODS[k] {
            longer = (one.0 * longer.0, one.0 * longer.1 + one.1);
            length += 1;
        }
        let (transition, input) = longer;
        let begin = error;
        error = transition * error;
        let residual = |of: SVector<f64, ORDER>, weight: f64| {
            let root = (weight * WEIGHTS[k]).sqrt();
            Linear {
                state: transition.tr_mul(&of) * root,
                command: of.dot(&input) * root,
                value: of.dot(&error) * root,
            }
        };
        let [by_position, by_velocity, by_speed] = machine.weights;
        let own = horizon.motor_speeds[k];
        // the motor's rate of change is largest at the start of a block
        let speed = reference(k)[3] + begin[3];
        let drive = machine.drive;
        Block {
            transition,
            input,
            residuals: [
                residual(piston, by_position),
                residual([0.0, 1.0, 0.0, 0.0].into(), by_velocity),
            ],
            command_residual: [(by_speed * PERIODS[k] as f64).sqrt(), 0.0],
            command_range: [-machine.speed - own, machine.speed - own],
            limits: [Limit {
                of: Linear {
                    state: [0.0, 0.0, 0.0, -drive].into(),
                    command: drive,
                    value: drive * (own - speed),
                },
                range: [-machine.slew, machine.slew],
                price: f64::INFINITY,
            }],
        }
    });
    (blocks, error)
}

#[cfg(test)]
mod tests {
    use super::super::nonlinear_mpc_oracle::machine_at_rest;
    use super::super::reference_ahead::ReferenceAhead;
    use super::*;
    use hydroboom_control::feedback::riccati::dot;
    use hydroboom_control::reference::preview::Preview;

    /// Without an active limit the first command is the regulator's, up to the effect of move blocking.
    #[test]
    fn linear_mpc_without_active_limits_is_the_regulator() {
        let machine = machine_at_rest(&Description::uia_single_boom().unwrap());
        let (law, now) = (&machine.law, machine.now().unwrap());
        let still = Preview::at_rest(law.period, 0.25);
        let horizon = ReferenceAhead::at_rest(law, now, 0.25).horizon(law, now, &still);
        let plant = law.linear_quadratic(now.estimator, now.estimated);
        let payload = now.estimated.filter.estimate.payload;
        let compliance = law.model.at(now.predicted.position, payload).compliance;
        let regulator = law.settled_regulator(now.estimator, now.estimated);
        for off in [
            [2e-4, 0.0, 0.0, 0.0],
            [0.0, 2e-3, 0.0, 0.0],
            [0.0, 0.0, 5e4, 0.0],
            [0.0, 0.0, 0.0, 0.5],
        ] {
            let mut at = Machine::of(&machine, now);
            at.state = SVector::from(horizon.points[0].state.to_array()) + SVector::from(off);
            let (blocks, end) = linearised(&plant, compliance, &horizon, &at);
            let mut program = QuadraticProgram::<BLOCKS, BLOCKS>::empty();
            let cost_to_go = square(&regulator.cost_to_go);
            condense(&mut program, &blocks, (&cost_to_go, &end), at.speed);
            let change = program.minimum(ITERATIONS).unwrap();
            let (found, wanted) = (at.speed * change[0], -dot(&regulator.gain, &off));
            assert!((found / wanted - 1.0).abs() < 0.02, "{off:?}: {found} for {wanted} rev/s");
        }
    }
}
