//! Scheduled LQR with its state estimator within the frame: what is exported to run without the supervisor.
//!
//! While the load is held the estimator weighs it and keeps what it knows of oil and drive; the regulator follows the
//! operating point. Both have settled when the controller begins. Estimates that are not finite, or contradict the
//! measurements for too long, give no command: the frame then holds the load, and the estimator begins anew.

use crate::estimation::extended_kalman_filter::EstimatorInput;
use crate::estimation::retained_parameters::RetainedParameters;
use crate::estimation::state_estimator::{StateEstimator, StateEstimatorState};
use crate::feedback::scheduled_lqr::{ScheduledLqr, ScheduledLqrState};
use crate::memory::Memory;
use crate::reference::preview::{Preview, PreviewAhead, PreviewBehind};
use crate::supervision::frame::{
    Directive, Frame, FrameInput, FrameOutput, FrameState, NO_COMMAND,
};
use hydroboom_math::{Real, record};

/// Share of the command tolerance, and so about of the gain, that is left once the loop was found in sustained
/// oscillation.
const FALLBACK_SHARE: f64 = 0.3;

record! {
    /// Requests to the state estimator in a control period.
    pub struct EstimatorRequest<T> {
        /// 1: the estimator restarts, while the load is held
        #[unit = "0/1"]
        pub reset_estimator: T,
        /// 1: oil parameters, unknown flow and drive lag are not estimated
        #[unit = "0/1"]
        pub freeze_parameters: T,
        /// 1: the given retained parameters are restored, while the load is held
        #[unit = "0/1"]
        pub restore_parameters: T,
    }
}

record! {
    /// Outputs of the state estimator in a control period.
    pub struct EstimatorOutput<T> {
        /// Mass of the payload
        #[unit = "kg"]
        pub payload: T,
        /// Standard deviation of the payload
        #[unit = "kg"]
        pub payload_deviation: T,
        /// Unknown force over the piston's area
        #[unit = "Pa"]
        pub disturbance: T,
        /// 1 where the estimates are finite and consistent with the measurements
        #[unit = "0/1"]
        pub estimator_is_valid: T,
    }
}

/// Inputs of the scheduled LQR within the frame in a control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FramedScheduledLqrInput<T> {
    /// Inputs of the frame.
    pub frame: FrameInput<T>,
    /// Requests to the state estimator.
    pub request: EstimatorRequest<T>,
    /// Retained parameters, for a request to restore them.
    pub retained: RetainedParameters<T>,
    /// Future set points of the reference.
    pub ahead: PreviewAhead<T>,
}

/// Outputs of the scheduled LQR within the frame in a control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FramedScheduledLqrOutput<T> {
    /// Outputs of the frame.
    pub frame: FrameOutput<T>,
    /// Outputs of the state estimator.
    pub estimator: EstimatorOutput<T>,
    /// Estimated parameters to be retained for the next run.
    pub retained: RetainedParameters<T>,
}

/// Scheduled LQR and state estimator within the frame. Its state is a [`FramedScheduledLqrState`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FramedScheduledLqr<T> {
    /// Frame.
    pub frame: Frame<T>,
    /// State estimator.
    pub estimator: StateEstimator<T>,
    /// Control law.
    pub law: ScheduledLqr<T>,
    /// Rod-side area over piston area, A_r/A_p \[1\].
    pub area_ratio: T,
}

/// State of estimator, control law and past reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LqrMemory<T> {
    /// 1 once the estimator has begun.
    has_begun: T,
    estimated: StateEstimatorState<T>,
    law: ScheduledLqrState<T>,
    behind: PreviewBehind<T>,
}

/// State of the scheduled LQR and of the frame around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FramedScheduledLqrState<T> {
    /// State of the frame.
    pub frame: FrameState<T>,
    /// State of estimator and control law.
    pub controller: LqrMemory<T>,
}

impl<T: Copy> Memory<T> for LqrMemory<T> {
    fn visited(self, visit: &mut impl FnMut(&'static str, T) -> T) -> Self {
        Self {
            has_begun: visit("has_begun", self.has_begun),
            estimated: self.estimated.visited(visit),
            law: self.law.visited(visit),
            behind: self.behind.visited(visit),
        }
    }
}

impl FramedScheduledLqr<f64> {
    /// Converts every setting to another number type.
    pub fn over<T: Real>(&self) -> FramedScheduledLqr<T> {
        FramedScheduledLqr {
            frame: self.frame.over(),
            estimator: self.estimator.map(T::lit),
            law: self.law.map(T::lit),
            area_ratio: T::lit(self.area_ratio),
        }
    }
}

impl<T: Real> FramedScheduledLqr<T> {
    /// State before the first measurement: every number is zero.
    pub fn start(&self) -> LqrMemory<T> {
        let zero = T::zero();
        let nothing = EstimatorInput::from_array([zero; EstimatorInput::NAMES.len()]);
        let begun = LqrMemory {
            has_begun: zero,
            estimated: self.estimator.start(&nothing),
            law: ScheduledLqrState::unknown(),
            behind: PreviewBehind::at_rest(zero),
        };
        begun.visited(&mut |_, _| zero)
    }

