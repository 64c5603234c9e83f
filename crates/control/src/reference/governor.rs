//! Reference governor: where the tracking error exceeds the range of feedback, the reference is offset so
//! that the error equals it; the offset decays at a limited rate.
//!
//! It conditions the reference by the error alone and predicts no constraint, the simplest member of its family.
//!
//! Sources: R. Hanus, M. Kinnaert, J.-L. Henrotte, *Conditioning technique, a general anti-windup and bumpless transfer method*, 1987; E. Garone, S. Di Cairano, I. Kolmanovsky, *Reference and command governors for systems with constraints: A survey*, 2017.

use hydroboom_math::{Real, record};

record! {
    /// Settings of the governor.
    pub struct ReferenceGovernor<T> {
        /// Largest tracking error that is left to feedback
        #[unit = "m"]
        pub largest_error: T,
        /// Largest rate at which the offset decays
        #[unit = "1/s"]
        pub rate: T,
        /// The same as a share of the load's natural frequency
        #[unit = "1"]
        pub rate_by_frequency: T,
        /// Largest velocity at which the offset decays
        #[unit = "m/s"]
        pub velocity: T,
    }
}

impl<T: Real> ReferenceGovernor<T> {
    /// Rate \[1/s\] at which the offset decays where the load oscillates at a natural frequency \[rad/s\].
    #[inline(always)]
    pub fn decay(&self, natural_frequency: T) -> T {
        self.rate.min(self.rate_by_frequency * natural_frequency)
    }

    /// The offset \[m\] a period later, for a piston that is `error` \[m\] beyond the reference without offset.
    #[inline(always)]
    pub fn update(&self, offset: T, error: T, decay: T, period: T) -> T {
        let returned = self.drift(offset, decay).mul_add(period, offset);
        let left = error - returned;
        let kept = left.clamp(-self.largest_error, self.largest_error);
        returned + left - kept
    }

    /// Velocity \[m/s\] of an offset that decays.
    #[inline(always)]
    pub fn drift(&self, offset: T, decay: T) -> T {
        (-decay * offset).clamp(-self.velocity, self.velocity)
    }
}
