//! Parameters that a state estimator keeps from one start to the next, with their covariance: what the machine is, not what it does.
//!
//! The oil's transition pressure, the unknown flow (leakage, and the pump's displacement beside the crane file's) and the drive's lag are properties of machine and oil.
//! Payload, unknown force and friction of the moment begin anew: their spread is that of any start.

use super::drive_identification::DriveLag;
use super::error_covariance::Covariance;
use super::state_estimator::StateEstimatorState;
use hydroboom_math::Real;

/// Places of unknown flow and transition pressure in a state.
const RETAINED: [usize; 2] = [5, 7];

/// The parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RetainedParameters<T> {
    /// Unknown flow, as a motor speed \[rev/s\].
    pub unknown_flow: T,
    /// Transition pressure of the oil \[Pa\].
    pub transition_pressure: T,
    /// Covariance of the errors of both.
    pub covariance: Covariance<T, 2>,
    /// The drive.
    pub drive: DriveLag<T>,
}

impl<T: Real> RetainedParameters<T> {
    /// Those of an estimator's state.
    pub fn of(state: &StateEstimatorState<T>) -> Self {
        let filter = &state.filter;
        Self {
            unknown_flow: filter.estimate.unknown_flow,
            transition_pressure: filter.estimate.transition_pressure,
            covariance: RETAINED.map(|i| RETAINED.map(|j| filter.errors[i][j])),
            drive: state.drive,
        }
    }

    /// Puts them in the place of those that an estimator has started with. The filter's own covariance, which gives its gain, is that of the errors too.
    pub fn put_into(&self, state: &mut StateEstimatorState<T>) {
        let filter = &mut state.filter;
        filter.estimate.unknown_flow = self.unknown_flow;
        filter.estimate.transition_pressure = self.transition_pressure;
        for (row, &i) in self.covariance.iter().zip(&RETAINED) {
            for (value, &j) in row.iter().zip(&RETAINED) {
                filter.covariance[i][j] = *value;
                filter.errors[i][j] = *value;
            }
        }
        state.drive = self.drive;
    }
}
