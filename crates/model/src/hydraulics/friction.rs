//! Friction between piston, rod and seals: Stribeck and LuGre laws. A new law is a record with `evaluate`, and a line
//! in [`Friction`].

use hydroboom_math::{Real, record};

/// Friction law: force as a function of piston velocity \[m/s\] and bristle deflection \[m\].
pub trait FrictionLaw<T: Real> {
    /// Force \[N\] that opposes the velocity, and the rate \[m/s\] of the bristle deflection (zero
    /// for laws without memory).
    fn evaluate(&self, velocity: T, bristle: T) -> (T, T);

    /// Elastic energy \[J\] stored in the bristles at a deflection \[m\].
    fn energy(&self, bristle: T) -> T;

    /// Power \[W\] that goes into the bristles when they deflect at `rate` \[m/s\].
    fn stored_power(&self, bristle: T, rate: T) -> T;

    /// Friction force \[N\] at rest, at most `force`, and the bristle deflection \[m\] with that force. Both are zero
    /// for laws without memory.
    fn at_rest(&self, force: T) -> (T, T);

    /// Largest stiffness \[N/m\] and damping \[N·s/m\] of the contact, which occur near rest.
    fn steepest(&self) -> (T, T);

    /// Rate \[1/s\] at which the bristle deflection settles while the piston slides at a velocity \[m/s\]; zero
    /// for laws without memory.
    fn bristle_rate(&self, velocity: T) -> T;
}

record! {
    /// Viscous, Coulomb, and a static share that fades with speed. Smooth, hence zero at rest.
    ///
    /// ```text
    /// F = F_v v + tanh(a v) (F_C + F_S exp(−v tanh(a v)/v_S))                           (10)
    /// ```
    ///
    /// Source: doi:10.3390/act14020080, section 3.1.3.
    pub struct Stribeck<T> {
        /// Viscous friction coefficient, F_v
        #[unit = "N·s/m"]
        pub viscous: T,
        /// Coulomb friction force, F_C
        #[unit = "N"]
        pub coulomb: T,
        /// Static friction force in excess of the Coulomb force, F_S
        #[unit = "N"]
        pub stiction: T,
        /// Reciprocal of the speed over which the static share fades, 1/v_S (the paper's k_S)
        #[unit = "s/m"]
        pub stribeck_slope: T,
        /// Steepness of the change of sign at rest, a
        #[unit = "s/m"]
        pub steepness: T,
    }
}

impl<T: Real> FrictionLaw<T> for Stribeck<T> {
    #[inline(always)]
    fn evaluate(&self, v: T, _bristle: T) -> (T, T) {
        let sign = (self.steepness * v).tanh();
        // everything that need not wait for the exponential is done before it
        let fade = (sign * -(v * self.stribeck_slope)).exp();
        let force =
            (sign * self.stiction).mul_add(fade, sign.mul_add(self.coulomb, self.viscous * v));
        (force, T::zero())
    }

    fn energy(&self, _bristle: T) -> T {
        T::zero()
    }

    fn stored_power(&self, _bristle: T, _rate: T) -> T {
        T::zero()
    }

    fn at_rest(&self, _force: T) -> (T, T) {
        (T::zero(), T::zero())
    }

    fn steepest(&self) -> (T, T) {
        (T::zero(), self.viscous + self.steepness * (self.coulomb + self.stiction))
    }

    fn bristle_rate(&self, _velocity: T) -> T {
        T::zero()
    }
}

record! {
    /// LuGre: seals as elastic bristles that hold up to the breakaway force, then slide.
    ///
    /// ```text
    /// ż = v − σ_0 |v| z/g(v),   g(v) = F_C + F_S exp(−(v/v_S)²)
    /// F = σ_0 z + σ_1 ż + F_v v
    /// ```
    ///
    /// Not zero at rest: the bristles keep the force they were left with.
    /// Source: Canudas de Wit et al. 1995, doi:10.1109/9.376053.
    pub struct LuGre<T> {
        /// Viscous friction coefficient, F_v
        #[unit = "N·s/m"]
        pub viscous: T,
        /// Coulomb friction force, F_C
        #[unit = "N"]
        pub coulomb: T,
        /// Static friction force in excess of the Coulomb force, F_S
        #[unit = "N"]
        pub stiction: T,
        /// Reciprocal of the speed over which the static share fades, 1/v_S
        #[unit = "s/m"]
        pub stribeck_slope: T,
        /// Stiffness of the bristles, σ_0
        #[unit = "N/m"]
        pub bristle_stiffness: T,
        /// Damping of the bristles, σ_1
        #[unit = "N·s/m"]
        pub bristle_damping: T,
    }
}

impl<T: Real> LuGre<T> {
    /// Force \[N\] at which bristles slide at a velocity \[m/s\], g(v).
    #[inline(always)]
    fn sliding_force(&self, v: T) -> T {
        self.coulomb + self.stiction * (-(v * self.stribeck_slope).square()).exp()
    }
}

impl<T: Real> FrictionLaw<T> for LuGre<T> {
    #[inline(always)]
    fn evaluate(&self, v: T, z: T) -> (T, T) {
        let g = self.sliding_force(v);
        let z_rate = v - self.bristle_stiffness * v.abs() * z / g;
        let force = self.bristle_stiffness * z + self.bristle_damping * z_rate + self.viscous * v;
        (force, z_rate)
    }

