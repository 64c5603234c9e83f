//! Check valves, plain and pilot-operated.

use hydroboom_math::{Real, record};

record! {
    /// A check valve whose opening grows with the pressure across it.
    ///
    /// ```text
    /// x_cv = clamp((Δp − p_cr)/(p_o − p_cr), 0, 1),   K_V = x_cv K_V,max              (A4, A5)
    /// ```
    pub struct CheckValve<T> {
        /// Flow coefficient when fully open, K_V,max
        #[unit = "m³/(s·√Pa)"]
        pub flow_coefficient: T,
        /// Pressure drop at which it begins to open, p_cr
        #[unit = "Pa"]
        pub cracking_pressure: T,
        /// Opening (share of full opening) per pressure beyond cracking, 1/(p_o − p_cr)
        #[unit = "1/Pa"]
        pub opening_slope: T,
    }
}

impl<T: Real> CheckValve<T> {
    /// Valve from its flow coefficient when fully open \[m³/(s·√Pa)\] and its pressure drops of cracking and full
    /// opening \[Pa\]. These must be p_cr < p_o, which is not checked: equal ones give an infinite slope.
    pub fn new(flow_coefficient: T, cracking_pressure: T, opening_pressure: T) -> Self {
        let opening_slope = T::one() / (opening_pressure - cracking_pressure);
        Self { flow_coefficient, cracking_pressure, opening_slope }
    }

    /// Flow coefficient K_V,max (Δp − p_cr)/(p_o − p_cr) \[m³/(s·√Pa)\], limited to 0..K_V,max, at a pressure drop Δp
    /// \[Pa\] in opening direction.
    #[inline(always)]
    pub fn coefficient(&self, pressure: T) -> T {
        let opening = (pressure - self.cracking_pressure) * self.opening_slope;
        opening.clamp(T::zero(), T::one()) * self.flow_coefficient
    }
}

/// Pilot-operated check valve: a pilot pressure can hold it open against its load.
///
/// Flow is free from port 1 to port 2. The pilot's piston adds `r (p_pilot − p_1)` to the pressure that opens the
/// poppet. It pushes and cannot pull, so it never *closes* the valve: without pilot pressure this is a plain check
/// valve. (Left signed, the term would shut the free direction whenever port 1 stands above the pilot line, and
/// nothing could be lifted.)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PilotCheckValve<T> {
    /// Poppet and seat as a plain check valve.
    pub check: CheckValve<T>,
    /// Pilot ratio r \[1\]: area of the pilot's piston over that of the poppet's seat.
    pub pilot_ratio: T,
}

impl<T: Real> PilotCheckValve<T> {
    /// Flow coefficient \[m³/(s·√Pa)\] at the gauge pressures \[Pa\] of both ports and of the pilot line: that of the
    /// check valve at the opening pressure `p_1 − p_2 + r max(0, p_pilot − p_1)`.
    #[inline(always)]
    pub fn coefficient(&self, port_1: T, port_2: T, pilot: T) -> T {
        let push = self.pilot_ratio * (pilot - port_1).max(T::zero());
        self.check.coefficient(port_1 - port_2 + push)
    }
}

impl<T> PilotCheckValve<T> {
    /// Converts every parameter to another number type by `f`.
    pub fn map<U>(self, f: &mut impl FnMut(T) -> U) -> PilotCheckValve<U> {
        PilotCheckValve { check: self.check.map(&mut *f), pilot_ratio: f(self.pilot_ratio) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn holding() -> PilotCheckValve<f64> {
        PilotCheckValve { check: CheckValve::new(2.4e-6, 1e5, 1.2e5), pilot_ratio: 3.0 }
    }

    #[test]
    fn opening_grows_from_cracking_to_opening_pressure() {
        let valve = CheckValve::new(2.0, 1e5, 1.5e5);
        for (pressure, coefficient) in [(0.9e5, 0.0), (1e5, 0.0), (1.25e5, 1.0), (1.6e5, 2.0)] {
            assert!((valve.coefficient(pressure) - coefficient).abs() < 1e-12);
        }
    }

    #[test]
    fn load_is_held_without_pilot_pressure_whatever_the_pump_side_does() {
        for pump_side in [-1e5, 0.0, 3e5, 69e5, 71e5] {
            assert_eq!(holding().coefficient(pump_side, 70e5, 2.5e5), 0.0);
        }
        assert_eq!(holding().coefficient(72e5, 70e5, 2.5e5), 2.4e-6);
    }

    #[test]
    fn pilot_pressure_opens_it_against_the_load() {
        // lowering: pump side below the load, pilot at load pressure
        assert_eq!(holding().coefficient(60e5, 70e5, 70e5), 2.4e-6);
        // lifting: the pilot does not shut the free direction
        assert_eq!(holding().coefficient(72e5, 70e5, 70e5), 2.4e-6);
    }
}
