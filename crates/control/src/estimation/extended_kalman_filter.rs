//! Extended Kalman filter of the machine: states, unknown inputs and parameters of the [reduced model](super::reduced_model).
//!
//! Per control period: prediction `ẑ = f(ẑ, n)`, `P = F P Fᵀ + Q` with the exact Jacobian F by dual numbers; then position and load pressure, one after the
//! other: innovation ν, variance `S = H P Hᵀ + R`, gain `K = P Hᵀ/S`, `ẑ = ẑ + K ν`, and P by Joseph's form, expanded for one number:
//! `P − K (H P) − (P Hᵀ) Kᵀ + K S Kᵀ`.
//!
//! Sources: A. Gelb (ed.), *Applied Optimal Estimation*, 1974, section 6.1; Bucy and Joseph, 1968 (covariance); process noise adapted by the
//! [innovation test](super::innovation_test).

use super::innovation_test::InnovationTest;
use super::noise_estimation::NoiseEstimate;
use super::reduced_model::{MachineState, OperatingPoint, ReducedModel, STATES};
use hydroboom_math::{Dual, Real, record};

/// A covariance, rows first.
pub type Covariance<T> = [[T; STATES]; STATES];

/// Place of the load's position, of its velocity, … in a state.
const POSITION: usize = 0;
const VELOCITY: usize = 1;
const LOAD_PRESSURE: usize = 2;
const DISTURBANCE: usize = 4;
const PAYLOAD: usize = 6;
/// The first of the states that are parameters, or nearly so.
const PARAMETERS: [usize; 3] = [5, 6, 7];

/// Settings of the filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExtendedKalmanFilter<T> {
    /// The model.
    pub model: ReducedModel<T>,
    /// Standard deviations before anything is measured.
    pub initial_deviation: MachineState<T>,
    /// Process noise: standard deviation by which each changes in a second; that of the load pressure comes from the flow's.
    pub process_noise: MachineState<T>,
    /// Process noise of the delivered flow, as a motor speed: standard deviation of its integral over a second \[rev\].
    pub flow_ripple: T,
    /// Smallest and largest values that are possible.
    pub lowest: MachineState<T>,
    /// Largest values that are possible.
    pub highest: MachineState<T>,
    /// Standard deviation of position \[m\] and load pressure \[Pa\] as they are measured: sensors, and what the model leaves out.
    pub measurement_noise: [T; 2],
    /// Averaging time of the measured noise \[s\].
    pub noise_memory: T,
    /// Time of inconsistent innovations after which the filter has diverged \[s\].
    pub divergence_time: T,
    /// Lag of the position sensor \[s\].
    pub sensor_lag: T,
    /// Innovation test.
    pub innovation_test: InnovationTest<T>,
    /// Control period \[s\].
    pub period: T,
}

record! {
    /// What is measured in a period.
    pub struct EstimatorInput<T> {
        /// Piston position
        #[unit = "m"]
        pub position: T,
        /// 1 where the position is good, 0 where it is absent, out of range or stale
        #[unit = "1"]
        pub position_is_good: T,
        /// Load pressure
        #[unit = "Pa"]
        pub load_pressure: T,
        /// 1 where both pressures are good, 0 where one is not
        #[unit = "1"]
        pub load_pressure_is_good: T,
        /// Piston-side pressure beyond the load pressure, (A_r/A_p) p_B
        #[unit = "Pa"]
        pub pressure_beyond: T,
        /// Mean motor speed since the last period
        #[unit = "rev/s"]
        pub motor_speed: T,
    }
}

/// What the filter carries from period to period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EstimatorState<T> {
    /// Estimates.
    pub estimate: MachineState<T>,
    /// Their covariance.
    pub covariance: Covariance<T>,
    /// Mean of the normalised innovations squared \[1\].
    pub mean_nis: T,
    /// For how long the innovations have been inconsistent \[s\].
    pub inconsistent_time: T,
    /// Innovations of position \[m\] and load pressure \[Pa\] of the last period.
    pub innovation: [T; 2],
    /// Normalised innovations squared \[1\] of the last period.
    pub nis: [T; 2],
    /// Measured noise of position and load pressure.
    noise: [NoiseEstimate<T>; 2],
}

impl<T: Real> EstimatorState<T> {
    /// Standard deviations of the estimates.
    pub fn deviation(&self) -> MachineState<T> {
        let variance = |i: usize| self.covariance[i][i].max(T::zero());
        MachineState::from_array(core::array::from_fn(|i| variance(i).sqrt()))
    }
}

