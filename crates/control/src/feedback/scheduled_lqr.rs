//! Gain-scheduled linear-quadratic regulator around the inverse dynamics of the reference.
//!
//! One control period has six steps, top to bottom. The estimated state when the command arrives. A
//! feasible reference, smoothed. The governor's offset. State and motor speed along it by [inverse
//! dynamics](super::inverse_dynamics). Feedback of the error by the [regulator](super::riccati) of the
//! present operating point, with [nested saturation](super::saturation). While that saturates, one-step
//! [policy improvement](super::rollout).

use super::inverse_dynamics::inverse_dynamics;
use super::riccati::{LinearQuadratic, Matrix, ORDER, Regulator};
use super::rollout::{Policy, Rollout, RolloutState};
use super::saturation::NestedSaturation;
use crate::estimation::reduced_model::{OperatingPoint, ReducedModel};
use crate::estimation::state_estimator::{PredictedState, StateEstimator, StateEstimatorState};
use crate::memory::Memory;
use crate::reference::governor::ReferenceGovernor;
use crate::reference::preview::Preview;
use crate::reference::smoothing::smoothed;
use crate::reference::speed_limit::SpeedLimit;
use hydroboom_math::{Real, record};

record! {
    /// Settings of the scheduled LQR; each is a key of the crane file.
    pub struct ScheduledLqrSettings<T> {
        /// Position error with unit cost (Bryson's rule)
        #[unit = "m"]
        pub position_tolerance: T,
        /// Velocity error with unit cost (Bryson's rule)
        #[unit = "m/s"]
        pub velocity_tolerance: T,
        /// Commanded piston velocity in addition to the feedforward with unit cost (Bryson's rule)
        #[unit = "m/s"]
        pub command_tolerance: T,
        /// Limit of the whole feedback, as a share of the largest motor speed
        #[unit = "1"]
        pub feedback_limit: T,
        /// Limit of the position feedback, as a share of the largest motor speed
        #[unit = "1"]
        pub position_limit: T,
        /// Share of the largest motor speed available for compressing the oil along the reference
        #[unit = "1"]
        pub filling_share: T,
        /// Share of Coulomb friction that is compensated by compression of the oil where friction changes its sign
        #[unit = "1"]
        pub filling_friction: T,
        /// Shortest smoothing window, in addition to the drive's lag
        #[unit = "s"]
        pub shortest_window: T,
        /// Longest smoothing window
        #[unit = "s"]
        pub longest_window: T,
        /// Time constant of the adaptation of the smoothing window
        #[unit = "s"]
        pub window_time_constant: T,
    }
}

/// Gain-scheduled LQR: model and settings. Its state is a [`ScheduledLqrState`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScheduledLqr<T> {
    /// Reduced model of the machine.
    pub model: ReducedModel<T>,
    /// Settings.
    pub settings: ScheduledLqrSettings<T>,
    /// Reference governor.
    pub governor: ReferenceGovernor<T>,
    /// One-step policy improvement.
    pub rollout: Rollout<T>,
    /// Largest motor speed \[rev/s\].
    pub motor_speed: T,
    /// Largest change of motor speed in a control period \[rev/s\].
    pub slew: T,
    /// Control period \[s\].
    pub period: T,
}

/// State of the scheduled LQR.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScheduledLqrState<T> {
    /// Riccati recursion: cost-to-go matrix and gain.
    pub regulator: Regulator<T>,
    /// Offset of the governed reference from the commanded reference \[m\].
    pub offset: T,
    /// Length of the smoothing window \[s\].
    pub window: T,
    speed_limit: SpeedLimit<T>,
    rollout: RolloutState<T>,
    /// Motor speed commanded last \[rev/s\].
    pub command: T,
}

