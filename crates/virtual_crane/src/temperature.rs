//! Oil temperature, and its effect on viscosity, leakage and air.

use hydroboom_description::{Description, Numbers};

/// Temperature change after which the parameters are updated \[K\].
const STEP: f64 = 0.25;

/// The oil's temperature, and the description at the reference temperature.
#[derive(Clone, Debug)]
pub(crate) struct Temperature {
    described: Description,
    /// Current temperature \[°C\].
    oil: f64,
    /// Temperature of the parameters in use \[°C\].
    applied: f64,
}

impl Temperature {
    /// Oil at its initial temperature.
    pub(crate) fn new(description: &Description) -> Self {
        let oil = description.numbers.oil_temperature;
        Self { described: description.clone(), oil, applied: oil }
    }

    /// The oil's temperature \[°C\].
    pub(crate) fn oil(&self) -> f64 {
        self.oil
    }

    /// Viscosity at the oil's temperature over that at the reference.
    pub(crate) fn relative_viscosity(&self) -> f64 {
        let n = &self.described.numbers;
        (-n.viscosity_slope * (self.oil - n.reference_temperature)).exp()
    }

    /// Transition pressure \[Pa\] of oil without dissolved air, at its temperature.
    pub(crate) fn transition_pressure(&self) -> f64 {
        let n = &self.described.numbers;
        (n.transition + n.air_slope * (self.oil - n.reference_temperature)).max(0.0)
    }

    /// The description at the oil's temperature. Viscous friction and drag are proportional to the viscosity, leakage
    /// is inversely proportional, and the transition pressure depends on the temperature of the air.
    pub(crate) fn description(&self) -> Description {
        let n = &self.described.numbers;
        let viscosity = self.relative_viscosity();
        let numbers = Numbers {
            viscous: n.viscous * viscosity,
            slip_at_rest: n.slip_at_rest / viscosity,
            slip_per_speed: n.slip_per_speed / viscosity,
            transition: self.transition_pressure(),
            ..*n
        };
        let mut description = self.described.clone();
        description.numbers = numbers;
        description
    }

    /// Replaces the payload \[kg\]; returns the new description at the oil's temperature.
    pub(crate) fn with_payload(&mut self, mass: f64) -> Description {
        self.described.numbers.payload = mass;
        self.description()
    }

    /// Replaces the description at the same temperature.
    pub(crate) fn with_description(&mut self, described: &Description) -> Description {
        self.described = described.clone();
        self.description()
    }

    /// Heats the oil with `heat` \[W\] for `time` \[s\]. Returns the new description if the temperature has changed
    /// by more than the update threshold.
    pub(crate) fn advance(&mut self, heat: f64, time: f64) -> Option<Description> {
        let n = &self.described.numbers;
        if n.heat_capacity <= 0.0 {
            return None;
        }
        let given_off = n.cooling * (self.oil - n.ambient_temperature);
        self.oil += (heat - given_off) * time / n.heat_capacity;
        if (self.oil - self.applied).abs() < STEP {
            return None;
        }
        self.applied = self.oil;
        Some(self.description())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn warming() -> Description {
        let mut crane = Description::uia_single_boom().unwrap();
        for assignment in [
            "temperature.oil_c=20",
            "temperature.ambient_c=20",
            "temperature.heat_capacity_kj_per_k=30",
            "temperature.cooling_w_per_k=12",
            "temperature.viscosity_per_k=0.035",
            "pump.slip_l_min_per_bar=0.001",
        ] {
            crane.set(assignment).unwrap();
        }
        crane
    }

    #[test]
    fn after_a_shift_the_oil_is_in_thermal_equilibrium() {
        let mut temperature = Temperature::new(&warming());
        for _ in 0..8 * 3600 {
            temperature.advance(300.0, 1.0);
        }
        // steady state 300 W / (12 W/K) above ambient; e^-11.5 of the transient is left
        assert!((temperature.oil() - 45.0).abs() < 1e-3, "{}", temperature.oil());
    }

    #[test]
    fn cold_oil_leaks_less_and_drags_more() {
        let described = warming();
        let cold = Temperature::new(&described).description().numbers;
        let n = described.numbers;
        let ratio = (0.035_f64 * 20.0).exp();
        assert!((cold.viscous / n.viscous / ratio - 1.0).abs() < 1e-12);
        assert!((cold.slip_at_rest * ratio / n.slip_at_rest - 1.0).abs() < 1e-12);
    }
}
