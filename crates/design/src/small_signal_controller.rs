//! Small-signal controller: scheduled LQR with its estimator, linearised at rest, from measurements to motor speed.
//!
//! The controller itself is called with small changes of each state and measurement about an operating
//! point at which it has settled. The filter's covariance, the identified drive and the innovation test are
//! kept constant there.
//!
//! ```text
//! x(k+1) = A x(k) + B y(k),    u(k) = C x(k) + D y(k)
//! ```

use crate::DesignError;
use crate::frequency_response::FrequencyResponse;
use crate::linear::eigenvalues;
use hydroboom_control::estimation::extended_kalman_filter::EstimatorInput;
use hydroboom_control::estimation::reduced_model::{MachineState, ReducedModel, STATES};
use hydroboom_control::estimation::state_estimator::{StateEstimator, StateEstimatorState};
use hydroboom_control::feedback::scheduled_lqr::{ScheduledLqr, ScheduledLqrState};
use hydroboom_control::reference::preview::Preview;
use nalgebra::{Complex, DMatrix, DVector};

/// Number of measurements: position \[m\], load pressure \[Pa\], motor speed \[rev/s\].
pub const READINGS: usize = 3;
/// Scale of each measurement.
const READING_SIZES: [f64; READINGS] = [1e-4, 1e4, 1.0];
/// Sizes of the states that are alike, in the order of [`MachineState`].
const STATE_SIZES: [f64; STATES] = [1e-4, 1e-3, 1e4, 1e4, 1e4, 0.1, 1.0, 1e5];
/// Small against the controller's limits.
const SMALL: f64 = 1e-3;
/// Periods in which the covariance settles, 3 s. Margins and growing poles are the same after 0.5 s and after 12 s;
/// after 1 s a response is off by up to 5 %.
const SETTLING: usize = 3000;

/// Scheduled LQR with its estimator, linearised at an operating point.
#[derive(Clone, Debug)]
pub struct SmallSignalController {
    a: DMatrix<f64>,
    /// Of `C (z − A)⁻¹ B`.
    response: FrequencyResponse,
    d: [f64; READINGS],
    period: f64,
}

impl SmallSignalController {
    /// Linearises estimator and law, settled at rest at a piston position \[m\] with a payload \[kg\].
    /// `rod_side_term` is (A_r/A_p) p_B \[Pa\].
    pub fn at_rest(
        estimator: &StateEstimator<f64>,
        law: &ScheduledLqr<f64>,
        position: f64,
        payload: f64,
        rod_side_term: f64,
    ) -> Self {
        let rest = measured_at_rest(&estimator.filter.model, position, payload, rod_side_term);
        let mut estimated = estimator.start(&rest);
        for _ in 0..SETTLING {
            estimator.update(&mut estimated, &rest, rest.motor_speed);
        }
        let preview = Preview::at_rest(law.period, position);
        let state = law.start(
            law.settled_regulator(estimator, &estimated),
            estimator,
            &estimated,
            position,
        );
        let settled = Settled { estimator, law, estimated, state, preview, rest };
        let kept = estimator.total_delay() + 1;
        let order = STATES + 1 + kept;
        let size = |i: usize| if i < STATES { STATE_SIZES[i] } else { 1.0 };
        let (mut a, mut b) = (DMatrix::zeros(order, order), DMatrix::zeros(order, READINGS));
        let (mut c, mut d) = (vec![0.0; order], [0.0; READINGS]);
        for j in 0..order + READINGS {
            let (mut change, mut reading) = (DVector::zeros(order), [0.0; READINGS]);
            match j.checked_sub(order) {
                None => change[j] = SMALL * size(j),
                Some(k) => reading[k] = SMALL * READING_SIZES[k],
            }
            let (up, u_up) = settled.period(&change, reading);
            let (down, u_down) = settled.period(&-change, reading.map(|r| -r));
            // states in units of their sizes, so that the matrix that is inverted is well conditioned
            let column =
                DVector::from_fn(order, |i, _| (up[i] - down[i]) / (2.0 * SMALL * size(i)));
            let command = (u_up - u_down) / (2.0 * SMALL);
            match j.checked_sub(order) {
                None => {
                    a.set_column(j, &column);
                    c[j] = command;
                }
                Some(k) => {
                    b.set_column(k, &(column / READING_SIZES[k]));
                    d[k] = command / READING_SIZES[k];
                }
            }
        }
        Self { response: FrequencyResponse::new(&a, &b, &[c]), a, d, period: law.period }
    }

    /// Control period \[s\].
    pub fn period(&self) -> f64 {
        self.period
    }

    /// Its poles that grow faster than a rate \[1/s\] with readings that stay.
    ///
    /// # Errors
    ///
    /// [`DesignError::Eigenvalues`] when they cannot be computed.
    pub(crate) fn growing_poles(&self, growth: f64) -> Result<u32, DesignError> {
        let least = (growth * self.period).exp();
        let poles = eigenvalues(&self.a)?;
        let growing = poles.iter().filter(|pole| pole.norm() > least).count();
        Ok(u32::try_from(growing).unwrap_or(u32::MAX))
    }

