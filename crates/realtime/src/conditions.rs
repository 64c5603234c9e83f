//! Conditions of the crane simulated beside the machine: payload and oil, as far as they are estimated.

use hydroboom_description::schema::Numbers;

/// Time constant with which a moving simulated crane changes to other conditions \[s\]: a step of its payload would set it swinging.
const CHANGE: f64 = 0.25;

/// Payload and oil of the simulated crane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conditions {
    /// Payload \[kg\].
    pub payload: f64,
    /// Transition pressure of the oil, p_c1 \[Pa\].
    pub transition_pressure: f64,
}

impl Conditions {
    /// As described.
    pub fn described(numbers: &Numbers<f64>) -> Self {
        Self { payload: numbers.payload, transition_pressure: numbers.transition }
    }

    /// The numbers of a description under these conditions.
    pub fn numbers(&self, described: &Numbers<f64>) -> Numbers<f64> {
        Numbers { payload: self.payload, transition: self.transition_pressure, ..*described }
    }

    /// On the way to others after a time \[s\].
    #[must_use]
    pub fn towards(&self, others: &Self, time: f64) -> Self {
        let share = (time / CHANGE).min(1.0);
        let between = |from: f64, to: f64| from + share * (to - from);
        Self {
            payload: between(self.payload, others.payload),
            transition_pressure: between(self.transition_pressure, others.transition_pressure),
        }
    }

    /// Whether others are worth a change of the simulated crane: a kilogram, a tenth of a bar.
    pub fn differ(&self, others: &Self) -> bool {
        (self.payload - others.payload).abs() > 1.0
            || (self.transition_pressure - others.transition_pressure).abs() > 1e4
    }
}
