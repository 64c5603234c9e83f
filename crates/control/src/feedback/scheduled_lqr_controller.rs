//! Scheduled LQR with its state estimator as a controller of one axis.
//!
//! The estimator may run under any strategy ([`observe`](ScheduledLqrController::observe)), so that a hand-over finds
//! it settled; while the load-holding valve is shut, [`observe_held`](ScheduledLqrController::observe_held) keeps its
//! parameters and weighs the load.

use super::riccati::Regulator;
use super::scheduled_lqr::{ScheduledLqr, ScheduledLqrState};
use crate::command::Command;
use crate::controller::{Controller, ControllerStatus, SimulatedState};
use crate::estimation::extended_kalman_filter::EstimatorInput;
use crate::estimation::retained_parameters::RetainedParameters;
use crate::estimation::state_estimator::{StateEstimator, StateEstimatorState};
use crate::measurement::{AxisMeasurement, Measurement, Validity};
use crate::reference::preview::Preview;

/// Scheduled LQR with its state estimator for one axis.
#[derive(Clone, Copy, Debug)]
pub struct ScheduledLqrController {
    estimator: StateEstimator<f64>,
    law: ScheduledLqr<f64>,
    /// Rod-side area over piston area.
    area_ratio: f64,
    /// Parameters of an earlier run, with which the estimator begins first.
    retained: Option<RetainedParameters<f64>>,
    /// None before the first measurement.
    estimated: Option<StateEstimatorState<f64>>,
    /// Regulator of the operating point while another controller commands; none before the first measurement.
    regulator: Option<Regulator<f64>>,
    /// None before control begins.
    state: Option<ScheduledLqrState<f64>>,
    /// Number of the measurement that was observed last.
    observed: Option<u64>,
    /// The last valid position \[m\], load pressure \[Pa\] and rod-side term \[Pa\].
    last: [f64; 3],
    /// Motor speed that was commanded last \[rev/s\].
    command: f64,
}

impl ScheduledLqrController {
    /// Controller from estimator and law. `area_ratio` is A_r/A_p \[1\] of the cylinder.
    pub fn new(estimator: StateEstimator<f64>, law: ScheduledLqr<f64>, area_ratio: f64) -> Self {
        Self {
            estimator,
            law,
            area_ratio,
            retained: None,
            estimated: None,
            regulator: None,
            state: None,
            observed: None,
            last: [0.0; 3],
            command: 0.0,
        }
    }

    /// Sets the delay of measurements and of commands on the fieldbus, the same for both \[control periods\]; it
    /// counts as 20 at most.
    #[must_use]
    pub fn with_delay(mut self, delay_cycles: u32) -> Self {
        self.set_delays(delay_cycles as usize, delay_cycles as usize);
        self
    }

    /// Sets the delays of measurements and of commands \[control periods\]. To be called while the load is held, so
    /// that no command is in transit.
    pub fn set_delays(&mut self, measurement: usize, command: usize) {
        self.estimator = self.estimator.with_delays(measurement, command);
    }

    /// Starts the estimator with the parameters of an earlier run. After a divergence it restarts without them.
    #[must_use]
    pub fn with_retained_parameters(mut self, retained: RetainedParameters<f64>) -> Self {
        self.retained = Some(retained);
        self
    }

    /// State estimates and their covariance; `None` before the first valid measurement.
    pub fn estimated(&self) -> Option<&StateEstimatorState<f64>> {
        self.estimated.as_ref()
    }

    /// Settings of the state estimator.
    pub fn estimator(&self) -> &StateEstimator<f64> {
        &self.estimator
    }

    /// State of the control law; `None` while another controller is active.
    pub fn law_state(&self) -> Option<&ScheduledLqrState<f64>> {
        self.state.as_ref()
    }

    /// Updates the estimator by a measurement. `command` is the motor speed \[rev/s\] sent in the period before.
    ///
    /// A measurement with the number of the last one counts as absent: the estimates follow the model.
    pub fn observe(&mut self, measurement: &Measurement, command: f64) {
        let is_new = self.observed != Some(measurement.number);
        let input = self.input(&measurement.axes[0], is_new);
        self.observed = Some(measurement.number);
        self.command = command;
        match &mut self.estimated {
            Some(estimated) => self.estimator.update(estimated, &input, command),
            None => self.begin(&input),
        }
        if self.state.is_none() {
            self.follow_operating_point();
        }
    }

    /// Updates the estimator by a measurement while the load-holding valve is shut: the payload is estimated anew,
    /// the other parameters stay.
    ///
    /// A diverged estimator is restarted, and so is a regulator that is not finite.
    pub fn observe_held(&mut self, measurement: &Measurement) {
        let is_new = self.observed != Some(measurement.number);
        let input = self.input(&measurement.axes[0], is_new);
        self.observed = Some(measurement.number);
        self.command = 0.0;
        self.hand_over();
        if !self.is_valid() {
            (self.estimated, self.regulator) = (None, None);
        }
        self.regulator = self.regulator.filter(is_finite);
        match &mut self.estimated {
            Some(estimated) => self.estimator.hold(estimated, &input),
            None => self.begin(&input),
        }
        self.follow_operating_point();
    }