    /// One control period: next state and outputs.
    #[inline(always)]
    pub fn advance(
        &self,
        before: &FramedScheduledLqrState<T>,
        input: &FramedScheduledLqrInput<T>,
    ) -> (FramedScheduledLqrState<T>, FramedScheduledLqrOutput<T>) {
        let (zero, one) = (T::zero(), T::one());
        let mut controller = before.controller;
        let has_begun = T::lit(0.5).lt(controller.has_begun);
        let ready = has_begun & self.is_valid(&controller.estimated);
        let (frame, output) = self.frame.advance(&before.frame, &input.frame, ready, |now| {
            controller.estimated = self.estimated(&before.controller, now, input);
            controller.has_begun = one;
            self.command(&mut controller, now, &input.ahead)
        });
        let estimated = &controller.estimated;
        let is_valid = T::select(self.is_valid(estimated), one, zero);
        let filter = &estimated.filter;
        let output = FramedScheduledLqrOutput {
            frame: output,
            estimator: EstimatorOutput {
                payload: filter.estimate.payload,
                payload_deviation: self.estimator.filter.payload_deviation(filter),
                disturbance: filter.estimate.disturbance,
                estimator_is_valid: is_valid,
            },
            retained: RetainedParameters::of(estimated),
        };
        (FramedScheduledLqrState { frame, controller }, output)
    }

    /// Whether the estimates are finite and agree with the measurements.
    fn is_valid(&self, estimated: &StateEstimatorState<T>) -> T::Mask {
        let filter = &estimated.filter;
        let all = filter.estimate.to_array().into_iter();
        let sum = all.chain(filter.covariance.into_iter().flatten());
        let sum = sum.chain(filter.errors.into_iter().flatten());
        let sum = sum.chain([estimated.drive.coefficient, estimated.drive.variance]);
        let sum = sum.fold(T::zero(), |sum, number| sum + number.abs());
        sum.is_finite() & !self.estimator.filter.has_diverged(filter)
    }

    /// The estimator after a control period: on with the measurement while the controller has the load, else held.
    fn estimated(
        &self,
        before: &LqrMemory<T>,
        now: &Directive<T>,
        input: &FramedScheduledLqrInput<T>,
    ) -> StateEstimatorState<T> {
        let (zero, one, half) = (T::zero(), T::one(), T::lit(0.5));
        let truth = |mask| T::select(mask, one, zero);
        let beyond = self.area_ratio * now.pressure_b;
        let measured = EstimatorInput {
            position: now.stroke,
            position_is_good: truth(now.position_is_good),
            load_pressure: now.pressure_a - beyond,
            load_pressure_is_good: truth(now.pressure_is_good),
            rod_side_term: beyond,
            motor_speed: now.motor_speed_read,
        };
        let was = &before.estimated;
        let mut updated = *was;
        let is_frozen = half.lt(input.request.freeze_parameters);
        self.estimator.update_frozen(&mut updated, &measured, now.motor_speed, is_frozen);

        let mut held = *was;
        self.estimator.hold(&mut held, &measured);
        let resets = half.lt(input.request.reset_estimator) | before.has_begun.lt(half);
        let anew = self.estimator.start(&measured);
        let begins_anew = resets | !self.is_valid(was);
        let mut held = StateEstimatorState::select(begins_anew, &anew, &held);
        let restores = half.lt(input.request.restore_parameters);
        self.estimator.restore(&mut held, &input.retained, restores);
        StateEstimatorState::select(now.controls, &updated, &held)
    }

    /// Motor speed \[rev/s\] of the law; none where the estimates are not valid.
    fn command(
        &self,
        controller: &mut LqrMemory<T>,
        now: &Directive<T>,
        ahead: &PreviewAhead<T>,
    ) -> T {
        let zero = T::zero();
        let LqrMemory { estimated, law: state, behind, .. } = controller;
        let begins = !now.controls | now.begins;
        // the Riccati recursion restarts where it is not finite
        let regulator = &mut state.regulator;
        let numbers = regulator.cost_to_go.iter().flatten().chain(&regulator.gain);
        let is_number = numbers.fold(zero, |sum, number| sum + number.abs()).is_finite();
        let kept = |number: T| T::select(is_number, number, zero);
        regulator.cost_to_go = regulator.cost_to_go.map(|row| row.map(kept));
        regulator.gain = regulator.gain.map(kept);

        let position = now.reference.position;
        *behind = behind.at_rest_where(begins, position);
        let preview = Preview::known(self.law.period, behind, now.reference, ahead, now.offset);
        *state = self.law.started_where(begins, state, estimated, position);
        let mut law = self.law;
        let weaker = T::lit(FALLBACK_SHARE) * law.settings.command_tolerance;
        let tolerance = &mut law.settings.command_tolerance;
        *tolerance = T::select(now.falls_back, weaker, *tolerance);
        let command = law.update(state, &self.estimator, estimated, &preview);
        behind.advance(now.reference);
        T::select(self.is_valid(estimated), command, T::lit(NO_COMMAND))
    }
}