impl<T: Real> ExtendedKalmanFilter<T> {
    /// At rest where the machine is: the load pressure is taken for its weight.
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
        let covariance = core::array::from_fn(|i| {
            core::array::from_fn(|j| if i == j { deviations[i].square() } else { zero })
        });
        EstimatorState {
            estimate,
            covariance,
            mean_nis: T::one(),
            inconsistent_time: zero,
            innovation: [zero; 2],
            nis: [T::one(); 2],
            noise: [measured.position, measured.load_pressure].map(NoiseEstimate::start),
        }
    }

    /// One control period: prediction, then correction.
    pub fn update(&self, state: &mut EstimatorState<T>, measured: &EstimatorInput<T>) {
        self.predict(state, measured.motor_speed, measured.pressure_beyond);
        self.correct(state, measured);
    }

    /// One control period in which valves hold the load: nothing moves, position and load pressure are as measured, the payload may be another. What is known of
    /// unknown flow and oil stays, since nothing is learned of them.
    pub fn hold(&self, state: &mut EstimatorState<T>, measured: &EstimatorInput<T>) {
        let anew = self.start(measured);
        let keep = |i: usize| PARAMETERS.contains(&i) && i != PAYLOAD;
        let (old, new) = (state.estimate.to_array(), anew.estimate.to_array());
        let estimate = core::array::from_fn(|i| if keep(i) { old[i] } else { new[i] });
        let covariance = core::array::from_fn(|i| {
            core::array::from_fn(|j| match keep(i) && keep(j) {
                true => state.covariance[i][j],
                false => anew.covariance[i][j],
            })
        });
        *state =
            EstimatorState { estimate: MachineState::from_array(estimate), covariance, ..anew };
    }

    /// Whether measurements have contradicted the filter for longer than the divergence time.
    pub fn has_diverged(&self, state: &EstimatorState<T>) -> T::Mask {
        self.divergence_time.lt(state.inconsistent_time)
    }

    /// A period on with the motor turning at a mean speed \[rev/s\].
    fn predict(&self, state: &mut EstimatorState<T>, motor_speed: T, beyond: T) {
        let (estimate, jacobian) = self.transition(&state.estimate, motor_speed, beyond);
        state.estimate = estimate;
        let p = &state.covariance;
        // F P, then F P Fᵀ
        let left: Covariance<T> = core::array::from_fn(|i| {
            let row = &jacobian[i];
            (0..STATES).fold([T::zero(); STATES], |sum, k| {
                core::array::from_fn(|j| row[k].mul_add(p[k][j], sum[j]))
            })
        });
        let mut covariance: Covariance<T> = core::array::from_fn(|i| {
            core::array::from_fn(|j| {
                (0..STATES).fold(T::zero(), |sum, k| left[i][k].mul_add(jacobian[j][k], sum))
            })
        });
        let factor = self.innovation_test.factor(state.mean_nis);
        // what is not known of the flow changes the pressure by the stiffness of the oil
        let at = self.model.at(state.estimate.position, state.estimate.payload);
        let MachineState { load_pressure, transition_pressure, .. } = state.estimate;
        let oil = self.model.bulk_modulus(load_pressure, transition_pressure, beyond);
        let by_speed = self.model.displacement * self.model.stiffness(&at, oil);
        let pressure = by_speed * self.flow_ripple;
        let process_noise = MachineState { load_pressure: pressure, ..self.process_noise };
        for (i, noise) in process_noise.to_array().into_iter().enumerate() {
            let changes = i == DISTURBANCE || i == PAYLOAD;
            let noise = if changes { noise * factor } else { noise };
            covariance[i][i] = covariance[i][i] + noise.square() * self.period;
        }
        // a parameter is never known less than before anything was measured; a payload that has changed may be any
        for i in PARAMETERS {
            let known = self.initial_deviation.to_array()[i].square();
            let most = if i == PAYLOAD { T::lit(30.0) * known } else { known };
            let scale = (most / covariance[i][i]).min(T::one()).sqrt();
            for j in 0..STATES {
                covariance[i][j] = covariance[i][j] * scale;
                covariance[j][i] = covariance[j][i] * scale;
            }
        }
        state.covariance = covariance;
    }

    /// The state a period later with the motor turning at a mean speed \[rev/s\], and the Jacobian, exact by dual numbers.
    pub fn transition(
        &self,
        z: &MachineState<T>,
        motor_speed: T,
        beyond: T,
    ) -> (MachineState<T>, Covariance<T>) {
        let constant = Dual::<T, STATES>::constant;
        let mut direction = 0..STATES;
        let variables = z.map(|value| Dual::variable(value, direction.next().unwrap_or(0)));
        let model = self.model.map(constant);
        let next =
            model.step(&variables, constant(motor_speed), constant(beyond), constant(self.period));
        (next.map(|dual| dual.value), next.to_array().map(|dual| dual.slope))
    }

    /// Position and load pressure that are read, by load position, velocity and load pressure: `x − τ x'` of the piston at x = y + γ p, with τ the sensor's lag.
    pub fn measurement_rows(&self, at: &OperatingPoint<T>) -> [[T; 3]; 2] {
        let (zero, one) = (T::zero(), T::one());
        [[one, -self.sensor_lag, at.compliance], [zero, zero, one]]
    }

    /// What position and load pressure tell.
    fn correct(&self, state: &mut EstimatorState<T>, measured: &EstimatorInput<T>) {
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
            noise.update(value, self.period / self.noise_memory);
            let variance = self.measurement_noise[k].square().max(noise.variance);
            let row = &rows[k];
            let z = state.estimate.to_array();
            let predicted = row[0] * z[POSITION] + row[1] * z[VELOCITY] + row[2] * z[LOAD_PRESSURE];
            let p = &state.covariance;
            let shared: [T; STATES] = core::array::from_fn(|i| {
                row[0] * p[i][POSITION] + row[1] * p[i][VELOCITY] + row[2] * p[i][LOAD_PRESSURE]
            });
            let s = row[0] * shared[POSITION]
                + row[1] * shared[VELOCITY]
                + row[2] * shared[LOAD_PRESSURE]
                + variance;
            let innovation = T::select(is_good, value - predicted, zero);
            let nis = innovation.square() / s;
            let mean = self.innovation_test.update(state.mean_nis, nis, self.period);
            state.mean_nis = T::select(is_good, mean, state.mean_nis);
            (state.innovation[k], state.nis[k]) = (innovation, nis);
            let gain = shared.map(|shared| T::select(is_good, shared / s, zero));
            state.estimate = MachineState::from_array(core::array::from_fn(|i| {
                gain[i].mul_add(innovation, z[i])
            }));
            let before = state.covariance;
            for i in 0..STATES {
                for j in 0..=i {
                    let joseph = before[i][j] - gain[i] * shared[j] - shared[i] * gain[j]
                        + gain[i] * gain[j] * s;
                    state.covariance[i][j] = joseph;
                    state.covariance[j][i] = joseph;
                }
            }
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
