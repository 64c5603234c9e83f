//! Nonlinear model-predictive control by real-time iteration: one Gauss-Newton step per control period on
//! the reduced model.
//!
//! Each period the [problem](super::optimal_control_problem) starts from the newest estimate. It is
//! linearised about the last period's commands, shifted by one period. The [condensed](super::condensed)
//! quadratic program yields the change of the commands, and the first command is applied. States are
//! simulated, not unknowns of the program (single shooting), because the crane is stable without control.
//! Estimator, weights, reference and cost-to-go are those of the scheduled LQR.
//!
//! Source: M. Diehl, H. G. Bock, J. P. Schlöder, *A real-time iteration scheme for nonlinear optimization
//! in optimal feedback control*, 2005, doi:10.1137/S0363012902400713.

use super::condensed::condense;
use super::estimated_machine::{EstimatedMachine, Now};
use super::horizon::BLOCKS;
use super::optimal_control_problem::{LIMITS, Linearised, MachineLimits, OptimalControlProblem};
use super::quadratic_program::QuadraticProgram;
use super::receding_horizon::{Optimiser, RecedingHorizon};
use super::reference_ahead::ReferenceHorizon;
use crate::LabError;
use hydroboom_description::Description;

/// Iterations of the quadratic-program solver.
pub(super) const ITERATIONS: u32 = 10;
/// Price of one bar beyond the pressure limits over a period, in multiples of the cost of the position
/// tolerance.
const PRICE_OF_A_BAR: f64 = 1e3;
/// Number of rows of the program.
const ROWS: usize = LIMITS * BLOCKS;

/// Gauss-Newton steps on consecutive problems.
pub(super) struct GaussNewton {
    /// Commanded motor speeds, one for each block of the horizon \[rev/s\].
    pub commands: [f64; BLOCKS],
    program: Box<QuadraticProgram<BLOCKS, ROWS>>,
}

impl GaussNewton {
    /// Starts from the given commands \[rev/s\].
    pub(super) fn new(commands: [f64; BLOCKS]) -> Self {
        Self { commands, program: Box::new(QuadraticProgram::empty()) }
    }

    /// Full Gauss-Newton step with the given number of solver iterations. Returns the largest change of a
    /// command over the motor's speed limit. None if the program has no finite solution; the commands are
    /// then unchanged.
    pub(super) fn step(&mut self, problem: &OptimalControlProblem, iterations: u32) -> Option<f64> {
        let limit = problem.limits.motor_speed;
        let Linearised { blocks, cost_to_go, end } = problem.linearised(&self.commands);
        condense(&mut self.program, &blocks, (&cost_to_go, &end), limit);
        let change = self.program.minimum(iterations)?;
        for (command, change) in self.commands.iter_mut().zip(change.iter()) {
            *command = (*command + limit * change).clamp(-limit, limit);
        }
        Some(change.amax())
    }
}

/// Real-time iteration.
pub(super) struct NonlinearMpc {
    pub(super) limits: MachineLimits,
    newton: GaussNewton,
}

impl NonlinearMpc {
    /// Controller for a machine described by the model.
    pub(super) fn controller(model: &Description) -> Result<RecedingHorizon<Self>, LabError> {
        let machine = EstimatedMachine::new(model)?;
        let n = &model.numbers;
        let tolerance = n.tuning.lqr_position;
        let [by_position, ..] = machine.law.weights();
        let limits = MachineLimits {
            motor_speed: machine.law.motor_speed,
            slew: machine.law.slew,
            // lower limit: no suction; upper limit: cracking pressure of the relief valves
            pressure: [0.0, n.relief_cracking],
            pressure_price: PRICE_OF_A_BAR * by_position * tolerance * tolerance / 1e5,
        };
        let newton = GaussNewton::new([0.0; BLOCKS]);
        Ok(RecedingHorizon::new(machine, Self { limits, newton }))
    }

    /// Optimal control problem of this period.
    fn problem(
        &self,
        machine: &EstimatedMachine,
        now: Now<'_>,
        reference: ReferenceHorizon,
    ) -> OptimalControlProblem {
        let law = &machine.law;
        OptimalControlProblem {
            model: law.model,
            begin: now.state(),
            motor_speed: now.predicted.motor_speed,
            rod_side_term: now.estimated.rod_side_term,
            drive: now.estimated.drive.coefficient,
            period: law.period,
            limits: self.limits,
            weights: law.weights(),
            reference,
            cost_to_go: machine.regulator().cost_to_go,
        }
    }
}

impl Optimiser for NonlinearMpc {
    fn commands(
        &mut self,
        machine: &EstimatedMachine,
        now: Now<'_>,
        reference: ReferenceHorizon,
        next: Option<[f64; BLOCKS]>,
    ) -> Option<[f64; BLOCKS]> {
        self.newton.commands = next.unwrap_or(reference.motor_speeds);
        let problem = self.problem(machine, now, reference);
        self.newton.step(&problem, ITERATIONS)?;
        let mut commands = self.newton.commands;
        commands[0] = problem.allowed(commands[0]);
        Some(commands)
    }
}

#[cfg(test)]
mod tests {
    use super::super::linear_mpc::LinearMpc;
    use super::*;
    use hydroboom_control::controller::Controller;
    use hydroboom_control::measurement::{AxisSignals, Measurement};
    use hydroboom_control::reference::preview::Preview;
    use hydroboom_control::reference::profile::SetPoint;

    /// A NaN reference leaves the program without a solution: the last plan continues, and the status
    /// counts the period.
    #[test]
    fn a_period_without_a_solution_holds_the_last_plan_and_is_counted() {
        let model = Description::uia_single_boom().unwrap();
        let period = model.numbers.control_period;
        let nonlinear = NonlinearMpc::controller(&model).unwrap();
        let payload = model.numbers.payload;
        let pressure_a = nonlinear.machine.law.model.at(0.25, payload).holding_pressure;
        let both: [Box<dyn Controller>; 2] =
            [Box::new(nonlinear), Box::new(LinearMpc::controller(&model).unwrap())];
        for mut controller in both {
            let signals = AxisSignals { stroke: 0.25, pressure_a, ..AxisSignals::default() };
            let measured =
                |k: u32| Measurement::new(u64::from(k), f64::from(k) * period, [signals]);
            controller.start(&measured(0), 0);
            let along = |velocity: f64, begin: f64| {
                Preview::new(period, |after| SetPoint {
                    position: 0.25 + velocity * (begin + after).max(0.0),
                    velocity,
                })
            };
            let mut speed = |k: u32, preview: &Preview<f64>| {
                let command = controller.update(&measured(k), preview, None).axes[0].motor_speed;
                (command, controller.status().periods_without_solution)
            };
            let (before, none) = (1..=20)
                .map(|k| speed(k, &along(0.05, f64::from(k) * period)))
                .fold((0.0, 0), |_, now| now);
            assert!(before > 0.5 && none == 0, "{before} rev/s, {none}");
            let (held, one) = speed(21, &along(f64::NAN, 0.0));
            assert_eq!(one, 1);
            assert!(held.is_finite() && (held / before - 1.0).abs() < 0.5, "{held} {before} rev/s");
            let (next, two) = speed(22, &along(0.05, 22.0 * period));
            assert!(next.is_finite() && two == 1, "{next} rev/s");
        }
    }
}