    /// Amplitude of the commanded motor speed \[rev/s\] for measurements with the complex amplitudes `readings` and
    /// the time dependence e^(s t), s in \[1/s\]; NaN at a pole.
    ///
    /// The readings are position \[m\], load pressure \[Pa\] and motor speed \[rev/s\]. Above half the sampling
    /// frequency the response of the sampled controller is mirrored.
    pub fn frequency_response(
        &self,
        readings: [Complex<f64>; READINGS],
        s: Complex<f64>,
    ) -> Complex<f64> {
        let direct: Complex<f64> = readings.iter().zip(self.d).map(|(y, d)| y * d).sum();
        match self.response.at((s * self.period).exp(), &readings).as_deref() {
            Some([command]) => command + direct,
            _ => Complex::new(f64::NAN, f64::NAN),
        }
    }
}

/// Measurements at rest at a piston position \[m\] with a payload \[kg\]; the motor makes good the leakage.
fn measured_at_rest(
    model: &ReducedModel<f64>,
    position: f64,
    payload: f64,
    rod_side_term: f64,
) -> EstimatorInput<f64> {
    let load_pressure = model.at(position, payload).holding_pressure;
    EstimatorInput {
        position,
        position_is_good: 1.0,
        load_pressure,
        load_pressure_is_good: 1.0,
        rod_side_term,
        motor_speed: model.leakage(load_pressure),
    }
}

/// The controller at its operating point.
struct Settled<'a> {
    estimator: &'a StateEstimator<f64>,
    law: &'a ScheduledLqr<f64>,
    estimated: StateEstimatorState<f64>,
    state: ScheduledLqrState<f64>,
    preview: Preview<f64>,
    rest: EstimatorInput<f64>,
}

impl Settled<'_> {
    /// A period from a changed state with changed readings: the next state, and the command \[rev/s\], both as they
    /// differ from rest.
    fn period(&self, change: &DVector<f64>, reading: [f64; READINGS]) -> (DVector<f64>, f64) {
        let order = change.len();
        let speed = self.rest.motor_speed;
        let settled = self.estimated.filter.estimate.to_array();
        let mut estimated = self.estimated;
        estimated.filter.estimate =
            MachineState::from_array(std::array::from_fn(|i| settled[i] + change[i]));
        let commands: Vec<f64> = (STATES + 1..order).map(|i| speed + change[i]).collect();
        let [newest, older @ ..] = &commands[..] else { return (change.clone(), f64::NAN) };
        let mut estimated = estimated.with_commands(older, speed + change[STATES]);
        let input = EstimatorInput {
            position: self.rest.position + reading[0],
            load_pressure: self.rest.load_pressure + reading[1],
            motor_speed: speed + reading[2],
            ..self.rest
        };
        self.estimator.update(&mut estimated, &input, *newest);
        let mut state = self.state;
        let command = self.law.update(&mut state, self.estimator, &estimated, &self.preview);
        let estimate = estimated.filter.estimate.to_array();
        let next = DVector::from_fn(order, |i, _| match i {
            i if i < STATES => estimate[i] - settled[i],
            STATES => reading[2],
            i if i == STATES + 1 => command - speed,
            i => commands[i - STATES - 2] - speed,
        });
        (next, command - speed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scheduled_lqr::designed;
    use hydroboom_description::Description;
    use std::f64::consts::TAU;

    /// The controller is excited by small sines until transients have decayed.
    #[test]
    fn the_small_signal_response_to_sines_is_the_controllers() {
        let (estimator, law) = designed(&Description::uia_single_boom().unwrap(), 1).unwrap();
        let (position, payload, rod_side_term) = (0.25, 250.0, 1.5e5);
        let linear =
            SmallSignalController::at_rest(&estimator, &law, position, payload, rod_side_term);
        let rest = measured_at_rest(&estimator.filter.model, position, payload, rod_side_term);
        let preview = Preview::at_rest(law.period, position);
        let sizes = [1e-7, 1e1, 1e-3];
        for (which, frequency) in [(0, 1.0), (0, 8.0), (1, 2.0), (1, 20.0), (2, 5.0)] {
            let turn = TAU * frequency * law.period;
            let mut estimated = estimator.start(&rest);
            let mut state = law.start(
                law.settled_regulator(&estimator, &estimated),
                &estimator,
                &estimated,
                position,
            );
            let mut sum = Complex::new(0.0, 0.0);
            let mut command = rest.motor_speed;
            let (settle, count) = (10_000, 4_000);
            for k in 0..settle + count {
                let mut reading = [0.0; READINGS];
                reading[which] = sizes[which] * (turn * f64::from(k)).cos();
                let input = EstimatorInput {
                    position: rest.position + reading[0],
                    load_pressure: rest.load_pressure + reading[1],
                    motor_speed: rest.motor_speed + reading[2],
                    ..rest
                };
                estimator.update(&mut estimated, &input, command);
                command = law.update(&mut state, &estimator, &estimated, &preview);
                if k >= settle {
                    sum += Complex::new(0.0, -turn * f64::from(k)).exp() * command;
                }
            }
            let found = sum * 2.0 / f64::from(count);
            let mut reading = [Complex::new(0.0, 0.0); READINGS];
            reading[which] = Complex::from(sizes[which]);
            let wanted = linear.frequency_response(reading, Complex::new(0.0, TAU * frequency));
            assert!(
                (found - wanted).norm() < 0.05 * wanted.norm(),
                "{which} at {frequency} Hz: {found} for {wanted}"
            );
        }
    }
}
