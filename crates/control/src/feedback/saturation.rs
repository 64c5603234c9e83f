//! Nested saturation of state feedback.
//!
//! The position's share is limited first, and then the sum: position feedback cannot take the authority of the terms
//! that damp. There is no integrator in the law.
//!
//! Source: A. Teel, *Global stabilization and restricted tracking for multiple integrators with bounded controls*,
//! 1992.

use super::riccati::{ORDER, dot};
use hydroboom_math::{Real, record};

record! {
    /// Nested saturation limits of state feedback, as motor speeds.
    pub struct NestedSaturation<T> {
        /// Limit of the position feedback
        #[unit = "rev/s"]
        pub position: T,
        /// Limit of the whole feedback
        #[unit = "rev/s"]
        pub sum: T,
    }
}

impl<T: Real> NestedSaturation<T> {
    /// Position error \[m\] beyond which position feedback is limited: the position limit over the position gain. A
    /// gain below 1 rev/(s m) counts as 1 rev/(s m).
    #[inline(always)]
    pub fn largest_error(&self, gain: &[T; ORDER]) -> T {
        // a gain near zero limits nothing
        self.position / gain[0].max(T::lit(1.0))
    }

    /// Saturated feedback K e \[rev/s\] and whether a limit was reached. `error` is that of load position \[m\], load
    /// velocity \[m/s\], load pressure \[Pa\] and motor speed \[rev/s\].
    #[inline(always)]
    pub fn feedback(&self, gain: &[T; ORDER], error: &[T; ORDER]) -> (T, T::Mask) {
        let largest = self.largest_error(gain);
        let mut limited = *error;
        limited[0] = error[0].clamp(-largest, largest);
        let sum = dot(gain, &limited);
        let saturates = largest.lt(error[0].abs()) | self.sum.lt(dot(gain, error).abs());
        (sum.clamp(-self.sum, self.sum), saturates)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GAIN: [f64; ORDER] = [8000.0, 400.0, 1e-5, 0.2];
    const LIMITS: NestedSaturation<f64> = NestedSaturation { position: 10.0, sum: 20.0 };

    #[test]
    fn feedback_is_linear_within_the_limits() {
        let error = [1e-3, 0.005, 1e5, 1.0];
        let (feedback, saturates) = LIMITS.feedback(&GAIN, &error);
        assert!((feedback - dot(&GAIN, &error)).abs() < 1e-12 && !saturates, "{feedback}");
    }

    /// At any position error a velocity error still changes the command, so that damping remains.
    #[test]
    fn a_large_position_error_leaves_the_velocity_feedback() {
        let far = |velocity: f64| LIMITS.feedback(&GAIN, &[0.5, velocity, 0.0, 0.0]).0;
        assert_eq!(far(0.0), 10.0);
        assert!((far(-0.02) - 2.0).abs() < 1e-12);
        assert!(LIMITS.feedback(&GAIN, &[0.5, 0.0, 0.0, 0.0]).1);
        assert_eq!(far(1.0), 20.0);
    }
}
