//! Measurement noise estimated from second differences.
//!
//! White noise of variance σ² has second differences of variance 6 σ²; a smooth signal has next to none.

use hydroboom_math::{Real, record};

record! {
    /// Running estimate of the measurement noise of one signal.
    pub struct NoiseEstimate<T> {
        /// Variance of the noise, in the signal's unit squared
        #[unit = "1"]
        pub variance: T,
        /// Last value of the signal
        #[unit = "1"]
        pub last: T,
        /// Value of the signal before the last
        #[unit = "1"]
        pub before: T,
        /// Number of consecutive valid values, up to 2
        #[unit = "1"]
        pub good: T,
    }
}

impl<T: Real> NoiseEstimate<T> {
    /// Initial estimate of a signal that has been constant at `value`: zero variance.
    pub fn start(value: T) -> Self {
        Self { variance: T::zero(), last: value, before: value, good: T::lit(2.0) }
    }

    /// Updates the estimate by a value y of the signal: `σ² ← σ² + share ((y − 2 y_1 + y_2)²/6 − σ²)`.
    ///
    /// y_1 and y_2 are the two values before. `share` \[1\] is the control period over the averaging time. An invalid
    /// value has no effect on the variance, and neither have the two values after it.
    #[inline(always)]
    pub fn update(&mut self, value: T, is_good: T::Mask, share: T) {
        let difference = value - self.last - (self.last - self.before);
        let sample = difference.square() / T::lit(6.0);
        let counts = is_good & T::lit(1.5).lt(self.good);
        let variance = share.mul_add(sample - self.variance, self.variance);
        self.variance = T::select(counts, variance, self.variance);
        let more = (self.good + T::one()).min(T::lit(2.0));
        self.good = T::select(is_good, more, T::zero());
        (self.before, self.last) = (self.last, value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Alternating values ±a have second differences of ±4 a: 16/6 a², as white noise of that variance would.
    #[test]
    fn a_ramp_has_no_noise_and_an_alternating_signal_has() {
        let mut ramp = NoiseEstimate::start(0.0);
        let mut alternating = NoiseEstimate::start(0.5);
        for k in 0..20_000 {
            ramp.update(2.0 + 1e-3 * f64::from(k), k % 100 > 9, 1e-3);
            alternating.update(if k % 2 == 0 { -0.5 } else { 0.5 }, true, 1e-3);
        }
        assert!(ramp.variance < 1e-8, "{ramp:?}");
        assert!((alternating.variance - 4.0 / 6.0).abs() < 1e-6, "{alternating:?}");
    }
}
