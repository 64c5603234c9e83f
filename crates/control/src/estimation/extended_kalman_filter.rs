//! Extended Kalman filter of the machine: states, unknown inputs and parameters of the [reduced
//! model](super::reduced_model).
//!
//! Per control period: prediction `ẑ = f(ẑ, n)`, `P = F P Fᵀ + Q` with the exact Jacobian F by dual
//! numbers. Then correction by position and load pressure, one after the other: innovation ν, variance `S =
//! H P Hᵀ + R`, gain `K = P Hᵀ/S`, `ẑ = ẑ + K ν`, and P by Joseph's form. Beside P, which gives the gain,
//! the [error covariance](super::error_covariance) includes the parameters that the filter assumes to be
//! exact; the estimator reports it.
//!
//! Sources: A. Gelb (ed.), *Applied Optimal Estimation*, 1974, section 6.1; Bucy and Joseph, 1968 (covariance). A load
//! change is told by the [innovation test](super::innovation_test).

use super::error_covariance::{
    ConsideredParameters, Covariance, ERRORS, corrected, independent, limit, propagated,
    with_considered,
};
use super::innovation_test::InnovationTest;
use super::noise_estimation::NoiseEstimate;
use super::reduced_model::state_index::{
    DISTURBANCE, LOAD_PRESSURE, PAYLOAD, POSITION, TRANSITION_PRESSURE, UNKNOWN_FLOW, VELOCITY,
};
use super::reduced_model::{MachineState, OperatingPoint, ReducedModel, STATES};
use crate::memory::Memory;
use core::array::from_fn;
use hydroboom_math::{Dual, Real, record};

/// Place of the considered lag of the position sensor among all errors.
const SENSOR_LAG: usize = ERRORS - 1;
/// States that are parameters, or nearly so.
const PARAMETERS: [usize; 3] = [UNKNOWN_FLOW, PAYLOAD, TRANSITION_PRESSURE];

/// Extended Kalman filter of the reduced model: its settings. The state is an [`EstimatorState`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExtendedKalmanFilter<T> {
    /// Reduced model of the machine.
    pub model: ReducedModel<T>,
    /// Initial standard deviation of each state, in the state's unit.
    pub initial_deviation: MachineState<T>,
    /// Process noise: standard deviation of each state's random walk after one second, in the state's unit. That of
    /// the load pressure follows from [`flow_ripple`](Self::flow_ripple).
    pub process_noise: MachineState<T>,
    /// Process noise of the pump's delivered flow, as a motor speed: standard deviation of its integral after one
    /// second \[rev\].
    pub flow_ripple: T,
    /// Smallest possible value of each state, in the state's unit.
    pub lowest: MachineState<T>,
    /// Largest possible value of each state, in the state's unit.
    pub highest: MachineState<T>,
    /// Standard deviations of the measurements: piston position \[m\] and load pressure \[Pa\]. They cover sensor
    /// noise and unmodelled dynamics.
    pub measurement_noise: [T; 2],
    /// Time constant of the estimation of measurement noise \[s\].
    pub noise_memory: T,
    /// Load velocity \[m/s\] below which the oil's transition pressure has no process noise, so that its variance
    /// does not grow without excitation.
    pub excitation_velocity: T,
    /// Duration of inconsistent innovations after which the filter counts as diverged \[s\].
    pub divergence_time: T,
    /// Time constant of the position sensor \[s\].
    pub sensor_lag: T,
    /// Standard deviations of the consider parameters.
    pub considered: ConsideredParameters<T>,
    /// Relative standard deviation of the payload's moment arm \[1\]; considered, not estimated, because pressures
    /// show only the moment of the load.
    pub payload_arm: T,
    /// Standard deviation of the payload after a detected load change \[kg\].
    pub payload_change: T,
    /// Standard deviation of the unknown force over the piston's area after a detected load change \[Pa\].
    pub force_change: T,
    /// Largest variance of the payload in the filter, relative to its initial variance \[1\].
    pub payload_variance_limit: T,
    /// Innovation test, which detects load changes.
    pub innovation_test: InnovationTest<T>,
    /// Control period \[s\].
    pub period: T,
}

