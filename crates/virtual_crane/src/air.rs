//! Dissolved air: oil dissolves air under pressure and releases it again, so its stiffness depends on the pressure
//! history.

use hydroboom_description::Description;
use hydroboom_model::Nodes;

/// State of the dissolved air in every node of the circuit.
///
/// ```text
/// s' = (S min(p/p_c1, 1) − s)/τ,   τ = τ_d while air dissolves, τ_r while it comes out
/// ```
///
/// The transition pressure of the bulk modulus is lower by s. Oil that is compressed quickly has not dissolved its air
/// and is softer than on expansion: a hysteresis loop. The model is a first-order approach to Henry's law, our own.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Air {
    /// Shift S of the transition pressure with all air dissolved \[Pa\].
    most: f64,
    /// Pressure above which all air dissolves, p_c1 \[Pa\].
    all_dissolved: f64,
    /// τ_d and τ_r \[s\].
    times: [f64; 2],
    shift: Nodes<f64>,
}

impl Air {
    /// Air in equilibrium with the given pressures \[Pa\]; `None` if the crane has no hysteresis.
    pub(crate) fn new(description: &Description, pressures: &Nodes<f64>) -> Option<Self> {
        let n = &description.numbers;
        let mut air = Self {
            most: n.air_shift,
            all_dissolved: n.transition.max(1.0),
            times: [n.air_dissolving, n.air_releasing],
            shift: Nodes::default(),
        };
        air.shift = pressures.map(|p| air.settled(p));
        (air.most > 0.0).then_some(air)
    }

    fn settled(&self, pressure: f64) -> f64 {
        self.most * (pressure / self.all_dissolved).clamp(0.0, 1.0)
    }

    /// Shift s of every node \[Pa\].
    pub(crate) fn shift(&self) -> Nodes<f64> {
        self.shift
    }

    /// Integrates the exchange of air over `time` \[s\] at the given pressures \[Pa\].
    pub(crate) fn advance(&mut self, pressures: &Nodes<f64>, time: f64) {
        let now = self.shift.to_array();
        let towards = pressures.map(|p| self.settled(p)).to_array();
        let moved = std::array::from_fn(|i| {
            let constant = self.times[usize::from(towards[i] < now[i])];
            now[i] + (towards[i] - now[i]) * -(-time / constant).exp_m1()
        });
        self.shift = Nodes::from_array(moved);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stiffness_depends_on_the_pressure_history() {
        let mut crane = Description::uia_single_boom().unwrap();
        crane.set("oil.air_shift_bar=8").unwrap();
        let oil = crane.crane::<3>().unwrap().circuit.oil;
        let held = |from: f64| {
            let mut air = Air::new(&crane, &Nodes::default().map(|_: f64| from)).unwrap();
            // one second at 30 bar: less than the time constants, so the two directions differ
            air.advance(&Nodes::default().map(|_: f64| 30e5), 1.0);
            oil.with_dissolved_air(air.shift().a).bulk_modulus(30e5)
        };
        assert!(held(60e5) > 1.3 * held(0.0), "{} {}", held(60e5), held(0.0));
        assert!(Air::new(&Description::uia_single_boom().unwrap(), &Nodes::default()).is_none());
    }
}
