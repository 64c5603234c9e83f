//! What is known of the crane at a piston position: how it rests there, and its oil spring.

use crate::boom::Boom;
use crate::oil_spring::OilSpring;
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
    /// What its load hangs on.
    pub boom: Boom<T>,
}

impl<T: Real> Station<T> {
    /// From the spring as it is where the oil has `stiffness` of stiff oil's, and the boom.
    pub fn new(rest: Rest<T>, spring: &OilSpring<T>, stiffness: T, boom: Boom<T>) -> Self {
        let zero = T::zero();
        let leaks_nothing =
            OilSpring { pressure_by_stroke: zero, pressure_by_pressure: zero, ..*spring };
        let unscaled = Self { rest, stiff: leaks_nothing, boom };
        Self { stiff: unscaled.spring(T::one() / stiffness), ..unscaled }
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
        let (e, g) = (self.boom.to_array(), other.boom.to_array());
        Self {
            rest: Rest::from_array(core::array::from_fn(|i| f(a[i], b[i]))),
            stiff: OilSpring::from_array(core::array::from_fn(|i| f(c[i], d[i]))),
            boom: Boom::from_array(core::array::from_fn(|i| f(e[i], g[i]))),
        }
    }

    /// The same in another number type.
    pub fn map<U>(self, mut f: impl FnMut(T) -> U) -> Station<U> {
        Station {
            rest: self.rest.map(&mut f),
            stiff: self.stiff.map(&mut f),
            boom: self.boom.map(&mut f),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pump and piston raise the pressure by as much as the oil is stiff, and so the crane rings with the root of it.
    #[test]
    fn a_station_gives_back_its_spring_and_a_softer_one_where_the_oil_is_softer() {
        let spring = OilSpring::from_array([-0.3, -0.2, 2e-7, 0.0, -0.6e9, 0.0, 1.7e6]);
        let station =
            Station::new(Rest::from_array([65e5, -1e6, 0.11]), &spring, 0.5, Boom::rigid(&spring));
        for (found, wanted) in station.spring(0.5).to_array().into_iter().zip(spring.to_array()) {
            assert!((found - wanted).abs() <= 1e-12 * f64::abs(wanted), "{found} for {wanted}");
        }
        let soft = station.spring(0.125);
        assert!((soft.pressure_by_speed / spring.pressure_by_speed - 0.25).abs() < 1e-12);
        assert!((soft.ring() / spring.ring() - 0.5).abs() < 1e-12);
    }
}