    fn energy(&self, z: T) -> T {
        T::lit(0.5) * self.bristle_stiffness * z.square()
    }

    fn stored_power(&self, z: T, rate: T) -> T {
        self.bristle_stiffness * z * rate
    }

    fn at_rest(&self, force: T) -> (T, T) {
        // at the Coulomb force the bristles hold without creeping away at the first movement
        let held = force.min(self.coulomb).max(-self.coulomb);
        (held, held / self.bristle_stiffness)
    }

    fn steepest(&self) -> (T, T) {
        (self.bristle_stiffness, self.viscous + self.bristle_damping)
    }

    fn bristle_rate(&self, v: T) -> T {
        self.bristle_stiffness * v.abs() / self.sliding_force(v)
    }
}

/// Friction law of a crane, as chosen by `friction.law`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Friction<T> {
    /// Stribeck law (10), as published; zero at rest.
    Stribeck(Stribeck<T>),
    /// LuGre law, with static friction at rest.
    LuGre(LuGre<T>),
}

impl<T: Real> FrictionLaw<T> for Friction<T> {
    #[inline(always)]
    fn evaluate(&self, velocity: T, bristle: T) -> (T, T) {
        match self {
            Self::Stribeck(law) => law.evaluate(velocity, bristle),
            Self::LuGre(law) => law.evaluate(velocity, bristle),
        }
    }

    fn energy(&self, bristle: T) -> T {
        match self {
            Self::Stribeck(law) => law.energy(bristle),
            Self::LuGre(law) => law.energy(bristle),
        }
    }

    fn stored_power(&self, bristle: T, rate: T) -> T {
        match self {
            Self::Stribeck(law) => law.stored_power(bristle, rate),
            Self::LuGre(law) => law.stored_power(bristle, rate),
        }
    }

    fn at_rest(&self, force: T) -> (T, T) {
        match self {
            Self::Stribeck(law) => law.at_rest(force),
            Self::LuGre(law) => law.at_rest(force),
        }
    }

    fn steepest(&self) -> (T, T) {
        match self {
            Self::Stribeck(law) => law.steepest(),
            Self::LuGre(law) => law.steepest(),
        }
    }

    fn bristle_rate(&self, velocity: T) -> T {
        match self {
            Self::Stribeck(law) => law.bristle_rate(velocity),
            Self::LuGre(law) => law.bristle_rate(velocity),
        }
    }
}

impl<T> Friction<T> {
    /// Converts every parameter to another number type by `f`.
    pub fn map<U>(self, f: &mut impl FnMut(T) -> U) -> Friction<U> {
        match self {
            Self::Stribeck(law) => Friction::Stribeck(law.map(f)),
            Self::LuGre(law) => Friction::LuGre(law.map(f)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STRIBECK: Stribeck<f64> = Stribeck {
        viscous: 3200.0,
        coulomb: 550.0,
        stiction: 100.0,
        stribeck_slope: 100.0,
        steepness: 250.0,
    };
    const LUGRE: LuGre<f64> = LuGre {
        viscous: 3200.0,
        coulomb: 550.0,
        stiction: 100.0,
        stribeck_slope: 100.0,
        bristle_stiffness: 1e7,
        bristle_damping: 1e5,
    };

    #[test]
    fn both_laws_agree_when_sliding() {
        for v in [-0.3, -0.12, 0.05, 0.12] {
            let mut z = 0.0;
            for _ in 0..200_000 {
                z += 1e-6 * LUGRE.evaluate(v, z).1;
            }
            let (lugre, stribeck) = (LUGRE.evaluate(v, z).0, STRIBECK.evaluate(v, 0.0).0);
            assert!((lugre / stribeck - 1.0).abs() < 2e-3, "{lugre} against {stribeck}");
        }
    }

    #[test]
    fn lugre_holds_any_force_below_breakaway_without_creeping() {
        // a massless contact pushed with 600 N, below the 650 N of breakaway
        let (mut x, mut z) = (0.0, 0.0);
        for step in 0..400_000 {
            // v such that the friction balances the push
            let drag = LUGRE.bristle_damping + LUGRE.viscous;
            let v = (600.0 - LUGRE.bristle_stiffness * z) / drag;
            z += 1e-5 * LUGRE.evaluate(v, z).1;
            let moved: f64 = 1e-5 * v;
            x += moved;
            if step > 350_000 {
                assert!(moved.abs() < 1e-16, "still creeping by {moved} a step");
            }
        }
        assert!(x < 0.3e-3, "slid {x} m before holding");
    }

    #[test]
    fn friction_returns_no_more_energy_than_the_bristles_store() {
        let (mut z, mut gained) = (0.0, 0.0_f64);
        let step = 1e-6;
        for i in 0..2_000_000 {
            let v = 0.02 * (20.0 * step * f64::from(i)).sin();
            let (force, rate) = LUGRE.evaluate(v, z);
            let before = LUGRE.energy(z);
            z += step * rate;
            gained += step * force * v - (LUGRE.energy(z) - before);
        }
        assert!(gained > 0.0, "dissipated {gained} J");
    }
}