impl<T: Copy> Memory<T> for ScheduledLqrState<T> {
    fn visited(self, visit: &mut impl FnMut(&'static str, T) -> T) -> Self {
        let Regulator { cost_to_go, gain } = self.regulator;
        Self {
            regulator: Regulator {
                cost_to_go: cost_to_go.map(|row| row.map(|v| visit("cost_to_go", v))),
                gain: gain.map(|v| visit("gain", v)),
            },
            offset: visit("governor_offset", self.offset),
            window: visit("smoothing_window", self.window),
            speed_limit: self.speed_limit.visited(visit),
            rollout: self.rollout.visited(visit),
            command: visit("command", self.command),
        }
    }
}

/// Riccati steps after which a regulator has settled: 4 s at a control period of 1 ms.
const SETTLING_STEPS: usize = 4000;

impl<T: Real> ScheduledLqrState<T> {
    /// State before the first measurement: all numbers zero, with the reference at 0 m.
    pub fn unknown() -> Self {
        let zero = T::zero();
        Self {
            regulator: Regulator { cost_to_go: [[zero; ORDER]; ORDER], gain: [zero; ORDER] },
            offset: zero,
            window: zero,
            speed_limit: SpeedLimit::at_rest(zero),
            rollout: RolloutState::start(),
            command: zero,
        }
    }
}

impl<T: Real> ScheduledLqr<T> {
    /// Initial state at a reference position \[m\], with a regulator that has converged near the present operating
    /// point.
    pub fn start(
        &self,
        regulator: Regulator<T>,
        estimator: &StateEstimator<T>,
        estimated: &StateEstimatorState<T>,
        position: T,
    ) -> ScheduledLqrState<T> {
        ScheduledLqrState {
            regulator,
            offset: T::zero(),
            window: self.settings.shortest_window + estimated.drive.ramp_delay(self.period),
            speed_limit: SpeedLimit::at_rest(position),
            rollout: RolloutState::start(),
            command: estimator.predict(estimated).motor_speed,
        }
    }

    /// Initial state where `mask` holds, at a reference position \[m\] and with the present regulator; else `state`.
    pub fn started_where(
        &self,
        mask: T::Mask,
        state: &ScheduledLqrState<T>,
        estimated: &StateEstimatorState<T>,
        position: T,
    ) -> ScheduledLqrState<T> {
        let shortest = self.settings.shortest_window + estimated.drive.ramp_delay(self.period);
        ScheduledLqrState {
            offset: T::select(mask, T::zero(), state.offset),
            window: T::select(mask, shortest, state.window),
            speed_limit: state.speed_limit.at_rest_where(mask, position),
            rollout: state.rollout.restarted_where(mask),
            ..*state
        }
    }

    /// Converts every parameter to another number type by `f`.
    pub fn map<U: Real>(&self, f: impl Fn(T) -> U + Copy) -> ScheduledLqr<U> {
        ScheduledLqr {
            model: self.model.map(f),
            settings: self.settings.map(f),
            governor: self.governor.map(f),
            rollout: self.rollout.map(f),
            motor_speed: f(self.motor_speed),
            slew: f(self.slew),
            period: f(self.period),
        }
    }

    /// Discrete linear-quadratic problem of the present operating point, sampled with the control period.
    pub fn linear_quadratic(
        &self,
        estimator: &StateEstimator<T>,
        estimated: &StateEstimatorState<T>,
    ) -> LinearQuadratic<T> {
        let now = estimator.predict(estimated);
        self.plant(estimated, &self.scheduling_point(estimated, &now))
    }

    /// Length of the smoothing window \[s\] one control period after it was `window` \[s\].
    ///
    /// It approaches, with the window's time constant, the length at which compressing the oil takes its share of the
    /// largest motor speed. That length lies between the shortest window plus the drive's lag, and the longest window.
    pub fn next_window(
        &self,
        window: T,
        estimator: &StateEstimator<T>,
        estimated: &StateEstimatorState<T>,
        preview: &Preview<T>,
    ) -> T {
        let now = estimator.predict(estimated);
        let here = self.scheduling_point(estimated, &now);
        self.window(window, estimated, &here, preview.largest_acceleration())
    }

    /// Converged regulator of the present operating point. It takes 4000 Riccati steps: too long for a control
    /// period.
    pub fn settled_regulator(
        &self,
        estimator: &StateEstimator<T>,
        estimated: &StateEstimatorState<T>,
    ) -> Regulator<T> {
        let plant = self.linear_quadratic(estimator, estimated);
        let mut regulator = Regulator::start(&plant);
        for _ in 0..SETTLING_STEPS {
            regulator.step(&plant);
        }
        regulator
    }

    /// One Riccati step at the present operating point, while another controller is active; `None` starts the
    /// recursion.
    pub fn follow_operating_point(
        &self,
        regulator: Option<Regulator<T>>,
        estimator: &StateEstimator<T>,
        estimated: &StateEstimatorState<T>,
    ) -> Regulator<T> {
        let plant = self.linear_quadratic(estimator, estimated);
        let mut regulator = regulator.unwrap_or_else(|| Regulator::start(&plant));
        regulator.step(&plant);
        regulator
    }

