//! Optimal control problem of the nonlinear predictive controller: the reduced model over a horizon, with
//! limits of motor speed, slew rate and pressure.
//!
//! ```text
//! minimise ½ Σ_k (v_k (q_x (x_(k+1) − x_ref)² + q_w (w_(k+1) − w_ref)²) + m_k r (u_k − u_ref)²) + ½ e_Nᵀ P e_N
//! subject to  z_(k+1) = F(z_k, u_k),   |u_k| ≤ n_max,   |g (u_k − n_k)| ≤ slew,   p_min ≤ p_k + p_h ≤ p_max
//! ```
//!
//! The state z = (y, w, p, f, n) is load position and velocity, load pressure, friction, motor speed. The
//! piston position is x = y + γ p. The number of periods of a block is m_k, and v_k the weight of its end.
//! The motor covers the share g of the distance to its command in a period. F is the estimator's model in
//! steps of at most [`LONGEST_STEP`] periods. Derivatives are exact, by dual numbers.

use super::condensed::{Block, Limit, Linear};
use super::horizon::{BLOCKS, PERIODS, WEIGHTS};
use super::reference_ahead::ReferenceHorizon;
use hydroboom_control::estimation::reduced_model::{MachineState, ReducedModel};
use hydroboom_control::feedback::riccati::{Matrix, ORDER};
use hydroboom_math::{Dual, Real};
use nalgebra::{SMatrix, SVector};

/// Number of states of the problem.
pub(super) const STATES: usize = 5;
/// Limits per block: slew rate, and pressure at its end.
pub(super) const LIMITS: usize = 2;
/// Largest integration step of the model \[control periods\].
const LONGEST_STEP: usize = 5;
/// Dual numbers with derivatives with respect to all states and the command.
type Slopes = Dual<f64, 6>;
/// Index of the friction, which does not enter the cost-to-go.
const FRICTION: usize = 3;

/// Limits of the machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MachineLimits {
    /// Largest motor speed \[rev/s\].
    pub motor_speed: f64,
    /// Largest change of motor speed in a control period \[rev/s\].
    pub slew: f64,
    /// Lowest and highest pressure on the piston side \[Pa\].
    pub pressure: [f64; 2],
    /// Price of a pressure violation \[cost per Pa\].
    pub pressure_price: f64,
}

/// Optimal control problem.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct OptimalControlProblem {
    /// Reduced model F of the estimator.
    pub model: ReducedModel<f64>,
    /// State at the start of the horizon, with disturbances and parameters.
    pub begin: MachineState<f64>,
    /// Motor speed at the start of the horizon \[rev/s\].
    pub motor_speed: f64,
    /// Piston-side pressure minus load pressure, p_h \[Pa\]: rod-side pressure times the area ratio.
    pub rod_side_term: f64,
    /// Share g of the distance to its command that the motor's speed covers in a period \[-\], 0 to 1.
    pub drive: f64,
    /// Control period \[s\].
    pub period: f64,
    /// Limits of motor speed, slew rate and pressure.
    pub limits: MachineLimits,
    /// Weights of position \[1/m²\], velocity \[s²/m²\] and motor speed \[s²/rev²\] in a period.
    pub weights: [f64; 3],
    /// Reference at each block of the horizon.
    pub reference: ReferenceHorizon,
    /// Cost-to-go matrix P over (y, w, p, n), 4 × 4, of the scheduled LQR.
    pub cost_to_go: Matrix<f64>,
}

/// Problem linearised about given commands.
pub(super) struct Linearised {
    /// Linearised blocks of the horizon, first to last.
    pub blocks: [Block<STATES, LIMITS>; BLOCKS],
    /// Cost-to-go matrix P at the end of the horizon, over the five states of the problem.
    pub cost_to_go: SMatrix<f64, STATES, STATES>,
    /// Deviation e_N of the state from its reference at the end of the horizon.
    pub end: SVector<f64, STATES>,
}

/// State of the reduced model and of the motor.
#[derive(Clone, Copy)]
struct Motion<T> {
    machine: MachineState<T>,
    motor_speed: T,
}

impl OptimalControlProblem {
    /// Simulates a block with a command \[rev/s\].
    fn block<T: Real>(
        &self,
        model: &ReducedModel<T>,
        begin: Motion<T>,
        command: T,
        periods: usize,
    ) -> Motion<T> {
        let steps = periods.div_ceil(LONGEST_STEP);
        let in_step = periods as f64 / steps as f64;
        // first-order lag: share of the distance covered in a step, and mean of the remaining distance over
        // the step
        let rate = -Real::ln(1.0 - self.drive);
        let share = 1.0 - Real::exp(-rate * in_step);
        let mean_left = T::lit(share / (rate * in_step));
        let Motion { mut machine, mut motor_speed } = begin;
        for _ in 0..steps {
            let left = motor_speed - command;
            let mean = left.mul_add(mean_left, command);
            let h = T::lit(self.period * in_step);
            machine = model.step(&machine, mean, T::lit(self.rod_side_term), h);
            motor_speed = motor_speed - left * T::lit(share);
        }
        Motion { machine, motor_speed }
    }

    /// Model whose unknown force is constant over the horizon, as in the reference's inverse dynamics.
    fn lasting(&self) -> ReducedModel<f64> {
        ReducedModel { disturbance_time: f64::INFINITY, ..self.model }
    }

