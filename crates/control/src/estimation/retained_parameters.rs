//! Estimated machine parameters that are retained from one run to the next, with their covariance.
//!
//! The oil's transition pressure, the unknown flow (leakage, and the pump's displacement beside the crane file's) and
//! the drive's lag are properties of machine and oil. Payload, unknown force and friction of the moment begin anew:
//! their spread is that of any start.

use super::error_covariance::Covariance;
use super::reduced_model::state_index::{TRANSITION_PRESSURE as TRANSITION, UNKNOWN_FLOW as FLOW};
use super::state_estimator::{StateEstimator, StateEstimatorState};
use hydroboom_math::{Real, record};

record! {
    /// Estimated parameters of oil, pump and drive, with their error covariance, stored from one run to the next.
    pub struct RetainedParameters<T> {
        /// Unknown flow, as a motor speed
        #[unit = "rev/s"]
        pub unknown_flow: T,
        /// Transition pressure of the oil, p_c1
        #[unit = "Pa"]
        pub transition_pressure: T,
        /// Variance of the unknown flow
        #[unit = "rev2/s2"]
        pub flow_variance: T,
        /// Covariance of unknown flow and transition pressure
        #[unit = "Pa rev/s"]
        pub flow_transition_covariance: T,
        /// Variance of the transition pressure
        #[unit = "Pa2"]
        pub transition_variance: T,
        /// Lag coefficient g of the drive
        #[unit = "1"]
        pub drive_coefficient: T,
        /// Variance of the lag coefficient g
        #[unit = "1"]
        pub drive_variance: T,
    }
}

impl<T: Real> RetainedParameters<T> {
    /// Retained parameters of an estimator's state.
    pub fn of(state: &StateEstimatorState<T>) -> Self {
        let filter = &state.filter;
        Self {
            unknown_flow: filter.estimate.unknown_flow,
            transition_pressure: filter.estimate.transition_pressure,
            flow_variance: filter.errors[FLOW][FLOW],
            flow_transition_covariance: filter.errors[FLOW][TRANSITION],
            transition_variance: filter.errors[TRANSITION][TRANSITION],
            drive_coefficient: state.drive.coefficient,
            drive_variance: state.drive.variance,
        }
    }
}

/// Covariances of unknown flow and transition pressure with all other errors, zero where `clears` holds.
fn clear_shared<T: Real, const N: usize>(p: &mut Covariance<T, N>, clears: T::Mask) {
    for i in [FLOW, TRANSITION] {
        for j in (0..N).filter(|j| ![FLOW, TRANSITION].contains(j)) {
            p[i][j] = T::select(clears, T::zero(), p[i][j]);
            p[j][i] = T::select(clears, T::zero(), p[j][i]);
        }
    }
}

impl<T: Real> StateEstimator<T> {
    /// Restores retained parameters where `mask` holds and all of them are finite, clamped to the ranges of the
    /// estimator. The filter's covariance of these parameters is set to their error covariance.
    pub fn restore(
        &self,
        state: &mut StateEstimatorState<T>,
        retained: &RetainedParameters<T>,
        mask: T::Mask,
    ) {
        let all = retained.to_array().into_iter();
        let is_number = all.fold(T::zero(), |sum, number| sum + number.abs()).is_finite();
        let restores = mask & is_number;
        let take = |kept: &mut T, given: T| *kept = T::select(restores, given, *kept);
        let (low, high) = (&self.filter.lowest, &self.filter.highest);
        let estimate = &mut state.filter.estimate;
        let r = retained;
        take(&mut estimate.unknown_flow, r.unknown_flow.clamp(low.unknown_flow, high.unknown_flow));
        take(
            &mut estimate.transition_pressure,
            r.transition_pressure.clamp(low.transition_pressure, high.transition_pressure),
        );
        // no covariance without variances
        let zero = T::zero();
        let (flow, transition) = (r.flow_variance.max(zero), r.transition_variance.max(zero));
        let most = (flow * transition).sqrt();
        let both = r.flow_transition_covariance.clamp(-most, most);
        let block = [
            (FLOW, FLOW, flow),
            (FLOW, TRANSITION, both),
            (TRANSITION, FLOW, both),
            (TRANSITION, TRANSITION, transition),
        ];
        // the correlation of the new errors with the others is unknown
        clear_shared(&mut state.filter.covariance, restores);
        clear_shared(&mut state.filter.errors, restores);
        for (i, j, value) in block {
            take(&mut state.filter.covariance[i][j], value);
            take(&mut state.filter.errors[i][j], value);
        }
        let drive = &self.drive;
        let most = drive.largest_deviation.square();
        let coefficient = r.drive_coefficient.clamp(drive.smallest, drive.largest);
        take(&mut state.drive.coefficient, coefficient);
        take(&mut state.drive.variance, r.drive_variance.max(zero).min(most));
    }
}
