//! Machine model of the predictive controllers: estimator, reduced model, operating point and regulator of
//! the scheduled LQR.

use crate::LabError;
use hydroboom_control::controller::Controller;
use hydroboom_control::estimation::reduced_model::MachineState;
use hydroboom_control::estimation::state_estimator::{
    PredictedState, StateEstimator, StateEstimatorState,
};
use hydroboom_control::feedback::riccati::{ORDER, Regulator};
use hydroboom_control::feedback::scheduled_lqr::ScheduledLqr;
use hydroboom_control::feedback::scheduled_lqr_controller::ScheduledLqrController;
use hydroboom_control::measurement::Measurement;
use hydroboom_description::Description;
use hydroboom_design::scheduled_lqr::{designed, known_delay};

/// Estimator, control law and regulator.
pub(super) struct EstimatedMachine {
    /// Estimator, with measurements processed as under its own control law.
    observer: ScheduledLqrController,
    /// Scheduled LQR, of which weights, gain schedule and smoothing are used, but not its command.
    pub law: ScheduledLqr<f64>,
    regulator: Regulator<f64>,
    /// Motor speed commanded last \[rev/s\].
    command: f64,
}

/// Information available in a control period.
#[derive(Clone, Copy)]
pub(super) struct Now<'a> {
    /// State estimator of the scheduled LQR.
    pub estimator: &'a StateEstimator<f64>,
    /// Estimates at the time of the measurement.
    pub estimated: &'a StateEstimatorState<f64>,
    /// State predicted for the time at which the command acts.
    pub predicted: PredictedState<f64>,
}

impl Now<'_> {
    /// Full state at the time the command acts. The friction force is predicted with the motion of the
    /// load.
    pub(super) fn state(&self) -> MachineState<f64> {
        let estimate = &self.estimated.filter.estimate;
        let PredictedState { position, velocity, load_pressure, .. } = self.predicted;
        let model = &self.estimator.filter.model;
        let bending = model.presliding_stiffness * (position - estimate.position);
        let friction = (estimate.friction + bending) / (1.0 + bending.abs() / model.coulomb);
        MachineState { position, velocity, load_pressure, friction, ..*estimate }
    }
}

impl EstimatedMachine {
    pub(super) fn new(model: &Description) -> Result<Self, LabError> {
        let (estimator, law) = designed(model, known_delay(model) as usize)?;
        let observer = ScheduledLqrController::new(estimator, law, model.cylinder().area_ratio());
        let regulator = Regulator { cost_to_go: [[0.0; ORDER]; ORDER], gain: [0.0; ORDER] };
        Ok(Self { observer, law, regulator, command: 0.0 })
    }

    /// Initialises at rest; the regulator is that of the operating point.
    pub(super) fn start(&mut self, measurement: &Measurement, delay_cycles: u32) {
        self.observer.start(measurement, delay_cycles);
        if let Some(state) = self.observer.law_state() {
            self.regulator = state.regulator;
        }
        self.command = 0.0;
    }

    /// Processes a measurement and updates the regulator to the operating point.
    pub(super) fn observe(&mut self, measurement: &Measurement) {
        self.observer.observe(measurement, self.command);
        if let Some(estimated) = self.observer.estimated() {
            let (estimator, before) = (self.observer.estimator(), Some(self.regulator));
            self.regulator = self.law.follow_operating_point(before, estimator, estimated);
        }
    }

    /// Information of this control period; none before the first valid measurement.
    pub(super) fn now(&self) -> Option<Now<'_>> {
        let estimator = self.observer.estimator();
        let estimated = self.observer.estimated()?;
        Some(Now { estimator, estimated, predicted: estimator.predict(estimated) })
    }

    /// Regulator of the operating point.
    pub(super) fn regulator(&self) -> &Regulator<f64> {
        &self.regulator
    }

    /// Stores the command \[rev/s\], an input of the estimator with the next measurement.
    pub(super) fn commanded(&mut self, command: f64) {
        self.command = command;
    }
}
