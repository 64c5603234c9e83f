//! State estimation in the control task: update, record, and conditions for the simulated crane.

use super::{ControlTask, Estimates, FRESH, Period};
use crate::conditions::Conditions;
use hydroboom_control::estimation::reduced_model::MachineState;
use hydroboom_control::estimation::retained_parameters::RetainedParameters;
use hydroboom_control::feedback::scheduled_lqr_controller::ScheduledLqrController;

/// Time constant of the payload's mean while the load is held \[s\]. It smooths the boom's oscillation on
/// its locked cylinder.
const PAYLOAD_MEAN: f64 = 1.0;

impl ControlTask {
    /// Updates the state estimator. It runs under every strategy, so that it has converged at a change of
    /// strategy.
    pub(super) fn estimate(&mut self) {
        let measurement = self.judged();
        // delays come from the attachment if it measures them; they are constant while the load moves
        let is_held = self.decision.is_at_rest();
        let delay =
            self.link.and_then(|link| link.delay).filter(|_| is_held).map(|delay| delay.cycles());
        if let Some([_, command]) = delay {
            self.command_delay = command;
        }
        // the filter is initialised from the first measurement
        let Some(controller) = self.scheduled_lqr.as_mut().filter(|_| measurement.number > 0)
        else {
            return;
        };
        if let Some([measurement, command]) = delay {
            controller.set_delays(measurement, command);
        }
        match self.decision.controls {
            true => controller.observe(&measurement, self.decision.command.motor_speed),
            false => controller.observe_held(&measurement),
        }
        if let (Some(tip), Some(estimated)) = (&self.tip, controller.estimated()) {
            let filter = &controller.estimator().filter;
            tip.update(&mut self.tip_memory, filter, &estimated.filter);
        }
    }

    pub(super) fn estimates(&self) -> Option<Estimates> {
        let controller = self.scheduled_lqr.as_ref()?;
        let estimated = controller.estimated()?;
        let filter = &estimated.filter;
        Some(Estimates {
            state: filter.estimate,
            deviation: controller.estimator().filter.deviation(filter),
            innovation: filter.innovation,
            innovation_deviation: core::array::from_fn(|k| {
                filter.innovation[k].abs() / filter.nis[k].sqrt()
            }),
            mean_nis: filter.mean_nis,
            drive_lag: estimated.drive.time_constant(self.benchmark.period),
            parameters: RetainedParameters::of(estimated),
            tip: self.tip.map(|tip| {
                tip.estimate(&self.tip_memory, &controller.estimator().filter.model, filter)
            }),
        })
    }

    /// Updates payload and transition pressure of the simulated crane from the estimator while the load is
    /// held. A change during motion would disturb the simulation, and with it the machine under simulation
    /// feedforward.
    pub(super) fn adopt_estimates(&mut self, now: &Period) {
        let is_held = !self.decision.controls && self.decision.command.holding_valve < 0.5;
        let is_fresh = self.age < FRESH * self.benchmark.period;
        let controller = self.scheduled_lqr.as_ref().filter(|controller| controller.is_valid());
        let Some(estimated) = controller.and_then(ScheduledLqrController::estimated) else {
            return;
        };
        if is_held && is_fresh && now.strategy.estimates() {
            let MachineState { payload, transition_pressure, .. } = estimated.filter.estimate;
            let share = self.benchmark.period / PAYLOAD_MEAN;
            let payload = self.conditions.payload + share * (payload - self.conditions.payload);
            self.conditions = Conditions { payload, transition_pressure };
        }
    }
}