record! {
    /// Measurements of one control period for the filter.
    pub struct EstimatorInput<T> {
        /// Piston position
        #[unit = "m"]
        pub position: T,
        /// 1 where the position is valid, 0 where it is absent, out of range or stale
        #[unit = "1"]
        pub position_is_good: T,
        /// Load pressure
        #[unit = "Pa"]
        pub load_pressure: T,
        /// 1 where both cylinder pressures are valid, 0 where one is not
        #[unit = "1"]
        pub load_pressure_is_good: T,
        /// Part of the piston-side pressure that balances the rod side, (A_r/A_p) p_B
        #[unit = "Pa"]
        pub rod_side_term: T,
        /// Mean motor speed over the last control period
        #[unit = "rev/s"]
        pub motor_speed: T,
    }
}

/// State of the extended Kalman filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EstimatorState<T> {
    /// State estimates.
    pub estimate: MachineState<T>,
    /// Covariance P of the filter, which determines its gain.
    pub covariance: Covariance<T>,
    /// Error covariance of the estimates, then of the consider parameters in the order of [`ConsideredParameters`].
    pub errors: Covariance<T, ERRORS>,
    /// Low-pass filtered normalised innovation squared \[1\]; about 1 for a consistent filter.
    pub mean_nis: T,
    /// Duration for which the innovations have been inconsistent \[s\].
    pub inconsistent_time: T,
    /// Innovations of position \[m\] and load pressure \[Pa\] in the last control period.
    pub innovation: [T; 2],
    /// Normalised innovations squared (NIS) of position and load pressure in the last control period \[1\].
    pub nis: [T; 2],
    /// Measured noise of position and load pressure.
    noise: [NoiseEstimate<T>; 2],
}

impl<T: Copy> Memory<T> for EstimatorState<T> {
    fn visited(self, visit: &mut impl FnMut(&'static str, T) -> T) -> Self {
        Self {
            estimate: self.estimate.map(|v| visit("estimate", v)),
            covariance: self.covariance.map(|row| row.map(|v| visit("covariance", v))),
            errors: self.errors.map(|row| row.map(|v| visit("error_covariance", v))),
            mean_nis: visit("mean_nis", self.mean_nis),
            inconsistent_time: visit("inconsistent_time", self.inconsistent_time),
            innovation: self.innovation.map(|v| visit("innovation", v)),
            nis: self.nis.map(|v| visit("nis", v)),
            noise: self.noise.map(|noise| noise.map(|v| visit("noise", v))),
        }
    }
}

impl<T: Real> EstimatorState<T> {
    /// Element-wise selection: `yes` where `mask` holds, else `no`.
    #[must_use]
    pub fn select(mask: T::Mask, yes: &Self, no: &Self) -> Self {
        let pick = |yes: T, no: T| T::select(mask, yes, no);
        let [noise_yes, noise_no] = [yes, no].map(|of| of.noise.map(NoiseEstimate::to_array));
        Self {
            estimate: MachineState::from_array({
                let (yes, no) = (yes.estimate.to_array(), no.estimate.to_array());
                from_fn(|i| pick(yes[i], no[i]))
            }),
            covariance: from_fn(|i| from_fn(|j| pick(yes.covariance[i][j], no.covariance[i][j]))),
            errors: from_fn(|i| from_fn(|j| pick(yes.errors[i][j], no.errors[i][j]))),
            mean_nis: pick(yes.mean_nis, no.mean_nis),
            inconsistent_time: pick(yes.inconsistent_time, no.inconsistent_time),
            innovation: from_fn(|k| pick(yes.innovation[k], no.innovation[k])),
            nis: from_fn(|k| pick(yes.nis[k], no.nis[k])),
            noise: from_fn(|k| {
                NoiseEstimate::from_array(from_fn(|i| pick(noise_yes[k][i], noise_no[k][i])))
            }),
        }
    }
}

impl<T: Real> ExtendedKalmanFilter<T> {
    /// Converts every setting to another number type by `f`.
    pub fn map<U: Real>(&self, f: impl Fn(T) -> U + Copy) -> ExtendedKalmanFilter<U> {
        ExtendedKalmanFilter {
            model: self.model.map(f),
            initial_deviation: self.initial_deviation.map(f),
            process_noise: self.process_noise.map(f),
            flow_ripple: f(self.flow_ripple),
            lowest: self.lowest.map(f),
            highest: self.highest.map(f),
            measurement_noise: self.measurement_noise.map(f),
            noise_memory: f(self.noise_memory),
            excitation_velocity: f(self.excitation_velocity),
            divergence_time: f(self.divergence_time),
            sensor_lag: f(self.sensor_lag),
            considered: self.considered.map(f),
            payload_arm: f(self.payload_arm),
            payload_change: f(self.payload_change),
            force_change: f(self.force_change),
            payload_variance_limit: f(self.payload_variance_limit),
            innovation_test: self.innovation_test.map(f),
            period: f(self.period),
        }
    }