    /// Motor speed \[rev/s\] for the next control period, within the largest motor speed in either direction.
    ///
    /// The steps are those of the [module](self). The slew rate is left to the drive.
    pub fn update(
        &self,
        state: &mut ScheduledLqrState<T>,
        estimator: &StateEstimator<T>,
        estimated: &StateEstimatorState<T>,
        preview: &Preview<T>,
    ) -> T {
        let estimate = &estimated.filter.estimate;
        let rod_side_term = estimated.rod_side_term;
        let now = estimator.predict(estimated);
        let here = self.scheduling_point(estimated, &now);

        // the reference that the motor can follow, when the command arrives
        state.speed_limit.update(preview, self.fastest(estimated, &now));
        let limit = &state.speed_limit;
        let is_limited = limit.is_active();
        let feasible = |after: T| limit.reference(preview, is_limited, after, self.period);
        let largest_acceleration = preview.largest_acceleration();
        state.window = self.window(state.window, estimated, &here, largest_acceleration);
        let window = state.window;
        let turning = largest_acceleration * window;
        let lag = estimated.drive.ramp_delay(self.period);
        let delay = estimator.command_delay();
        let inverse = |after: T, offset: T, drift: T| {
            let mut reference = smoothed(feasible, window, after);
            reference.position = reference.position + offset;
            reference.velocity = reference.velocity + drift;
            (
                inverse_dynamics(&self.model, estimate, &reference, turning, rod_side_term),
                reference.position,
            )
        };

        // the governor's offset
        let piston = here.at.compliance.mul_add(now.load_pressure, now.position);
        let decay = self.governor.decay(here.natural_frequency);
        let reference_position = smoothed(feasible, window, delay).position;
        state.offset =
            self.governor.update(state.offset, piston - reference_position, decay, self.period);
        let drift = self.governor.drift(state.offset, decay);

        // state along the reference, and motor speed, taken ahead by the drive's lag
        let (reference_state, _) = inverse(delay, state.offset, drift);
        let (advanced, _) = inverse(delay + lag, state.offset, drift);
        let feedforward = advanced.motor_speed;

        // feedback
        let plant = self.plant(estimated, &here);
        state.regulator.step(&plant);
        let (reference_state, predicted) = (reference_state.to_array(), now.to_array());
        let error: [T; ORDER] = core::array::from_fn(|i| reference_state[i] - predicted[i]);
        let saturation = self.saturation();
        let (feedback, saturates) = saturation.feedback(&state.regulator.gain, &error);
        let law = feedforward + feedback;

        // policy improvement while feedback saturates
        let moved = self.rollout.offset.lt(state.offset.abs());
        let policy = self.policy(estimated, &state.regulator, saturation, decay);
        let ahead = |after: T| {
            let zero = T::zero();
            let (reference_state, position) = inverse(delay + after, zero, zero);
            let (advanced, _) = inverse(delay + after + lag, zero, zero);
            (reference_state, advanced.motor_speed, position)
        };
        self.rollout.update(
            &mut state.rollout,
            &policy,
            &now,
            state.offset,
            saturates | moved,
            ahead,
        );
        let command = state.rollout.command(law).clamp(-self.motor_speed, self.motor_speed);
        state.command = command;
        command
    }

    /// Plant, control law and governor for the policy improvement, with the governor's decay rate \[1/s\].
    fn policy(
        &self,
        estimated: &StateEstimatorState<T>,
        regulator: &Regulator<T>,
        saturation: NestedSaturation<T>,
        decay: T,
    ) -> Policy<T> {
        Policy {
            model: self.model,
            estimate: estimated.filter.estimate,
            rod_side_term: estimated.rod_side_term,
            drive: estimated.drive,
            period: self.period,
            limit: self.motor_speed,
            slew: self.slew,
            gain: regulator.gain,
            cost_to_go: regulator.cost_to_go,
            weights: self.weights(),
            saturation,
            governor: self.governor,
            decay,
        }
    }

