//! What differs between two descriptions.

use crate::Description;
use crate::equipment_defaults::is_equipment;
use crate::parse::SEGMENT_LENGTHS;
use crate::schema::KEYS;

/// Sections that are no part of a machine: its controllers, its supervision, its tests.
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

/// Whether keys of a section are of the machine itself: not of what is around it, and not of its equipment.
pub fn is_of_machine(section: &str) -> bool {
    !AROUND.contains(&section) && !is_equipment(section)
}

/// One key with two values.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// `section.key`.
    pub key: String,
    /// Its value here.
    pub here: String,
    /// Its value there.
    pub there: String,
    /// Unit of both; empty for choices.
    pub unit: &'static str,
}

impl Difference {
    /// Whether it is of the equipment between a controller and the crane: drive, switching valve,
    /// sensors, fieldbus, the virtual crane's time step and seed.
    pub fn is_of_equipment(&self) -> bool {
        self.key.split_once('.').is_some_and(|(section, _)| is_equipment(section))
    }

    /// Whether it is of the machine itself: not of what is around it, and not of its equipment.
    pub fn is_of_machine(&self) -> bool {
        is_of_machine(self.key.split_once('.').map_or("", |(section, _)| section))
    }

    /// How much it matters, larger for more: as [`by_weight`] says, then by size.
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

    /// The override that makes this key here what it is there.
    pub fn assignment(&self) -> String {
        format!("{}={}", self.key, self.there)
    }
}

/// The differences in the order in which they matter.
///
/// Choices and the boom's division come first, then numbers of the machine by their relative difference,
/// then effects that one of both leaves out, at last what is no part of the machine.
pub fn by_weight(mut differences: Vec<Difference>) -> Vec<Difference> {
    differences.sort_by(|a, b| {
        let ((a, a_size), (b, b_size)) = (a.weight(), b.weight());
        b.cmp(&a).then(b_size.total_cmp(&a_size))
    });
    differences
}

impl Description {
    /// Every key whose value differs in `other`, names left out.
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
