//! Bladder accumulator with polytropic gas (appendix A.2.2).

use hydroboom_math::{Real, record};

record! {
    /// Gas and oil at one pressure in one shell (appendix A.2.2).
    ///
    /// ```text
    /// V_a = V_g + V_f,   (p_acc + p_atm) V_g^γ = const                          (A14, A15)
    /// ```
    ///
    /// Only the gas law adds the atmosphere. When the oil is used up, the bladder rests on the shell's
    /// valve and keeps its gas at the closing pressure. The residual oil behaves like any other volume. The
    /// bladder lifts off again at the same pressure.
    pub struct Accumulator<T> {
        /// Volume of the shell, V_a
        #[unit = "m³"]
        pub volume: T,
        /// Oil volume that remains when the bladder rests on its valve
        #[unit = "m³"]
        pub residual_volume: T,
        /// Polytropic exponent of the gas, γ: 1.0 isothermal (slow), 1.4 adiabatic (fast)
        #[unit = "1"]
        pub polytropic_exponent: T,
        /// Atmospheric pressure, absolute, p_atm
        #[unit = "Pa"]
        pub atmosphere: T,
        /// Gauge pressure at which the bladder reaches its valve
        #[unit = "Pa"]
        pub closing_pressure: T,
    }
}

impl<T: Real> Accumulator<T> {
    /// Accumulator filled to a working pressure, and its gas volume \[m³\] there.
    ///
    /// `precharge` and `filled` are gauge pressures \[Pa\]. Filling is slow, so the gas volume
    /// follows the isothermal law V_g = V_a (p_0 + p_atm)/(p_acc + p_atm) (A16); what comes after
    /// follows the polytropic law from there.
    pub fn filled(
        volume: T,
        residual_volume: T,
        polytropic_exponent: T,
        atmosphere: T,
        precharge: T,
        filled: T,
    ) -> (Self, T) {
        let gas_volume = volume * (precharge + atmosphere) / (filled + atmosphere);
        let expansion = gas_volume / (volume - residual_volume);
        let closing_pressure =
            (filled + atmosphere) * expansion.powf(polytropic_exponent) - atmosphere;
        let accumulator =
            Self { volume, residual_volume, polytropic_exponent, atmosphere, closing_pressure };
        (accumulator, gas_volume)
    }

    /// Oil volume V_f = V_a − V_g \[m³\] at a gas volume \[m³\], at least the residual volume.
    #[inline(always)]
    pub fn oil_volume(&self, gas_volume: T) -> T {
        (self.volume - gas_volume).max(self.residual_volume)
    }

    /// Compliance of the gas, V_g/(γ (p + p_atm)) \[m³/Pa\], at a gauge pressure \[Pa\] and gas volume \[m³\]; zero
    /// while the bladder rests on its valve.
    #[inline(always)]
    pub fn gas_compliance(&self, pressure: T, gas_volume: T) -> T {
        let (volume, stiffness) = self.gas(pressure, gas_volume);
        volume / stiffness
    }

    /// Gas volume that takes part \[m³\], and γ p_gas \[Pa\].
    #[inline(always)]
    fn gas(&self, pressure: T, gas_volume: T) -> (T, T) {
        let afloat = self.closing_pressure.lt(pressure);
        // the floor keeps the quotient finite where no gas takes part
        let absolute = (pressure + self.atmosphere).max(T::lit(1e3));
        (T::select(afloat, gas_volume, T::zero()), self.polytropic_exponent * absolute)
    }

    /// Rates of pressure \[Pa/s\] and gas volume \[m³/s\] under the net inflow Q_acc \[m³/s\], equations (A20) and
    /// (A21).
    ///
    /// `ṗ = Q_acc/(V_f/β + V_g/(γ p_gas))`, `V̇_g = −ṗ V_g/(γ p_gas)`. β is the oil's bulk modulus \[Pa\], `pressure`
    /// a gauge pressure \[Pa\].
    #[inline(always)]
    pub fn rates(&self, bulk_modulus: T, pressure: T, gas_volume: T, inflow: T) -> (T, T) {
        // both fractions expanded by the gas's stiffness, so that one division serves
        let (volume, stiffness) = self.gas(pressure, gas_volume);
        let whole = self.oil_volume(gas_volume) * stiffness + bulk_modulus * volume;
        let share = inflow * bulk_modulus / whole;
        (share * stiffness, -(share * volume))
    }