    /// Starts control at the present state, after any other controller. The reference moves from the piston position
    /// to `reference` \[m\]; the regulator is that of the operating point. Without a valid measurement so far, nothing
    /// changes.
    pub fn take_over(&mut self, reference: f64) {
        if let (Some(estimated), Some(regulator)) = (&self.estimated, self.regulator) {
            self.state = Some(self.law.start(regulator, &self.estimator, estimated, reference));
        }
    }

    /// Ends control, for another controller; the regulator continues to follow the operating point.
    pub fn hand_over(&mut self) {
        if let Some(state) = self.state.take() {
            self.regulator = Some(state.regulator);
        }
    }

    fn follow_operating_point(&mut self) {
        if let Some(estimated) = &self.estimated {
            let (law, before) = (&self.law, self.regulator.take());
            self.regulator = Some(law.follow_operating_point(before, &self.estimator, estimated));
        }
    }

    /// Whether estimates and covariance are finite and the filter has not diverged; true before the first
    /// measurement.
    pub fn is_valid(&self) -> bool {
        self.estimated.as_ref().is_none_or(|estimated| {
            let filter = &estimated.filter;
            let finite = filter.estimate.to_array().into_iter().all(f64::is_finite)
                && filter.covariance.iter().flatten().all(|c| c.is_finite());
            finite && !self.estimator.filter.has_diverged(filter)
        })
    }

    fn begin(&mut self, input: &EstimatorInput<f64>) {
        // no state is known before every signal was valid once
        if input.position_is_good + input.load_pressure_is_good > 1.5 {
            let mut begun = self.estimator.start(input);
            if let Some(retained) = self.retained.take() {
                self.estimator.restore(&mut begun, &retained, true);
            }
            self.estimated = Some(begun);
        }
    }

    /// Estimator input from a measurement.
    fn input(&mut self, axis: &AxisMeasurement, is_new: bool) -> EstimatorInput<f64> {
        let (signals, validity) = (&axis.signals, &axis.validity);
        let good = |of: Validity| is_new && of == Validity::Good;
        let has_position = good(validity.stroke) && signals.stroke.is_finite();
        let pressure = signals.load_pressure(self.area_ratio);
        let has_pressure =
            good(validity.pressure_a) && good(validity.pressure_b) && pressure.is_finite();
        let number = |is: bool| f64::from(u8::from(is));
        if has_position {
            self.last[0] = signals.stroke;
        }
        if has_pressure {
            self.last[1] = pressure;
            self.last[2] = self.area_ratio * signals.pressure_b;
        }
        let motor_speed = match good(validity.motor_speed) && signals.motor_speed.is_finite() {
            true => signals.motor_speed,
            // by the identified drive
            false => self.estimated.as_ref().map_or(0.0, |e| self.estimator.predicted_speed(e)),
        };
        EstimatorInput {
            position: self.last[0],
            position_is_good: number(has_position),
            load_pressure: self.last[1],
            load_pressure_is_good: number(has_pressure),
            rod_side_term: self.last[2],
            motor_speed,
        }
    }
}

/// Whether gain and cost are finite.
fn is_finite(regulator: &Regulator<f64>) -> bool {
    let Regulator { cost_to_go, gain } = regulator;
    cost_to_go.iter().flatten().chain(gain).all(|number| number.is_finite())
}

impl Controller for ScheduledLqrController {
    fn start(&mut self, measurement: &Measurement, delay_cycles: u32) {
        self.set_delays(delay_cycles as usize, delay_cycles as usize);
        (self.estimated, self.regulator, self.state, self.observed) = (None, None, None, None);
        self.observe(measurement, 0.0);
        // this is no control period: the regulator settles at once
        if let Some(estimated) = &self.estimated {
            self.regulator = Some(self.law.settled_regulator(&self.estimator, estimated));
        }
        let position = measurement.axes[0].signals.stroke;
        self.take_over(position);
    }

    fn update(
        &mut self,
        measurement: &Measurement,
        preview: &Preview<f64>,
        _simulated: Option<&SimulatedState>,
    ) -> Command {
        if self.observed != Some(measurement.number) {
            self.observe(measurement, self.command);
        }
        if self.state.is_none() {
            self.take_over(preview.now().position);
        }
        let command = match (&mut self.state, &self.estimated) {
            (Some(state), Some(estimated)) => {
                self.law.update(state, &self.estimator, estimated, preview)
            }
            // no measurement yet
            _ => 0.0,
        };
        self.command = command;
        Command::released([command])
    }

    fn status(&self) -> ControllerStatus {
        ControllerStatus { is_closed_loop: true, ..ControllerStatus::default() }
    }
}