    /// Standard deviations of the estimates by the error covariance; that of the payload includes its moment arm.
    pub fn deviation(&self, state: &EstimatorState<T>) -> MachineState<T> {
        let variance = |i: usize| state.errors[i][i].max(T::zero());
        let of_errors = MachineState::from_array(core::array::from_fn(|i| variance(i).sqrt()));
        MachineState { payload: self.payload_deviation(state), ..of_errors }
    }

    /// Standard deviation of the estimated payload \[kg\], including the uncertainty of its moment arm.
    ///
    /// The error covariance assumes the crane file's centre of mass. A relative error of the moment arm is the same
    /// relative error of the payload.
    pub fn payload_deviation(&self, state: &EstimatorState<T>) -> T {
        let by_arm = self.payload_arm * state.estimate.payload;
        (state.errors[PAYLOAD][PAYLOAD].max(T::zero()) + by_arm.square()).sqrt()
    }

    /// Initial state of a machine at rest: the payload follows from the measured load pressure.
    ///
    /// Position and load pressure of `measured` have to be valid, whatever their flags say; NaN would remain in the
    /// estimates.
    pub fn start(&self, measured: &EstimatorInput<T>) -> EstimatorState<T> {
        let zero = T::zero();
        let payload = self.model.payload_at_rest(measured.position, measured.load_pressure);
        let at = self.model.at(measured.position, payload);
        let estimate = MachineState {
            position: measured.position - at.compliance * measured.load_pressure,
            velocity: zero,
            load_pressure: measured.load_pressure,
            friction: zero,
            disturbance: zero,
            unknown_flow: zero,
            payload,
            transition_pressure: self.model.oil.transition_pressure,
        };
        let deviations = self.initial_deviation.to_array();
        let considered = self.considered.to_array();
        let all: [T; ERRORS] = core::array::from_fn(|i| match i.checked_sub(STATES) {
            Some(parameter) => considered[parameter],
            None => deviations[i],
        });
        EstimatorState {
            estimate,
            covariance: independent(&deviations),
            errors: independent(&all),
            mean_nis: T::one(),
            inconsistent_time: zero,
            innovation: [zero; 2],
            nis: [T::one(); 2],
            noise: [measured.position, measured.load_pressure].map(NoiseEstimate::start),
        }
    }

    /// One control period: prediction, then correction by the measurements.
    ///
    /// A position or load pressure that is flagged as invalid does not correct; its value may be NaN. Estimates are
    /// clamped to [`lowest`](Self::lowest) and [`highest`](Self::highest).
    pub fn update(&self, state: &mut EstimatorState<T>, measured: &EstimatorInput<T>) {
        let never = T::one().lt(T::zero());
        self.update_frozen(state, measured, never);
    }

    /// One control period as [`update`](Self::update), but without estimation of unknown flow and transition pressure
    /// where `is_frozen` holds: their gain is zero, and their variances do not fall.
    pub fn update_frozen(
        &self,
        state: &mut EstimatorState<T>,
        measured: &EstimatorInput<T>,
        is_frozen: T::Mask,
    ) {
        self.predict(state, measured.motor_speed, measured.rod_side_term);
        self.correct(state, measured, is_frozen);
    }

    /// One control period with the load-holding valves shut: position and load pressure are as measured, the velocity
    /// is zero, and the payload is estimated anew.
    ///
    /// Unknown flow, transition pressure and their covariance stay, since they are not observable.
    pub fn hold(&self, state: &mut EstimatorState<T>, measured: &EstimatorInput<T>) {
        let anew = self.start(measured);
        let keep = |i: usize| (PARAMETERS.contains(&i) && i != PAYLOAD) || i >= STATES;
        let (old, new) = (state.estimate.to_array(), anew.estimate.to_array());
        let estimate = core::array::from_fn(|i| if keep(i) { old[i] } else { new[i] });
        let (covariance, errors) = (
            retain_block(&state.covariance, &anew.covariance, keep),
            retain_block(&state.errors, &anew.errors, keep),
        );
        let estimate = MachineState::from_array(estimate);
        *state = EstimatorState { estimate, covariance, errors, ..anew };
    }

