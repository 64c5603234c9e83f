//! Restrictions: the orifice equation and restrictions in series.

use hydroboom_math::{Real, record};

record! {
    /// A sharp-edged restriction: turbulent, with a laminar core around zero pressure drop.
    ///
    /// ```text
    /// Q = K_V sgn(Δp) √|Δp|                        for |Δp| ≥ Δp_lam                     (4)
    /// Q = K_V √Δp_lam · x (5 − x²)/4, x = Δp/Δp_lam   otherwise
    /// ```
    ///
    /// Value and slope are continuous at ±Δp_lam, so the root's infinite slope at zero never
    /// reaches the integrator. Odd in Δp.
    ///
    /// Source: doi:10.3390/act14020080, section 3.1.1; the core is ours.
    pub struct Orifice<T> {
        /// Flow at a pressure drop of 1 Pa, K_V
        #[unit = "m³/(s·√Pa)"]
        pub flow_coefficient: T,
        /// Pressure drop below which the flow is laminar, Δp_lam
        #[unit = "Pa"]
        pub laminar_drop: T,
    }
}

impl<T: Real> Orifice<T> {
    /// Flow \[m³/s\] driven by the pressure drop \[Pa\], both positive from inlet to outlet.
    #[inline(always)]
    pub fn flow(&self, drop: T) -> T {
        let x = (drop / self.laminar_drop).clamp(-T::one(), T::one());
        let core = x * (T::lit(1.25) - T::lit(0.25) * x.square());
        self.flow_coefficient * drop.abs().max(self.laminar_drop).sqrt() * core
    }

    /// The restriction opened by a fraction `0..=1`.
    #[inline(always)]
    pub fn opened(&self, opening: T) -> Self {
        Self { flow_coefficient: opening * self.flow_coefficient, ..*self }
    }
}

/// Flow coefficient of two restrictions in series, 1/√(1/K_1² + 1/K_2²) (A6), zero where either is
/// shut.
#[inline(always)]
pub fn in_series<T: Real>(first: T, second: T) -> T {
    // far below the square of any real coefficient: only there so that 0/0 is 0
    let tiny = T::lit(1e-30);
    first * second / (first.square() + second.square() + tiny).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_math::Dual;

    const ORIFICE: Orifice<f64> = Orifice { flow_coefficient: 2.4e-6, laminar_drop: 1e3 };

    #[test]
    fn orifice_follows_the_root_law_above_the_laminar_core() {
        for drop in [1e3, 4e5, 9e6] {
            assert_eq!(ORIFICE.flow(drop), 2.4e-6 * f64::sqrt(drop));
            assert_eq!(ORIFICE.flow(-drop), -ORIFICE.flow(drop));
        }
    }

    #[test]
    fn orifice_slope_is_continuous_at_the_edge_of_the_core() {
        let orifice = ORIFICE.map(Dual::<f64, 1>::constant);
        let slope = |drop| orifice.flow(Dual::variable(drop, 0)).slope[0];
        let (inside, outside) = (slope(1e3 - 1e-5), slope(1e3 + 1e-5));
        assert!((inside / outside - 1.0).abs() < 1e-7, "{inside} against {outside}");
    }

    #[test]
    fn drops_across_a_series_add_up_to_the_whole() {
        let (first, second, drop) = (7.5e-6, 2.4e-6, 3e5);
        let flow = in_series(first, second) * f64::sqrt(drop);
        let parts = (flow / first).powi(2) + (flow / second).powi(2);
        assert!((parts / drop - 1.0).abs() < 1e-14, "{parts} against {drop}");
    }

    #[test]
    fn a_shut_valve_shuts_its_series_with_a_finite_slope() {
        let shut = in_series(Dual::<f64, 1>::variable(0.0, 0), Dual::lit(0.0));
        assert_eq!(shut.value, 0.0);
        assert!(shut.slope[0].is_finite());
        assert_eq!(in_series(2.4e-6, 0.0), 0.0);
    }
}
