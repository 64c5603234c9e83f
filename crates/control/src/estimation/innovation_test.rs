//! Innovation test: normalised innovations squared (NIS), which distinguish a load change from noise.
//!
//! Source: Y. Bar-Shalom, X. Li, T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001,
//! sections 5.4 and 11.6.

use hydroboom_math::{Real, record};

record! {
    /// Settings of the innovation test.
    pub struct InnovationTest<T> {
        /// Time constant of the low-pass filter of the normalised innovations squared
        #[unit = "s"]
        pub time_constant: T,
        /// Mean NIS above which a load change is suspected; about 1 without change
        #[unit = "1"]
        pub threshold: T,
        /// Mean NIS above which the innovations count as inconsistent with the model
        #[unit = "1"]
        pub inconsistent: T,
        /// Mean NIS from which a load change is certain
        #[unit = "1"]
        pub certain: T,
    }
}

impl<T: Real> InnovationTest<T> {
    /// Mean NIS \[1\] after another normalised innovation squared `nis` \[1\], `since` \[s\] after the last one.
    ///
    /// The filter is of first order: `mean + (since/τ) (nis − mean)`, with a factor `since/τ` of at most 1.
    #[inline(always)]
    pub fn update(&self, mean: T, nis: T, since: T) -> T {
        let share = (since / self.time_constant).min(T::one());
        share.mul_add(nis - mean, mean)
    }

    /// Degree of a load change by the mean NIS \[1\]: 0 up to the threshold, rising linearly to 1 where a change is
    /// certain. NaN for a NaN mean.
    #[inline(always)]
    pub fn inconsistency(&self, mean: T) -> T {
        let above = (mean - self.threshold) / (self.certain - self.threshold).max(T::lit(1e-9));
        above.clamp(T::zero(), T::one())
    }

    /// Whether a mean NIS \[1\] is consistent with the model: below [`inconsistent`](Self::inconsistent). A NaN mean
    /// is not.
    #[inline(always)]
    pub fn is_consistent(&self, mean: T) -> T::Mask {
        mean.lt(self.inconsistent)
    }
}