    /// Whether the innovations have been inconsistent for longer than the divergence time. A NaN innovation counts as
    /// inconsistent.
    pub fn has_diverged(&self, state: &EstimatorState<T>) -> T::Mask {
        self.divergence_time.lt(state.inconsistent_time)
    }

    /// A period on with the motor turning at a mean speed \[rev/s\].
    fn predict(&self, state: &mut EstimatorState<T>, motor_speed: T, rod_side_term: T) {
        let (estimate, jacobian) = self.transition(&state.estimate, motor_speed, rod_side_term);
        state.estimate = estimate;
        let own = jacobian.map(|row| core::array::from_fn(|j| row[j]));
        state.covariance = propagated(&state.covariance, &own);
        state.errors = propagated(&state.errors, &jacobian);
        // the unknown flow changes the pressure by the stiffness of the oil
        let at = self.model.at(state.estimate.position, state.estimate.payload);
        let MachineState { load_pressure, transition_pressure, .. } = state.estimate;
        let oil = self.model.bulk_modulus(load_pressure, transition_pressure, rod_side_term);
        let by_speed = self.model.displacement * self.model.stiffness(&at, oil);
        let pressure = by_speed * self.flow_ripple;
        // the oil is excited by motion alone
        let is_still = state.estimate.velocity.abs().lt(self.excitation_velocity);
        let drift = self.process_noise.transition_pressure;
        let transition_pressure = T::select(is_still, T::zero(), drift);
        let process_noise =
            MachineState { load_pressure: pressure, transition_pressure, ..self.process_noise };
        for (i, noise) in process_noise.to_array().into_iter().enumerate() {
            let (own, all) = (&mut state.covariance[i][i], &mut state.errors[i][i]);
            *own = *own + noise.square() * self.period;
            *all = *all + noise.square() * self.period;
        }
        // inconsistent innovations indicate a load change of any size, or a force as large
        let share = self.innovation_test.inconsistency(state.mean_nis);
        for (i, change) in [(PAYLOAD, self.payload_change), (DISTURBANCE, self.force_change)] {
            let variance = &mut state.errors[i][i];
            *variance = variance.max(share * change.square());
        }
        // the variance of a parameter that is not excited is bounded
        let initial = self.initial_deviation.to_array();
        let most = |payload: T| {
            let known = |i: usize| if i == PAYLOAD { payload } else { initial[i].square() };
            PARAMETERS.map(|i| (i, known(i)))
        };
        limit(
            &mut state.covariance,
            &most(self.payload_variance_limit * initial[PAYLOAD].square()),
        );
        limit(&mut state.errors, &most(self.payload_change.square()));
    }

    /// State one control period later at a mean motor speed \[rev/s\], and the rows of its Jacobian by states and
    /// consider parameters, exact by dual numbers.
    ///
    /// `rod_side_term` is (A_r/A_p) p_B \[Pa\].
    pub fn transition(
        &self,
        z: &MachineState<T>,
        motor_speed: T,
        rod_side_term: T,
    ) -> (MachineState<T>, [[T; ERRORS]; STATES]) {
        let constant = Dual::<T, ERRORS>::constant;
        let mut direction = 0..STATES;
        let variables = z.map(|value| Dual::variable(value, direction.next().unwrap_or(0)));
        let model = with_considered(&self.model);
        let next = model.step(
            &variables,
            constant(motor_speed),
            constant(rod_side_term),
            constant(self.period),
        );
        (next.map(|dual| dual.value), next.to_array().map(|dual| dual.slope))
    }

    /// Measurement matrix: rows of position and load pressure, columns of load position, load velocity and load
    /// pressure.
    ///
    /// The position sensor reads `x − τ x'` of the piston at x = y + γ p, with the sensor's time constant τ.
    pub fn measurement_rows(&self, at: &OperatingPoint<T>) -> [[T; 3]; 2] {
        let (zero, one) = (T::zero(), T::one());
        [[one, -self.sensor_lag, at.compliance], [zero, zero, one]]
    }

