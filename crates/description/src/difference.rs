//! Differences between two descriptions.

use crate::Description;
use crate::equipment_defaults::is_equipment;
use crate::schema::KEYS;
use crate::suggestion::SEGMENT_LENGTHS;

/// Sections that do not describe the machine: controllers, supervision, tests.
const AROUND: [&str; 9] = [
    "controller",
    "benchmark_design",
    "estimator",
    "scheduled_lqr",
    "learning",
    "tip",
    "motion",
    "oscillation",
    "supervision",
];

/// Whether a section describes the machine itself, not its controllers, tests or equipment.
pub fn is_of_machine(section: &str) -> bool {
    !AROUND.contains(&section) && !is_equipment(section)
}

/// Key whose values differ in two descriptions.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Path of the key, `section.key`.
    pub key: String,
    /// Value in the first description, in the key's unit.
    pub here: String,
    /// Value in the second description, in the key's unit.
    pub there: String,
    /// Unit of both values; empty for choices.
    pub unit: &'static str,
}

impl Difference {
    /// Whether the key describes the equipment between controller and crane: drive, switching valve, sensors,
    /// fieldbus, the virtual crane's time step and seed.
    pub fn is_of_equipment(&self) -> bool {
        self.key.split_once('.').is_some_and(|(section, _)| is_equipment(section))
    }

    /// Whether the key describes the machine itself, not its controllers, tests or equipment.
    pub fn is_of_machine(&self) -> bool {
        is_of_machine(self.key.split_once('.').map_or("", |(section, _)| section))
    }

    /// Rank for [`by_weight`], larger first: class of the key, then relative difference.
    fn weight(&self) -> (u8, f64) {
        let Some(key) = KEYS.iter().find(|key| key.path() == self.key) else {
            return (3, 0.0);
        };
        let (Ok(here), Ok(there)) = (self.here.parse::<f64>(), self.there.parse::<f64>()) else {
            return (3, 0.0);
        };
        let relative = (here - there).abs() / here.abs().max(there.abs()).max(f64::MIN_POSITIVE);
        let is_left_out = [here, there].iter().any(|value| key.absent == Some(*value));
        match (AROUND.contains(&key.section), is_left_out) {
            (true, _) => (0, relative),
            (false, true) => (1, relative),
            (false, false) => (2, relative),
        }
    }

    /// Override `section.key=value` that gives this key its value of the second description.
    pub fn assignment(&self) -> String {
        format!("{}={}", self.key, self.there)
    }
}

/// Sorts differences by importance.
///
/// Choices and the boom's segmentation come first, then numbers of the machine by their relative difference. Effects
/// that one of both leaves out follow, and last keys that do not describe the machine.
pub fn by_weight(mut differences: Vec<Difference>) -> Vec<Difference> {
    differences.sort_by(|a, b| {
        let ((a, a_size), (b, b_size)) = (a.weight(), b.weight());
        b.cmp(&a).then(b_size.total_cmp(&a_size))
    });
    differences
}

impl Description {
    /// Keys whose values differ in `other`; names of machines are not compared.
    pub fn differences(&self, other: &Self) -> Vec<Difference> {
        let text = |description: &Self| {
            let shares: Vec<String> =
                description.segment_shares.iter().map(f64::to_string).collect();
            let choices = description.choices.list().map(|(path, name)| (path, name.to_string()));
            choices.into_iter().chain([(SEGMENT_LENGTHS, shares.join(","))])
        };
        let numbers =
            self.entries().zip(other.entries()).map(|((key, here, _), (_, there, _))| Difference {
                key: key.path(),
                here: here.to_string(),
                there: there.to_string(),
                unit: key.unit,
            });
        let texts = text(self).zip(text(other)).map(|((key, here), (_, there))| Difference {
            key: key.into(),
            here,
            there,
            unit: "",
        });
        numbers.chain(texts).filter(|difference| difference.here != difference.there).collect()
    }
}
