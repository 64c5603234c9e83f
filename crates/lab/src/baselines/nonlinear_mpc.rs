//! Nonlinear model-predictive control by real-time iteration: one Gauss-Newton step a control period on the reduced model.
//!
//! Each period the [problem](super::optimal_control_problem) is linearised about the last period's commands, moved on by a period, from the newest estimate on; the
//! [condensed](super::condensed) quadratic program gives the change of the commands, and the first is taken. States are simulated and not unknowns (single shooting): the crane
//! is stable without control. Estimator, weights, reference and cost to go are those of the scheduled LQR.
//!
//! Source: M. Diehl, H. G. Bock, J. P. Schlöder, *A real-time iteration scheme for nonlinear optimization in optimal feedback control*, 2005,
//! doi:10.1137/S0363012902400713.

use super::condensed::condense;
use super::estimated_machine::{EstimatedMachine, Now};
use super::horizon::{BLOCKS, advanced};
use super::optimal_control_problem::{LIMITS, Linearised, MachineLimits, OptimalControlProblem};
use super::quadratic_program::QuadraticProgram;
use super::reference_ahead::{ReferenceAhead, ReferenceHorizon};
use crate::LabError;
use hydroboom_control::command::Command;
use hydroboom_control::controller::{Controller, ControllerStatus, SimulatedState};
use hydroboom_control::measurement::Measurement;
use hydroboom_control::reference::preview::Preview;
use hydroboom_description::Description;

/// Iterations of the program's solver.
pub(super) const ITERATIONS: u32 = 10;
/// A bar beyond the pressure's limits over a period costs as much as so many position tolerances.
const PRICE_OF_A_BAR: f64 = 1e3;
/// Rows of the program.
const ROWS: usize = LIMITS * BLOCKS;

/// Gauss-Newton steps on problems that follow each other.
pub(super) struct GaussNewton {
    /// Commands of the blocks \[rev/s\].
    pub commands: [f64; BLOCKS],
    program: Box<QuadraticProgram<BLOCKS, ROWS>>,
}

impl GaussNewton {
    /// From commands \[rev/s\] on.
    pub(super) fn new(commands: [f64; BLOCKS]) -> Self {
        Self { commands, program: Box::new(QuadraticProgram::empty()) }
    }

    /// A full step with so many iterations of the program's solver; its largest change of a command over the motor's speed. None where the program has no solution, or one that is
    /// not finite: then the commands stay.
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
    limits: MachineLimits,
    reference: Option<ReferenceAhead>,
    newton: Option<GaussNewton>,
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
            // no suction, and what relief valves open at
            pressure: [0.0, n.relief_cracking],
            pressure_price: PRICE_OF_A_BAR * by_position * tolerance * tolerance / 1e5,
        };
        Ok(Self { machine, limits, reference: None, newton: None })
    }

    /// The problem of this period.
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

    fn command(&mut self, preview: &Preview<f64>) -> Option<f64> {
        let Self { machine, limits, reference, newton } = self;
        let now = machine.now()?;
        let law = &machine.law;
        let start = || ReferenceAhead::at_rest(law, now, preview.now().position);
        let horizon = reference.get_or_insert_with(start).horizon(law, now, preview);
        let own = horizon.motor_speeds;
        let problem = Self::problem(machine, *limits, now, horizon);
        let newton = newton.get_or_insert_with(|| GaussNewton::new(own));
        newton.commands = advanced(&newton.commands);
        if newton.step(&problem, ITERATIONS).is_none() {
            newton.commands = own;
        }
        Some(problem.allowed(newton.commands[0]))
    }
}

impl Controller for NonlinearMpc {
    fn start(&mut self, measurement: &Measurement, delay_cycles: u32) {
        self.machine.start(measurement, delay_cycles);
        (self.reference, self.newton) = (None, None);
    }

    fn update(
        &mut self,
        measurement: &Measurement,
        preview: &Preview<f64>,
        _simulated: Option<&SimulatedState>,
    ) -> Command {
        self.machine.observe(measurement);
        let command = self.command(preview).unwrap_or(0.0);
        self.machine.commanded(command);
        Command::released([command])
    }

    fn status(&self) -> ControllerStatus {
        ControllerStatus { is_closed_loop: true, ..ControllerStatus::default() }
    }
}
