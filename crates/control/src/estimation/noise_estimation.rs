//! Measurement noise estimated from second differences.
//!
//! White noise of variance σ² has second differences of variance 6 σ²; a smooth signal has next to none.

use hydroboom_math::{Real, record};

record! {
    /// Estimated noise of one signal.
    pub struct NoiseEstimate<T> {
        /// Variance, in the signal's unit squared
        #[unit = "1"]
        pub variance: T,
        /// The last value
        #[unit = "1"]
        pub last: T,
        /// The value before
        #[unit = "1"]
        pub before: T,
        /// Good values in succession, up to two
        #[unit = "1"]
        pub good: T,
    }
}

impl<T: Real> NoiseEstimate<T> {
    /// Of a signal that has long had a value.
    pub fn start(value: T) -> Self {
        Self { variance: T::zero(), last: value, before: value, good: T::lit(2.0) }
    }

    /// One more value, `share` \[1\] being the period over the averaging time. A value that is not valid is
    /// not used, nor are the two after it.
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
