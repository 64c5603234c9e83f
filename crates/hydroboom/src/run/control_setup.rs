//! Control at the start of a run: strategy, limits of the supervision, parameters retained from an earlier run.

use crate::machine_choice::MachineChoice;
use hydroboom_control::estimation::retained_parameters::RetainedParameters;
use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::limits::Limits;
use hydroboom_realtime::control_task::ControlTask;
use hydroboom_realtime::course::Course;
use hydroboom_realtime::lockstep::Lockstep;
use hydroboom_realtime::simulation_task::SimulationTask;
use miette::{IntoDiagnostic, Result};
use std::sync::Arc;

/// Settings with which the control task of a run begins.
#[derive(Clone, Copy)]
pub struct ControlSetup {
    /// Control strategy.
    pub strategy: Strategy,
    /// Limits of the supervision.
    pub limits: Limits,
    /// Parameters of the state estimator from an earlier run; none to begin with the crane file's.
    pub retained: Option<RetainedParameters<f64>>,
}

impl ControlSetup {
    /// Control task, and the task that simulates the model beside the machine.
    ///
    /// # Errors
    ///
    /// If the model has no state of rest at the start of its motion.
    pub fn tasks(&self, cranes: &MachineChoice) -> Result<(ControlTask, SimulationTask)> {
        let model = &cranes.model;
        let motion = cranes.machine.motion(model.numbers.fast);
        let course = Course::new(Arc::new(motion));
        let control = ControlTask::new(model, course, self.limits, self.strategy);
        let control = match self.retained {
            Some(retained) => control.with_retained_parameters(retained),
            None => control,
        };
        Ok((control, SimulationTask::new(model, motion.start).into_diagnostic()?))
    }

    /// The same tasks with the virtual crane, in simulated time.
    ///
    /// # Errors
    ///
    /// If model or machine have no state of rest at the start of the motion.
    pub fn lockstep(&self, cranes: &MachineChoice) -> Result<Lockstep> {
        let run = lockstep(cranes, self.strategy)?.within(self.limits);
        Ok(match self.retained {
            Some(retained) => run.with_retained_parameters(retained),
            None => run,
        })
    }
}

/// Tasks and virtual crane in simulated time, within the limits of the crane file.
///
/// # Errors
///
/// If model or machine have no state of rest at the start of the motion.
pub fn lockstep(cranes: &MachineChoice, strategy: Strategy) -> Result<Lockstep> {
    let motion = cranes.machine.motion(cranes.model.numbers.fast);
    Lockstep::new(&cranes.model, &cranes.machine, motion, strategy).into_diagnostic()
}