    /// Coefficients of the present operating point, and the load's natural frequency at rest \[rad/s\].
    fn scheduling_point(
        &self,
        estimated: &StateEstimatorState<T>,
        now: &PredictedState<T>,
    ) -> SchedulingPoint<T> {
        let estimate = &estimated.filter.estimate;
        let at = self.model.at(now.position, estimate.payload);
        let rest = at.holding_pressure - estimate.disturbance;
        let rod_side_term = estimated.rod_side_term;
        let bulk_modulus =
            |p: T| self.model.bulk_modulus(p, estimate.transition_pressure, rod_side_term);
        let [here, bulk_modulus_at_rest] = [now.load_pressure, rest].map(bulk_modulus);
        let stiffness = |bulk_modulus: T| self.model.stiffness(&at, bulk_modulus);
        let at_rest = stiffness(bulk_modulus_at_rest);
        let natural_frequency = (at.acceleration * at_rest * self.model.piston_area).sqrt();
        SchedulingPoint {
            at,
            // geometric mean of the present bulk modulus and that at rest
            stiffness: stiffness((here * bulk_modulus_at_rest).sqrt()),
            stiffness_at_rest: at_rest,
            natural_frequency,
        }
    }

    /// The linearised plant and the regulator's weights.
    fn plant(
        &self,
        estimated: &StateEstimatorState<T>,
        here: &SchedulingPoint<T>,
    ) -> LinearQuadratic<T> {
        let (zero, one) = (T::zero(), T::one());
        let SchedulingPoint { at, stiffness, .. } = here;
        let per_lag = one / estimated.drive.ramp_delay(self.period);
        let a = [
            [zero, one, zero, zero],
            [zero, -at.acceleration * self.model.viscous, at.acceleration, zero],
            [
                zero,
                -*stiffness * self.model.piston_area,
                zero,
                *stiffness * self.model.displacement,
            ],
            [zero, zero, zero, -per_lag],
        ];
        let b = [zero, zero, zero, per_lag];
        let [by_position, by_velocity, by_speed] = self.weights();
        // of the piston, x = y + γ p
        let piston = [one, zero, at.compliance, zero];
        let mut q: Matrix<T> =
            core::array::from_fn(|i| core::array::from_fn(|j| by_position * piston[i] * piston[j]));
        q[1][1] = q[1][1] + by_velocity;
        LinearQuadratic::sampled(&a, &b, q, by_speed, self.period)
    }

    /// Weights of position error \[1/m²\], velocity error \[s²/m²\] and motor speed \[s²/rev²\] by Bryson's rule: one
    /// over the tolerance squared.
    pub fn weights(&self) -> [T; 3] {
        let s = &self.settings;
        let speed = s.command_tolerance * self.model.revolutions_per_metre();
        [s.position_tolerance, s.velocity_tolerance, speed].map(|size| T::one() / size.square())
    }

    fn saturation(&self) -> NestedSaturation<T> {
        NestedSaturation {
            position: self.settings.position_limit * self.motor_speed,
            sum: self.settings.feedback_limit * self.motor_speed,
        }
    }

    /// Largest piston speeds outwards and inwards \[m/s\] at the motor's largest speed, (D/A) (n_max ∓ (n_l(p) − r)).
    ///
    /// Leakage n_l and unknown flow r are as in the [reduced model](crate::estimation::reduced_model).
    pub fn fastest(&self, estimated: &StateEstimatorState<T>, now: &PredictedState<T>) -> [T; 2] {
        let flow = estimated.filter.estimate.unknown_flow;
        let held = self.model.leakage(now.load_pressure) - flow;
        [self.motor_speed - held, self.motor_speed + held]
            .map(|speed| speed / self.model.revolutions_per_metre())
    }

    /// Smoothing window \[s\] a period later: so long that filling the oil takes no more than its share of the motor's
    /// speed.
    fn window(
        &self,
        window: T,
        estimated: &StateEstimatorState<T>,
        here: &SchedulingPoint<T>,
        largest_acceleration: T,
    ) -> T {
        let s = &self.settings;
        // pressure by which acceleration and friction change it, and the oil that takes
        let change =
            largest_acceleration / here.at.acceleration + s.filling_friction * self.model.coulomb;
        let stiffness = here.stiffness.min(here.stiffness_at_rest);
        let turns = change / (stiffness * self.model.displacement);
        let shortest = s.shortest_window + estimated.drive.ramp_delay(self.period);
        let next_window =
            (turns / (s.filling_share * self.motor_speed)).max(shortest).min(s.longest_window);
        let share = (self.period / s.window_time_constant).min(T::one());
        share.mul_add(next_window - window, window)
    }
}

/// The present operating point.
struct SchedulingPoint<T> {
    at: OperatingPoint<T>,
    /// Pressure by oil \[Pa/m³\]: mean of now and at rest.
    stiffness: T,
    /// The same at rest.
    stiffness_at_rest: T,
    /// Natural frequency of the load at rest \[rad/s\].
    natural_frequency: T,
}