    /// Command \[rev/s\] of the first block, clamped to the limits of speed and slew rate. The solver meets
    /// them to within its tolerance only.
    pub(super) fn allowed(&self, command: f64) -> f64 {
        let MachineLimits { motor_speed: limit, slew, .. } = self.limits;
        let reach = slew / self.drive;
        command.clamp(self.motor_speed - reach, self.motor_speed + reach).clamp(-limit, limit)
    }

    /// Piston-side pressures \[Pa\] at the ends of the blocks with these commands \[rev/s\].
    #[cfg(test)]
    pub(super) fn pressures(&self, commands: &[f64; BLOCKS]) -> [f64; BLOCKS] {
        let model = self.lasting();
        let mut now = Motion { machine: self.begin, motor_speed: self.motor_speed };
        std::array::from_fn(|k| {
            now = self.block(&model, now, commands[k], PERIODS[k]);
            now.machine.load_pressure + self.rod_side_term
        })
    }

    /// Linearisation along the trajectory of the commands \[rev/s\].
    pub(super) fn linearised(&self, commands: &[f64; BLOCKS]) -> Linearised {
        let model = self.lasting().map(Slopes::constant);
        let mut now = Motion { machine: self.begin, motor_speed: self.motor_speed };
        let blocks = std::array::from_fn(|k| {
            let (block, next) = self.linearised_block(&model, now, commands[k], k);
            now = next;
            block
        });
        let end = &self.reference.points[BLOCKS].state;
        let MachineState { position, velocity, load_pressure, .. } = now.machine;
        let end = [
            position - end.position,
            velocity - end.velocity,
            load_pressure - end.load_pressure,
            0.0,
            now.motor_speed - end.motor_speed,
        ];
        let place = [0, 1, 2, 4];
        let mut cost_to_go = SMatrix::zeros();
        for i in 0..ORDER {
            for j in 0..ORDER {
                cost_to_go[(place[i], place[j])] = self.cost_to_go[i][j];
            }
        }
        Linearised { blocks, cost_to_go, end: end.into() }
    }

    /// Block k from a motion on, linearised about a command \[rev/s\], and the motion at its end.
    fn linearised_block(
        &self,
        model: &ReducedModel<Slopes>,
        now: Motion<f64>,
        command: f64,
        k: usize,
    ) -> (Block<STATES, LIMITS>, Motion<f64>) {
        let end =
            self.block(model, as_variables(now), Slopes::variable(command, STATES), PERIODS[k]);
        let MachineState { position, velocity, load_pressure, friction, .. } = end.machine;
        let all = [position, velocity, load_pressure, friction, end.motor_speed];
        let next = Motion {
            machine: end.machine.map(|v: Slopes| v.value),
            motor_speed: end.motor_speed.value,
        };
        let linear = |of: Slopes, from: f64, times: f64| Linear {
            state: SVector::from_fn(|i, _| of.slope[i] * times),
            command: of.slope[STATES] * times,
            value: (of.value - from) * times,
        };
        let [by_position, by_velocity, by_speed] = self.weights;
        let reference = &self.reference.points[k + 1];
        let root = |weight: f64, periods: f64| (weight * periods).sqrt();
        let command_root = root(by_speed, PERIODS[k] as f64);
        let pressure = linear(load_pressure, -self.rod_side_term, 1.0);
        let limit = self.limits.motor_speed;
        let block = Block {
            transition: SMatrix::from_fn(|i, j| all[i].slope[j]),
            input: SVector::from_fn(|i, _| all[i].slope[STATES]),
            residuals: [
                linear(model.piston(&end.machine), reference.piston, root(by_position, WEIGHTS[k])),
                linear(velocity, reference.state.velocity, root(by_velocity, WEIGHTS[k])),
            ],
            command_residual: [
                command_root,
                command_root * (command - self.reference.motor_speeds[k]),
            ],
            command_range: [-limit - command, limit - command],
            limits: self.linearised_limits(command, now.motor_speed, pressure),
        };
        (block, next)
    }

    /// Limits of the slew rate, with a command from a motor speed \[rev/s\] on, and of the linearised pressure at the
    /// end of a block.
    fn linearised_limits(
        &self,
        command: f64,
        motor_speed: f64,
        pressure: Linear<STATES>,
    ) -> [Limit<STATES>; LIMITS] {
        let MachineLimits { slew, pressure: range, pressure_price, .. } = self.limits;
        let mut by_motor = SVector::zeros();
        by_motor[4] = -self.drive;
        let speed_change = Linear {
            state: by_motor,
            command: self.drive,
            value: self.drive * (command - motor_speed),
        };
        [
            Limit { of: speed_change, range: [-slew, slew], price: f64::INFINITY },
            Limit { of: pressure, range, price: pressure_price },
        ]
    }
}

/// A motion as variables, with derivatives with respect to its five states.
fn as_variables(now: Motion<f64>) -> Motion<Slopes> {
    let MachineState { position, velocity, load_pressure, friction, .. } = now.machine;
    Motion {
        machine: MachineState {
            position: Slopes::variable(position, 0),
            velocity: Slopes::variable(velocity, 1),
            load_pressure: Slopes::variable(load_pressure, 2),
            friction: Slopes::variable(friction, FRICTION),
            ..now.machine.map(Slopes::constant)
        },
        motor_speed: Slopes::variable(now.motor_speed, 4),
    }
}
