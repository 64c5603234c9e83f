//! Reference governor: where the tracking error exceeds what is left to feedback, the reference is offset so that the
//! error equals it; the offset decays at a limited rate.
//!
//! It conditions the reference by the error alone and predicts no constraint, the simplest member of its family.
//!
//! Sources: R. Hanus, M. Kinnaert, J.-L. Henrotte, *Conditioning technique, a general anti-windup and bumpless
//! transfer method*, 1987; E. Garone, S. Di Cairano, I. Kolmanovsky, *Reference and command governors for systems with
//! constraints: A survey*, 2017.

use hydroboom_math::{Real, record};

record! {
    /// Settings of the reference governor.
    pub struct ReferenceGovernor<T> {
        /// Largest tracking error for the feedback; a larger one offsets the reference
        #[unit = "m"]
        pub largest_error: T,
        /// Largest decay rate of the offset
        #[unit = "1/s"]
        pub rate: T,
        /// Largest decay rate of the offset, relative to the load's natural angular frequency
        #[unit = "1"]
        pub rate_by_frequency: T,
        /// Largest velocity of the decaying offset
        #[unit = "m/s"]
        pub velocity: T,
    }
}

impl<T: Real> ReferenceGovernor<T> {
    /// Decay rate of the offset \[1/s\] for a natural angular frequency ω of the load \[rad/s\]: the smaller of
    /// `rate` and `rate_by_frequency · ω`.
    #[inline(always)]
    pub fn decay(&self, natural_frequency: T) -> T {
        self.rate.min(self.rate_by_frequency * natural_frequency)
    }

    /// Offset \[m\] one control period later. `error` \[m\] is piston position minus reference without offset,
    /// `decay` \[1/s\] the decay rate, `period` the control period \[s\].
    ///
    /// The offset first decays by its [`drift`](Self::drift), then takes up what the remaining error exceeds
    /// `largest_error` by.
    #[inline(always)]
    pub fn update(&self, offset: T, error: T, decay: T, period: T) -> T {
        let returned = self.drift(offset, decay).mul_add(period, offset);
        let left = error - returned;
        let kept = left.clamp(-self.largest_error, self.largest_error);
        returned + left - kept
    }

    /// Velocity \[m/s\] of a decaying offset \[m\] at a decay rate \[1/s\]: `−decay · offset`, clamped to ±
    /// `velocity`.
    #[inline(always)]
    pub fn drift(&self, offset: T, decay: T) -> T {
        (-decay * offset).clamp(-self.velocity, self.velocity)
    }
}
