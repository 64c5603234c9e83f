//! Innovation test: normalised innovations squared (NIS), which distinguish a load change from noise.
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
        /// Mean above which the innovations are not explained
        #[unit = "1"]
        pub inconsistent: T,
        /// Mean from which a change is certain
        #[unit = "1"]
        pub certain: T,
    }
}

impl<T: Real> InnovationTest<T> {
    /// The mean \[1\] after one more normalised innovation squared \[1\], `since` \[s\] after the last one.
    #[inline(always)]
    pub fn update(&self, mean: T, nis: T, since: T) -> T {
        let share = (since / self.time_constant).min(T::one());
        share.mul_add(nis - mean, mean)
    }

    /// Inconsistency by a mean NIS \[1\]: 0 up to the threshold, rising linearly to 1 where a change is
    /// certain.
    #[inline(always)]
    pub fn inconsistency(&self, mean: T) -> T {
        let above = (mean - self.threshold) / (self.certain - self.threshold).max(T::lit(1e-9));
        above.clamp(T::zero(), T::one())
    }

    /// Whether the innovations are explained.
    #[inline(always)]
    pub fn is_consistent(&self, mean: T) -> T::Mask {
        mean.lt(self.inconsistent)
    }
}
