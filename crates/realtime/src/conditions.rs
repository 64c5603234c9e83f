//! Operating conditions of the simulated crane: payload and transition pressure of the oil, as estimated.

use hydroboom_description::schema::Numbers;

/// Time constant with which a moving simulated crane changes its conditions \[s\]. A step of the payload
/// would excite the boom.
const CHANGE: f64 = 0.25;

/// Operating conditions of the simulated crane: payload and transition pressure of the oil.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conditions {
    /// Mass of the payload \[kg\].
    pub payload: f64,
    /// Transition pressure of the oil, p_c1 \[Pa\].
    pub transition_pressure: f64,
}

impl Conditions {
    /// Conditions as the crane file states them.
    pub fn described(numbers: &Numbers<f64>) -> Self {
        Self { payload: numbers.payload, transition_pressure: numbers.transition }
    }

    /// Parameters of a crane file with payload and transition pressure replaced by these conditions.
    pub fn numbers(&self, described: &Numbers<f64>) -> Numbers<f64> {
        Numbers { payload: self.payload, transition: self.transition_pressure, ..*described }
    }

    /// Conditions after a time step `time` \[s\], at least 0, of a first-order approach to `others`.
    ///
    /// c ← c + min(t / T, 1) (c_others − c), with the time constant T = 0.25 s, a choice of this project.
    #[must_use]
    pub fn towards(&self, others: &Self, time: f64) -> Self {
        let share = (time / CHANGE).min(1.0);
        let between = |from: f64, to: f64| from + share * (to - from);
        Self {
            payload: between(self.payload, others.payload),
            transition_pressure: between(self.transition_pressure, others.transition_pressure),
        }
    }

    /// Whether the conditions differ enough to change the simulated crane: by more than 1 kg or 0.1 bar.
    /// A NaN differs from nothing.
    pub fn differ(&self, others: &Self) -> bool {
        (self.payload - others.payload).abs() > 1.0
            || (self.transition_pressure - others.transition_pressure).abs() > 1e4
    }
}
