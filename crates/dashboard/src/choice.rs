//! Selection of a run: the control strategy and the course, with the allowed values of both.

use hydroboom_control::strategy::Strategy;
use serde_json::{Value, json};
use std::ops::RangeInclusive;

/// Reference motion of the piston that an operator can start.
#[derive(Clone, Debug, PartialEq)]
pub enum Course {
    /// Out and back at constant speed, as in the paper's tests.
    Motion {
        /// Speed of the reference at constant speed \[mm/s\], within the allowed speeds of the run.
        speed_mm_s: f64,
    },
    /// A named test scenario.
    Scenario {
        /// Name of the scenario.
        name: String,
    },
}

/// Control strategy and course that the operator has selected.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// Control strategy that computes the motor speed.
    pub strategy: Strategy,
    /// Reference motion of the piston.
    pub course: Course,
}

impl Choice {
    /// The selection as JSON, for the viewers' pages.
    pub(crate) fn json(&self) -> Value {
        let (speed, scenario) = match &self.course {
            Course::Motion { speed_mm_s } => (Some(speed_mm_s), None),
            Course::Scenario { name } => (None, Some(name)),
        };
        json!({ "strategy": self.strategy.name(), "speed_mm_s": speed, "scenario": scenario })
    }
}

/// The courses that operators can select.
#[derive(Clone, Debug)]
pub(crate) struct Offered {
    /// Names of the scenarios.
    pub(crate) scenarios: Vec<String>,
    /// Allowed speeds of an out-and-back motion \[mm/s\].
    pub(crate) speeds_mm_s: RangeInclusive<f64>,
}

impl Offered {
    /// The course at a speed \[mm/s\] or of a scenario; `None` where neither is given.
    ///
    /// # Errors
    ///
    /// The reason in words if both are given, the speed is out of range or the scenario is unknown.
    pub(crate) fn course(
        &self,
        speed_mm_s: Option<f64>,
        scenario: Option<String>,
    ) -> Result<Option<Course>, String> {
        match (speed_mm_s, scenario) {
            (None, None) => Ok(None),
            (Some(_), Some(_)) => Err("a speed or a scenario, not both".into()),
            (Some(speed_mm_s), None) if self.speeds_mm_s.contains(&speed_mm_s) => {
                Ok(Some(Course::Motion { speed_mm_s }))
            }
            (Some(speed), None) => {
                let (least, most) = (self.speeds_mm_s.start(), self.speeds_mm_s.end());
                Err(format!("a speed of {speed:.3} mm/s: it is {least:.1} to {most:.0} mm/s"))
            }
            (None, Some(name)) if self.scenarios.contains(&name) => {
                Ok(Some(Course::Scenario { name }))
            }
            (None, Some(name)) => {
                let names = self.scenarios.join(", ");
                Err(format!("no scenario \"{}\": there are {names}", shortened(&name)))
            }
        }
    }
}

/// The beginning of what somebody sent, for a message.
pub(crate) fn shortened(text: &str) -> String {
    text.chars().take(40).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_offered_courses_are_accepted() {
        let offered = Offered { scenarios: vec!["reversal".into()], speeds_mm_s: 0.1..=240.0 };
        let course =
            |speed, scenario: Option<&str>| offered.course(speed, scenario.map(Into::into));
        assert_eq!(course(Some(25.0), None), Ok(Some(Course::Motion { speed_mm_s: 25.0 })));
        assert_eq!(
            course(None, Some("reversal")),
            Ok(Some(Course::Scenario { name: "reversal".into() }))
        );
        assert_eq!(course(None, None), Ok(None));
        for speed in [0.0, -1.0, 241.0, f64::NAN, f64::INFINITY] {
            assert!(course(Some(speed), None).is_err(), "{speed}");
        }
        assert!(course(None, Some("none")).is_err());
        assert!(course(Some(25.0), Some("reversal")).is_err());
    }
}
