//! How stiff the oil is over pressure, and by how much it shrinks.

use hydroboom_math::{Real, record};

record! {
    /// Bulk modulus over pressure (7), `β(p) = (β_max + β_min)/2 + (β_max − β_min)/2 tanh((p − p_c1)/p_c2)`.
    pub struct OilStiffness<T> {
        /// β_max
        #[unit = "Pa"]
        pub highest: T,
        /// β_min
        #[unit = "Pa"]
        pub lowest: T,
        /// p_c1
        #[unit = "Pa"]
        pub transition: T,
        /// p_c2
        #[unit = "Pa"]
        pub width: T,
    }
}

impl<T: Real> OilStiffness<T> {
    /// Bulk modulus at a pressure \[Pa\], as a share of the highest.
    #[inline(always)]
    pub fn share(&self, pressure: T) -> T {
        let half = T::lit(0.5);
        let lowest = self.lowest / self.highest;
        let step = ((pressure - self.transition) / self.width).tanh();
        half * (T::one() + lowest) + half * (T::one() - lowest) * step
    }

    /// Share of its volume by which oil shrinks from the pressure p_c1 to another \[Pa\], `∫ dp/β`: with z = (p − p_c1)/p_c2, m and d
    /// half the sum and half the difference of both limits, `p_c2/(m² − d²) (m z − d ln((β_max e^z + β_min e^−z)/(2 m)))`.
    pub fn compression(&self, pressure: T) -> T {
        let half = T::lit(0.5);
        let (mean, difference) =
            (half * (self.highest + self.lowest), half * (self.highest - self.lowest));
        let z = (pressure - self.transition) / self.width;
        // the larger power is taken out, so that none overflows
        let up = T::zero().lt(z);
        let away = T::select(up, z, -z);
        let small = (-(away + away)).exp();
        let sum =
            T::select(up, self.highest + self.lowest * small, self.highest * small + self.lowest);
        let log = away + (half * sum / mean).ln();
        self.width / (self.highest * self.lowest) * (mean * z - difference * log)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_math::Dual;

    #[test]
    fn compression_is_the_integral_of_one_over_the_bulk_modulus() {
        let [highest, lowest, transition, width] = [1.6e9, 2e7, 35e5, 5e5].map(Dual::constant);
        let oil: OilStiffness<Dual<f64, 1>> = OilStiffness { highest, lowest, transition, width };
        for bar in [-1.0, 0.0, 10.0, 34.0, 35.0, 40.0, 90.0, 400.0, 4000.0] {
            let pressure = Dual::variable(bar * 1e5, 0);
            let slope = oil.compression(pressure).slope[0];
            let wanted = 1.0 / (1.6e9 * oil.share(pressure).value);
            assert!((slope / wanted - 1.0).abs() < 1e-9, "{bar} bar: {slope} for {wanted}");
        }
    }
}
