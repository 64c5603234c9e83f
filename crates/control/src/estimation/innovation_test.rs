//! Innovation test: normalised innovations squared (NIS), which tell a load that has changed from noise.
//!
//! Source: Y. Bar-Shalom, X. Li, T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001, sections 5.4 and 11.6.

use hydroboom_math::{Real, record};

record! {
    /// Settings of the innovation test.
    pub struct InnovationTest<T> {
        /// Time constant of the mean of normalised innovations squared
        #[unit = "s"]
        pub time_constant: T,
        /// Mean above which a load has changed; without change it is about 1
        #[unit = "1"]
        pub threshold: T,
        /// Standard deviation of the process noise of force and payload at five times the threshold, over that without change
        #[unit = "1"]
        pub noise_factor: T,
    }
}

impl<T: Real> InnovationTest<T> {
    /// The mean \[1\] after one more normalised innovation squared \[1\], of which there are so many \[1/s\].
    #[inline(always)]
    pub fn update(&self, mean: T, nis: T, period: T) -> T {
        let share = (period / self.time_constant).min(T::one());
        share.mul_add(nis - mean, mean)
    }

    /// Factor \[1\] on the process noise of force and payload: 1 below the threshold, rising linearly to the largest at five times the threshold.
    #[inline(always)]
    pub fn factor(&self, mean: T) -> T {
        let above = T::lit(0.25) * (mean / self.threshold - T::one());
        self.noise_factor.mul_add(above.clamp(T::zero(), T::one()), T::one())
    }

    /// Whether the innovations are explained: the mean is below twice the threshold.
    #[inline(always)]
    pub fn is_consistent(&self, mean: T) -> T::Mask {
        mean.lt(self.threshold + self.threshold)
    }
}
