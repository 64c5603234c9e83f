//! A boom that gives.
//!
//! A load hangs on the cylinder by a boom that bends, a spring in series with the oil. So the piston is not where its load is: each bar bends the boom by some hundredths
//! of a millimetre, and what the motor pumps moves the piston before the load, as if something pushed it. Where the load is, in the piston's
//! travel, is y = x − γ p; that is a mass on both springs, and nothing but what pushes it, and pressure, moves it.

use crate::oil_spring::OilSpring;
use hydroboom_math::{Real, record};

record! {
    /// What a load pressure does to a load that hangs on the cylinder by a boom.
    pub struct Boom<T> {
        /// Acceleration of the load by it, in the piston's travel, a_p
        #[unit = "m/(s² Pa)"]
        pub acceleration_by_pressure: T,
        /// How much farther out the piston is for it than the load, γ
        #[unit = "m/Pa"]
        pub give: T,
    }
}

impl<T: Real> Boom<T> {
    /// One that does not bend, with the load of an oil spring.
    pub fn rigid(spring: &OilSpring<T>) -> Self {
        let acceleration_by_pressure = spring.acceleration_by_pressure;
        Self { acceleration_by_pressure, give: T::zero() }
    }

    /// One that lies between a rigid one and this, by this one's share, 0 to 1.
    #[inline(always)]
    pub fn share(&self, share: T, rigid: &Self) -> Self {
        let between = |rigid: T, own: T| share.mul_add(own - rigid, rigid);
        Self {
            acceleration_by_pressure: between(
                rigid.acceleration_by_pressure,
                self.acceleration_by_pressure,
            ),
            give: between(rigid.give, self.give),
        }
    }

    /// The spring that the load rings on: oil and boom in series.
    ///
    /// `x' = y' + γ p'` in `p' = c_v x' + b n + r` leaves `p' = (c_v y' + b n + r)/(1 − γ c_v)`.
    #[inline(always)]
    pub fn in_series(&self, oil: &OilSpring<T>) -> OilSpring<T> {
        let one = T::one();
        let softer = one / (one - self.give * oil.pressure_by_velocity);
        OilSpring {
            acceleration_by_pressure: self.acceleration_by_pressure,
            pressure_by_velocity: softer * oil.pressure_by_velocity,
            pressure_by_speed: softer * oil.pressure_by_speed,
            ..*oil
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OIL: [f64; 7] = [0.0, -0.2, 2e-7, 0.0, -1.1e9, 0.0, 3.2e6];
    const BOOM: Boom<f64> = Boom { acceleration_by_pressure: 2.2e-7, give: 2e-10 };

    /// Springs in series: the squares of the periods add up.
    #[test]
    fn a_load_rings_on_oil_and_boom_in_series() {
        let oil = OilSpring::from_array(OIL);
        let alone = OilSpring { acceleration_by_pressure: BOOM.acceleration_by_pressure, ..oil };
        let by_boom = f64::sqrt(BOOM.acceleration_by_pressure / BOOM.give);
        let squares = alone.ring().powi(-2) + by_boom.powi(-2);
        let both = BOOM.in_series(&oil).ring();
        assert!((both.powi(-2) / squares - 1.0).abs() < 1e-12, "{both}");
    }

    #[test]
    fn a_rigid_boom_leaves_the_oil_as_it_is() {
        let oil = OilSpring::from_array(OIL);
        let rigid = Boom::rigid(&oil);
        assert_eq!(rigid.in_series(&oil), oil);
        assert_eq!(BOOM.share(0.0, &rigid).in_series(&oil), oil);
        assert_eq!(BOOM.share(1.0, &rigid).in_series(&oil), BOOM.in_series(&oil));
    }
}
