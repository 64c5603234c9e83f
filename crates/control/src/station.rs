//! What is known of the crane at a piston position: how it rests there, and its oil spring.

use crate::OilSpring;
use hydroboom_math::{Real, record};

record! {
    /// The crane at rest at a piston position.
    pub struct Rest<T> {
        /// Load pressure, p_0
        #[unit = "Pa"]
        pub load_pressure: T,
        /// Its change along the stroke, p_0'
        #[unit = "Pa/m"]
        pub load_pressure_slope: T,
        /// Motor speed that makes good for leakage, n_0
        #[unit = "rev/s"]
        pub holding_speed: T,
    }
}

/// All that is known of the crane at a piston position.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Station<T> {
    /// How it rests.
    pub rest: Rest<T>,
    /// Its oil spring where the oil is as stiff as it gets. What leaks by pressure, or by position, is left to the integral.
    pub stiff: OilSpring<T>,
}

impl<T: Real> Station<T> {
    /// From the spring as it is where the oil has `stiffness` of stiff oil's.
    pub fn new(rest: Rest<T>, spring: &OilSpring<T>, stiffness: T) -> Self {
        let zero = T::zero();
        let leaks_nothing =
            OilSpring { pressure_by_stroke: zero, pressure_by_pressure: zero, ..*spring };
        let unscaled = Self { rest, stiff: leaks_nothing };
        Self { rest, stiff: unscaled.spring(T::one() / stiffness) }
    }

    /// The oil spring where the oil has `stiffness` of stiff oil's.
    #[inline(always)]
    pub fn spring(&self, stiffness: T) -> OilSpring<T> {
        OilSpring {
            pressure_by_velocity: self.stiff.pressure_by_velocity * stiffness,
            pressure_by_speed: self.stiff.pressure_by_speed * stiffness,
            ..self.stiff
        }
    }

    /// Number by number, something of this one and another.
    #[inline(always)]
    pub fn with(&self, other: &Self, f: impl Fn(T, T) -> T) -> Self {
        let (a, b) = (self.rest.to_array(), other.rest.to_array());
        let (c, d) = (self.stiff.to_array(), other.stiff.to_array());
        Self {
            rest: Rest::from_array(core::array::from_fn(|i| f(a[i], b[i]))),
            stiff: OilSpring::from_array(core::array::from_fn(|i| f(c[i], d[i]))),
        }
    }

    /// The same in another number type.
    pub fn map<U>(self, mut f: impl FnMut(T) -> U) -> Station<U> {
        Station { rest: self.rest.map(&mut f), stiff: self.stiff.map(&mut f) }
    }
}
