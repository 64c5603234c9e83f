//! Nested saturation of state feedback.
//!
//! The position's share is limited first, and then the sum: what damps is not drowned by a large position error. There is no integrator, so nothing winds up.
//!
//! Source: A. Teel, *Global stabilization and restricted tracking for multiple integrators with bounded controls*, 1992.

use super::riccati::{ORDER, dot};
use hydroboom_math::{Real, record};

record! {
    /// Limits of state feedback.
    pub struct NestedSaturation<T> {
        /// Of the position's share
        #[unit = "rev/s"]
        pub position: T,
        /// Of the sum
        #[unit = "rev/s"]
        pub sum: T,
    }
}

impl<T: Real> NestedSaturation<T> {
    /// Position error \[m\] beyond which position feedback is limited.
    #[inline(always)]
    pub fn largest_error(&self, gain: &[T; ORDER]) -> T {
        // a gain of next to nothing limits nothing
        self.position / gain[0].max(T::lit(1.0))
    }

    /// Feedback \[rev/s\] of an error, position first, and whether a limit was met.
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
