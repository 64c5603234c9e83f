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

use super::command_plan::CommandPlan;
use super::condensed::condense;
use super::estimated_machine::{EstimatedMachine, Now};
use super::horizon::BLOCKS;
use super::optimal_control_problem::{LIMITS, Linearised, MachineLimits, OptimalControlProblem};
use super::quadratic_program::QuadraticProgram;
use super::reference_ahead::{ReferenceAhead, ReferenceHorizon};
use crate::LabError;
use hydroboom_control::command::Command;
use hydroboom_control::controller::{Controller, ControllerStatus, SimulatedState};
use hydroboom_control::measurement::Measurement;
use hydroboom_control::reference::preview::Preview;
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
    machine: EstimatedMachine,
    pub(super) limits: MachineLimits,
    reference: Option<ReferenceAhead>,
    newton: GaussNewton,
    plan: CommandPlan,
}

impl NonlinearMpc {
    pub(super) fn new(model: &Description) -> Result<Self, LabError> {
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
        let (newton, plan) = (GaussNewton::new([0.0; BLOCKS]), CommandPlan::default());
        Ok(Self { machine, limits, reference: None, newton, plan })
    }

    /// Optimal control problem of this period.
    fn problem(
        machine: &EstimatedMachine,
        limits: MachineLimits,
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
            limits,
            weights: law.weights(),
            reference,
            cost_to_go: machine.regulator().cost_to_go,
        }
    }

    /// Commands of the blocks \[rev/s\]; none if a factorisation fails or a value is not finite.
    fn solve(&mut self, preview: &Preview<f64>) -> Option<[f64; BLOCKS]> {
        let Self { machine, limits, reference, newton, plan } = self;
        let now = machine.now()?;
        let law = &machine.law;
        let start = || ReferenceAhead::at_rest(law, now, preview.now().position);
        let horizon = reference.get_or_insert_with(start).horizon(law, now, preview);
        newton.commands = plan.next().unwrap_or(horizon.motor_speeds);
        let problem = Self::problem(machine, *limits, now, horizon);
        newton.step(&problem, ITERATIONS)?;
        let mut commands = newton.commands;
        commands[0] = problem.allowed(commands[0]);
        Some(commands)
    }
}

impl Controller for NonlinearMpc {
    fn start(&mut self, measurement: &Measurement, delay_cycles: u32) {
        self.machine.start(measurement, delay_cycles);
        (self.reference, self.plan) = (None, CommandPlan::default());
    }

    fn update(
        &mut self,
        measurement: &Measurement,
        preview: &Preview<f64>,
        _simulated: Option<&SimulatedState>,
    ) -> Command {
        self.machine.observe(measurement);
        let found = self.solve(preview);
        if found.is_none() {
            // the state of the reference may be non-finite
            self.reference = None;
        }
        let command = self.plan.command(found);
        self.machine.commanded(command);
        Command::released([command])
    }

    fn status(&self) -> ControllerStatus {
        ControllerStatus {
            is_closed_loop: true,
            periods_without_solution: self.plan.without_solution(),
            ..ControllerStatus::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::linear_mpc::LinearMpc;
    use super::*;
    use hydroboom_control::measurement::AxisSignals;
    use hydroboom_control::reference::profile::SetPoint;

    /// A NaN reference leaves the program without a solution: the last plan continues, and the status
    /// counts the period.
    #[test]
    fn a_period_without_a_solution_holds_the_last_plan_and_is_counted() {
        let model = Description::uia_single_boom().unwrap();
        let period = model.numbers.control_period;
        let nonlinear = NonlinearMpc::new(&model).unwrap();
        let payload = model.numbers.payload;
        let pressure_a = nonlinear.machine.law.model.at(0.25, payload).holding_pressure;
        let both: [Box<dyn Controller>; 2] =
            [Box::new(nonlinear), Box::new(LinearMpc::new(&model).unwrap())];
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
