//! Elastic base frame: a column that turns under the force at the cylinder's foot (equation ours; the paper's base is
//! rigid).

use hydroboom_math::{Real, record};

record! {
    /// A frame that turns elastically about the boom's bearing and carries the cylinder's foot.
    ///
    /// One coordinate ψ \[rad\], counter-clockwise, beside the segments' angles:
    ///
    /// ```text
    /// J ψ'' = F_cyl ∂x/∂ψ − k s(ψ) − b ψ'
    /// s(ψ) = 0 for |ψ| < δ, ψ ∓ δ beyond
    /// ```
    ///
    /// The bearing stays where it is. The slack ±δ stands for the play of bearings and pins; while
    /// the load rests on the cylinder it is taken up on one side.
    pub struct BaseFrame<T> {
        /// Moment of inertia about the bearing, J
        #[unit = "kg·m²"]
        pub inertia: T,
        /// Rotational stiffness about the bearing, k
        #[unit = "N·m/rad"]
        pub stiffness: T,
        /// Rotational damping about the bearing, b
        #[unit = "N·m·s/rad"]
        pub damping: T,
        /// Angle of play to either side, without stiffness, δ
        #[unit = "rad"]
        pub slack: T,
    }
}

impl<T: Real> BaseFrame<T> {
    /// Deflection beyond the slack \[rad\], s.
    #[inline(always)]
    fn deflection(&self, angle: T) -> T {
        let beyond = angle - T::select(angle.lt(T::zero()), -self.slack, self.slack);
        T::select(angle.abs().lt(self.slack), T::zero(), beyond)
    }

    /// Moment \[N·m\] that turns the frame back.
    #[inline(always)]
    pub(super) fn moment(&self, angle: T, angular_velocity: T) -> T {
        -(self.stiffness * self.deflection(angle) + self.damping * angular_velocity)
    }

    /// Energy stored in the bent frame \[J\].
    pub(super) fn elastic_energy(&self, angle: T) -> T {
        T::lit(0.5) * self.stiffness * self.deflection(angle).square()
    }
}
