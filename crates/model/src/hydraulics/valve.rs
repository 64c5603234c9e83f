//! Check valves, plain and pilot-operated.

use super::Orifice;
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
        /// Pressure drop at which it is fully open, p_o
        #[unit = "Pa"]
        pub opening_pressure: T,
    }
}

impl<T: Real> CheckValve<T> {
    /// Opening, `0..=1`, under the pressure \[Pa\] that acts to open it.
    #[inline(always)]
    pub fn opening(&self, pressure: T) -> T {
        ((pressure - self.cracking_pressure) / (self.opening_pressure - self.cracking_pressure))
            .clamp(T::zero(), T::one())
    }

    /// Flow coefficient \[m³/(s·√Pa)\] under the pressure \[Pa\] that acts to open it.
    #[inline(always)]
    pub fn coefficient(&self, pressure: T) -> T {
        self.opening(pressure) * self.flow_coefficient
    }

    /// The restriction it is under the pressure \[Pa\] that acts to open it.
    #[inline(always)]
    pub fn restriction(&self, pressure: T, laminar_drop: T) -> Orifice<T> {
        Orifice { flow_coefficient: self.coefficient(pressure), laminar_drop }
    }
}

record! {
    /// A check valve that a pilot pressure can hold open against its load.
    ///
    /// Flow is free from port 1 to port 2. The pilot's piston adds `r (p_pilot − p_1)` to the
    /// pressure that opens the poppet. It pushes and cannot pull, so it never *closes* the valve:
    /// without pilot pressure this is a plain check valve. (Left signed, the term would shut the
    /// free direction whenever port 1 stands above the pilot line, and nothing could be lifted.)
    pub struct PilotCheckValve<T> {
        /// Flow coefficient when fully open, K_V,max
        #[unit = "m³/(s·√Pa)"]
        pub flow_coefficient: T,
        /// Pressure at which it begins to open, p_cr
        #[unit = "Pa"]
        pub cracking_pressure: T,
        /// Pressure at which it is fully open, p_o
        #[unit = "Pa"]
        pub opening_pressure: T,
        /// Area of the pilot's piston over that of the poppet's seat, r
        #[unit = "1"]
        pub pilot_ratio: T,
    }
}

impl<T: Real> PilotCheckValve<T> {
    /// Flow coefficient \[m³/(s·√Pa)\] at the pressures \[Pa\] of both ports and the pilot line.
    #[inline(always)]
    pub fn coefficient(&self, port_1: T, port_2: T, pilot: T) -> T {
        let push = self.pilot_ratio * (pilot - port_1).max(T::zero());
        let [flow_coefficient, cracking_pressure, opening_pressure, _] = self.to_array();
        CheckValve { flow_coefficient, cracking_pressure, opening_pressure }
            .coefficient(port_1 - port_2 + push)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOLDING: PilotCheckValve<f64> = PilotCheckValve {
        flow_coefficient: 2.4e-6,
        cracking_pressure: 1e5,
        opening_pressure: 1.2e5,
        pilot_ratio: 3.0,
    };

    #[test]
    fn load_is_held_without_pilot_pressure_whatever_the_pump_side_does() {
        for pump_side in [-1e5, 0.0, 3e5, 69e5, 71e5] {
            assert_eq!(HOLDING.coefficient(pump_side, 70e5, 2.5e5), 0.0);
        }
        assert_eq!(HOLDING.coefficient(72e5, 70e5, 2.5e5), 2.4e-6);
    }

    #[test]
    fn pilot_pressure_opens_it_against_the_load() {
        // lowering: pump side below the load, pilot at load pressure
        assert_eq!(HOLDING.coefficient(60e5, 70e5, 70e5), 2.4e-6);
        // lifting: the pilot does not shut the free direction
        assert_eq!(HOLDING.coefficient(72e5, 70e5, 70e5), 2.4e-6);
    }
}