    /// Correction by position and load pressure.
    fn correct(
        &self,
        state: &mut EstimatorState<T>,
        measured: &EstimatorInput<T>,
        is_frozen: T::Mask,
    ) {
        let zero = T::zero();
        let at = self.model.at(state.estimate.position, state.estimate.payload);
        let values = [measured.position, measured.load_pressure];
        let good = [measured.position_is_good, measured.load_pressure_is_good];
        let rows = self.measurement_rows(&at);
        for k in 0..2 {
            let is_good = T::lit(0.5).lt(good[k]);
            let noise = &mut state.noise[k];
            // a lost value repeats the last one
            let value = T::select(is_good, values[k], noise.last);
            noise.update(value, is_good, self.period / self.noise_memory);
            let variance = self.measurement_noise[k].square().max(noise.variance);
            let row = &rows[k];
            let z = state.estimate.to_array();
            let predicted = row[0] * z[POSITION] + row[1] * z[VELOCITY] + row[2] * z[LOAD_PRESSURE];
            // by the considered lag of the position sensor
            let by_lag = if k == 0 { -z[VELOCITY] } else { zero };
            let shared = cross_covariance(&state.covariance, row, zero);
            let shared_errors = cross_covariance(&state.errors, row, by_lag);
            let s = output_variance(&shared, row, zero) + variance;
            let s_errors = output_variance(&shared_errors, row, by_lag) + variance;
            let innovation = T::select(is_good, value - predicted, zero);
            let nis = innovation.square() / s;
            // two numbers a period
            let since = T::lit(0.5) * self.period;
            let mean = self.innovation_test.update(state.mean_nis, nis, since);
            state.mean_nis = T::select(is_good, mean, state.mean_nis);
            (state.innovation[k], state.nis[k]) = (innovation, nis);
            let mut gain = shared.map(|shared| T::select(is_good, shared / s, zero));
            for parameter in [UNKNOWN_FLOW, TRANSITION_PRESSURE] {
                gain[parameter] = T::select(is_frozen, zero, gain[parameter]);
            }
            state.estimate = MachineState::from_array(core::array::from_fn(|i| {
                gain[i].mul_add(innovation, z[i])
            }));
            corrected(&mut state.covariance, &gain, &shared, s);
            // consider parameters are not estimated
            let of_all = core::array::from_fn(|i| gain.get(i).copied().unwrap_or(zero));
            corrected(&mut state.errors, &of_all, &shared_errors, s_errors);
        }
        let consistent = self.innovation_test.is_consistent(state.mean_nis);
        state.inconsistent_time =
            T::select(consistent, zero, state.inconsistent_time + self.period);
        let (low, high) = (self.lowest.to_array(), self.highest.to_array());
        let z = state.estimate.to_array();
        state.estimate =
            MachineState::from_array(core::array::from_fn(|i| z[i].clamp(low[i], high[i])));
    }
}

/// A covariance in which the errors that are kept have their old block, and the others are new.
fn retain_block<T: Real, const N: usize>(
    old: &Covariance<T, N>,
    new: &Covariance<T, N>,
    keep: impl Fn(usize) -> bool,
) -> Covariance<T, N> {
    core::array::from_fn(|i| {
        core::array::from_fn(|j| if keep(i) && keep(j) { old[i][j] } else { new[i][j] })
    })
}

/// Covariance of each error with a measured number, `P Hᵀ`: by position, velocity, load pressure, and the considered
/// lag.
#[inline(always)]
fn cross_covariance<T: Real, const N: usize>(
    p: &Covariance<T, N>,
    row: &[T; 3],
    by_lag: T,
) -> [T; N] {
    core::array::from_fn(|i| {
        let states =
            row[0] * p[i][POSITION] + row[1] * p[i][VELOCITY] + row[2] * p[i][LOAD_PRESSURE];
        p[i].get(SENSOR_LAG).map_or(states, |lag| by_lag.mul_add(*lag, states))
    })
}

/// Variance of a measured number without its noise, `H P Hᵀ`.
#[inline(always)]
fn output_variance<T: Real, const N: usize>(shared: &[T; N], row: &[T; 3], by_lag: T) -> T {
    let states =
        row[0] * shared[POSITION] + row[1] * shared[VELOCITY] + row[2] * shared[LOAD_PRESSURE];
    shared.get(SENSOR_LAG).map_or(states, |lag| by_lag.mul_add(*lag, states))
}