    /// Energy \[J\] of the gas against the atmosphere, relative to a volume V_0 = V_a:
    /// `p_gas V_g/(γ−1) + p_atm V_g`, with the limit `−p_gas V_g ln V_g` of its changing part at
    /// γ = 1.
    ///
    /// `−(p_gas − p_atm) dV_g` is its differential along a polytrope.
    pub fn gas_energy(&self, pressure: T, gas_volume: T) -> T {
        let p_gas = pressure.max(self.closing_pressure) + self.atmosphere;
        let pv = p_gas * gas_volume;
        let excess = self.polytropic_exponent - T::one();
        let isothermal = excess.abs().lt(T::lit(1e-9));
        let safe = T::select(isothermal, T::one(), excess);
        let ratio = self.volume / gas_volume;
        // work from V_a to V_g: pv/(γ−1) (1 − (V_g/V_a)^(γ−1)), whose limit is pv ln(V_a/V_g)
        let work =
            T::select(isothermal, pv * ratio.ln(), pv / safe * (T::one() - ratio.powf(-excess)));
        work + self.atmosphere * (gas_volume - self.volume)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example(exponent: f64) -> (Accumulator<f64>, f64) {
        Accumulator::filled(10e-3, 0.1e-3, exponent, 1.013e5, 0.3e5, 2.5e5)
    }

    #[test]
    fn gas_follows_the_polytrope_and_oil_fills_the_rest() {
        for exponent in [1.0, 1.2, 1.4] {
            let (accumulator, gas_volume) = example(exponent);
            let invariant = |p: f64, v: f64| (p + 1.013e5) * v.powf(exponent);
            let (mut p, mut v) = (2.5e5, gas_volume);
            let before = invariant(p, v);
            let step = 1e-4;
            for _ in 0..20_000 {
                let (dp, dv) = accumulator.rates(1.6e9, p, v, 5e-4);
                let (mp, mv) = (p + 0.5 * step * dp, v + 0.5 * step * dv);
                let (dp, dv) = accumulator.rates(1.6e9, mp, mv, 5e-4);
                (p, v) = (p + step * dp, v + step * dv);
            }
            let after = invariant(p, v);
            assert!((after / before - 1.0).abs() < 1e-6, "{before} to {after}");
            // 1 L flowed in; all but the oil's own compression shows as less gas
            assert!((gas_volume - v - 1e-3).abs() < 1e-5, "{}", gas_volume - v);
        }
    }

    #[test]
    fn gas_energy_is_the_work_done_on_it() {
        for exponent in [1.0, 1.2] {
            let (accumulator, gas_volume) = example(exponent);
            let pressure = |v: f64| (2.5e5 + 1.013e5) * (gas_volume / v).powf(exponent) - 1.013e5;
            let energy = |v: f64| accumulator.gas_energy(pressure(v), v);
            let (from, to) = (gas_volume, 0.7 * gas_volume);
            let steps = 1000;
            let width = (from - to) / f64::from(steps);
            let work: f64 =
                (0..steps).map(|i| pressure(from - (f64::from(i) + 0.5) * width) * width).sum();
            let gained = energy(to) - energy(from);
            assert!((gained / work - 1.0).abs() < 1e-6, "{gained} against {work}");
        }
    }

    #[test]
    fn an_empty_accumulator_is_stiff_and_has_no_gas_rate() {
        let (accumulator, _) = example(1.2);
        let below = accumulator.closing_pressure - 1.0;
        let (rate, gas_rate) = accumulator.rates(2e7, below, 9.9e-3, -1e-5);
        assert_eq!(gas_rate, 0.0);
        assert!((rate - -1e-5 * 2e7 / 0.1e-3).abs() < 1e-6, "{rate}");
    }
}
