//! Model predictive control: in each control period the commands over a horizon are planned anew, and the first is
//! applied.

use super::command_plan::CommandPlan;
use super::estimated_machine::{EstimatedMachine, Now};
use super::horizon::BLOCKS;
use super::reference_ahead::{ReferenceAhead, ReferenceHorizon};
use hydroboom_control::command::Command;
use hydroboom_control::controller::{Controller, ControllerStatus, SimulatedState};
use hydroboom_control::measurement::Measurement;
use hydroboom_control::reference::preview::Preview;

/// Optimisation of the commands over the horizon.
pub(super) trait Optimiser: Send {
    /// Commands of the blocks \[rev/s\] for a reference; none if a factorisation fails or a value is not finite.
    /// `next` is the last plan shifted by one period, if there is one.
    fn commands(
        &mut self,
        machine: &EstimatedMachine,
        now: Now<'_>,
        reference: ReferenceHorizon,
        next: Option<[f64; BLOCKS]>,
    ) -> Option<[f64; BLOCKS]>;
}

/// Predictive controller with estimator, reference and weights of the scheduled LQR.
pub(super) struct RecedingHorizon<O> {
    pub(super) machine: EstimatedMachine,
    reference: Option<ReferenceAhead>,
    plan: CommandPlan,
    pub(super) optimiser: O,
}

impl<O: Optimiser> RecedingHorizon<O> {
    pub(super) fn new(machine: EstimatedMachine, optimiser: O) -> Self {
        Self { machine, reference: None, plan: CommandPlan::default(), optimiser }
    }

    /// New plan \[rev/s\]; none without a valid measurement or a solution.
    fn solve(&mut self, preview: &Preview<f64>) -> Option<[f64; BLOCKS]> {
        let Self { machine, reference, plan, optimiser } = self;
        let now = machine.now()?;
        let law = &machine.law;
        let start = || ReferenceAhead::at_rest(law, now, preview.now().position);
        let horizon = reference.get_or_insert_with(start).horizon(law, now, preview);
        optimiser.commands(machine, now, horizon, plan.next())
    }
}

impl<O: Optimiser> Controller for RecedingHorizon<O> {
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
