//! Orifice equation with a laminar core, and orifices in series.

use hydroboom_math::Real;

/// The law of sharp-edged restrictions, turbulent with a laminar core around zero pressure drop.
///
/// ```text
/// Q = K_V r(Δp)                                                                          (4)
/// r = sgn(Δp) √|Δp|                             for |Δp| ≥ Δp_lam
/// r = √Δp_lam · x (5 − x²)/4, x = Δp/Δp_lam     otherwise
/// ```
///
/// Value and slope of r are continuous at ±Δp_lam, so the root's infinite slope at zero never
/// reaches the integrator. Odd in Δp. All restrictions between the same two nodes share one root.
///
/// Source: doi:10.3390/act14020080, section 3.1.1; the core is ours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orifice<T> {
    laminar_drop: T,
    /// Its reciprocal, since a division costs as much as a root.
    inverse: T,
}

impl<T: Real> Orifice<T> {
    /// Orifice law with the pressure drop Δp_lam \[Pa\] at which laminar flow becomes turbulent, positive.
    pub fn new(laminar_drop: T) -> Self {
        Self { laminar_drop, inverse: T::one() / laminar_drop }
    }

    /// Signed root r(Δp) \[√Pa\] of a pressure drop \[Pa\]; a flow coefficient \[m³/(s·√Pa)\] times r is the flow
    /// \[m³/s\].
    #[inline(always)]
    pub fn root(&self, drop: T) -> T {
        let x = (drop * self.inverse).clamp(-T::one(), T::one());
        let core = x * x.square().mul_add(T::lit(-0.25), T::lit(1.25));
        drop.abs().max(self.laminar_drop).sqrt() * core
    }
}

impl<T> Orifice<T> {
    /// Converts every parameter to another number type by `f`.
    pub fn map<U>(self, f: &mut impl FnMut(T) -> U) -> Orifice<U> {
        Orifice { laminar_drop: f(self.laminar_drop), inverse: f(self.inverse) }
    }
}

/// Far below the square of any real flow coefficient: only there so that 0/0 is 0.
const TINY: f64 = 1e-30;

/// Flow coefficient \[m³/(s·√Pa)\] of two orifices in series, 1/√(1/K_1² + 1/K_2²) (A6); zero if either is closed.
#[inline(always)]
pub fn in_series<T: Real>(first: T, second: T) -> T {
    first * second / (first.square() + second.square() + T::lit(TINY)).sqrt()
}

/// Flow coefficient \[m³/(s·√Pa)\] of three orifices in series, 1/√(1/K_1² + 1/K_2² + 1/K_3²), as [`in_series`]. The
/// first must not be closed: if another one is closed too, the result is NaN.
#[inline(always)]
pub fn three_in_series<T: Real>(first: T, second: T, third: T) -> T {
    // numerator and denominator divided by the first, to stay clear of underflow; the reciprocal of
    // a constant is computed once
    let product = second * third;
    let sum = (product * (T::one() / first)).square() + second.square() + third.square();
    product / (sum + T::lit(TINY)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_math::Dual;

    #[test]
    fn orifice_follows_the_root_law_above_the_laminar_core() {
        let orifice = Orifice::new(1e3);
        for drop in [1e3, 4e5, 9e6] {
            assert_eq!(orifice.root(drop), f64::sqrt(drop));
            assert_eq!(orifice.root(-drop), -orifice.root(drop));
        }
    }

    #[test]
    fn orifice_slope_is_continuous_at_the_edge_of_the_core() {
        let orifice = Orifice::new(Dual::<f64, 1>::constant(1e3));
        let slope = |drop| orifice.root(Dual::variable(drop, 0)).slope[0];
        let (inside, outside) = (slope(1e3 - 1e-5), slope(1e3 + 1e-5));
        assert!((inside / outside - 1.0).abs() < 1e-7, "{inside} against {outside}");
    }

    #[test]
    fn drops_across_a_series_add_up_to_the_whole() {
        let (filter, valve, check, drop) = (7.5e-6, 2.4e-6, 1.1e-6, 3e5);
        let two = in_series(filter, valve) * f64::sqrt(drop);
        let parts = (two / filter).powi(2) + (two / valve).powi(2);
        assert!((parts / drop - 1.0).abs() < 1e-14, "{parts} against {drop}");
        let three = three_in_series(filter, valve, check);
        let nested = in_series(filter, in_series(valve, check));
        assert!((three / nested - 1.0).abs() < 1e-14, "{three} against {nested}");
    }

    #[test]
    fn a_shut_valve_shuts_its_series_with_a_finite_slope() {
        let zero = Dual::<f64, 1>::variable(0.0, 0);
        for shut in [in_series(zero, zero), three_in_series(Dual::lit(7.5e-6), zero, zero)] {
            assert_eq!(shut.value, 0.0);
            assert!(shut.slope[0].is_finite());
        }
        assert_eq!(in_series(2.4e-6, 0.0), 0.0);
        assert_eq!(three_in_series(7.5e-6, 2.4e-6, 0.0), 0.0);
    }
}
