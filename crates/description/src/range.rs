//! Ranges of values: what a crane file says of a key, or its default spread.

use crate::schema::{KEYS, Key, Numbers};
use crate::{Description, DescriptionError, spread};

/// Where a range comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RangeSource {
    /// The crane file.
    File,
    /// The key's default spread about its value.
    Default,
    /// Nobody: the key has no default spread, the range is its value.
    Value,
}

impl RangeSource {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::File => "file",
            Self::Default => "default",
            Self::Value => "value",
        }
    }
}

/// Values that a number of the machine may have, in SI units. The number itself is among them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValueRange {
    /// Smallest.
    pub low: f64,
    /// Largest.
    pub high: f64,
    /// Where the range comes from.
    pub source: RangeSource,
}

/// The ranges of all numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranges {
    /// Smallest values, in SI units.
    pub low: Numbers<f64>,
    /// Largest values, in SI units.
    pub high: Numbers<f64>,
    /// Where each comes from, in the order of [`KEYS`].
    pub sources: [RangeSource; KEYS.len()],
}

impl Description {
    /// Range of the key with this path, in SI units; none where there is no such key.
    ///
    /// Of the crane file where it has one, else the key's default spread about its value. A default
    /// spread goes no further than the key allows, and only to machines that can exist; a file's range
    /// is as it stands there ([`warnings`](Self::warnings) has those that go too far). A program that
    /// moves a number beyond its file's range takes the range along.
    pub fn range(&self, path: &str) -> Option<ValueRange> {
        let index = KEYS.iter().position(|key| key.path() == path)?;
        Some(self.range_at(index))
    }

    /// Ranges of all numbers, each as by [`range`](Self::range).
    ///
    /// Each is a range for itself: the machine with all of them at their ends need not exist.
    pub fn ranges(&self) -> Ranges {
        let all: [ValueRange; KEYS.len()] = std::array::from_fn(|index| self.range_at(index));
        Ranges {
            low: Numbers::from_array(all.map(|range| range.low)),
            high: Numbers::from_array(all.map(|range| range.high)),
            sources: all.map(|range| range.source),
        }
    }

    /// Every key that a crane of this kind has, with its range in the key's own unit.
    pub fn own_ranges(&self) -> impl Iterator<Item = (&'static Key, [f64; 2], RangeSource)> {
        self.own_keys().map(|index| {
            let (key, range) = (&KEYS[index], self.range_at(index));
            (key, [key.to_unit(range.low), key.to_unit(range.high)], range.source)
        })
    }

    /// Overrides one key as [`set`](Self::set) does, within the crane file's range of the key, if it has
    /// one. A default spread follows the value.
    ///
    /// # Errors
    ///
    /// [`DescriptionError`] as of [`set`](Self::set), and when the value is outside the file's range.
    pub fn set_within_range(&mut self, assignment: &str) -> Result<(), DescriptionError> {
        self.set_together_within_range([assignment])
    }

    /// Overrides keys together as [`set_together`](Self::set_together) does, each within the crane file's range of it.
    ///
    /// # Errors
    ///
    /// As of [`set_within_range`](Self::set_within_range); nothing is overridden then.
    pub fn set_together_within_range<'a>(
        &mut self,
        assignments: impl IntoIterator<Item = &'a str>,
    ) -> Result<(), DescriptionError> {
        let all: Vec<&str> = assignments.into_iter().collect();
        all.iter().try_for_each(|assignment| self.is_within_range(assignment))?;
        self.set_together(all)
    }

    /// Whether the crane file's range has the value, if it has one.
    fn is_within_range(&self, assignment: &str) -> Result<(), DescriptionError> {
        let parts = assignment.split_once('=');
        let wanted = parts.and_then(|(path, text)| {
            let index = KEYS.iter().position(|key| key.path() == path.trim())?;
            let value = text.trim().trim_matches('"').parse::<f64>().ok()?;
            Some((index, value, self.file_ranges[index]?))
        });
        let Some((index, value, [low, high])) = wanted else { return Ok(()) };
        let key = &KEYS[index];
        if (low..=high).contains(&key.to_si(value)) {
            return Ok(());
        }
        let (path, unit) = (key.path(), key.unit);
        let [low, high] = [low, high].map(|bound| key.to_unit(bound));
        let help = match (self.is_embedded, self.origins[index].line) {
            (true, _) => "stay within; or write the embedded crane into a file by `hydroboom new my-crane.toml`, widen `range` there, and name it by --crane".into(),
            (false, Some(line)) => format!("stay within, or widen `range` in line {line} of the crane file"),
            (false, None) => "stay within, or widen `range` of the crane file".into(),
        };
        let whose = if self.is_embedded { "the embedded crane's" } else { "the crane file's" };
        Err(DescriptionError::of(
            &format!("--set {assignment}"),
            format!("{value} {unit} is outside {whose} range of {path}, {low} to {high} {unit}"),
            Some(help),
        ))
    }

    /// Ranges of the file that reach machines that cannot exist.
    pub(crate) fn impossible_ranges(&self) -> Vec<String> {
        let mut found = Vec::new();
        for (key, (index, range)) in KEYS.iter().zip(self.file_ranges.iter().enumerate()) {
            for bound in range.iter().flatten() {
                if let Some((_, message, _)) = self.with_number(index, *bound).impossible() {
                    let (path, bound, unit) = (key.path(), key.to_unit(*bound), key.unit);
                    found.push(format!("the range of {path} reaches {bound} {unit}: {message}"));
                }
            }
        }
        found
    }

    fn range_at(&self, index: usize) -> ValueRange {
        let key = &KEYS[index];
        let value = self.numbers.to_array()[index];
        if let Some([low, high]) = self.file_ranges[index] {
            let source = RangeSource::File;
            return ValueRange { low: low.min(value), high: high.max(value), source };
        }
        let segments = self.segment_shares.len();
        let is_own = self.choices.excludes(key.section, key.name, segments).is_none();
        let Some(spread) = spread::of(&key.path()).filter(|_| is_own) else {
            return ValueRange { low: value, high: value, source: RangeSource::Value };
        };
        let bounds = spread.width.around(key.to_unit(value));
        let [low, high] = bounds.map(|bound| {
            let bound = key.to_si(bound.max(key.low).min(key.high));
            if self.with_number(index, bound).impossible().is_some() { value } else { bound }
        });
        let (low, high) = (low.min(value), high.max(value));
        // nothing spreads an effect that is off
        let source = if low == high { RangeSource::Value } else { RangeSource::Default };
        ValueRange { low, high, source }
    }

    /// The same machine with another number, in SI units.
    pub(crate) fn with_number(&self, index: usize, value: f64) -> Self {
        let mut numbers = self.numbers.to_array();
        numbers[index] = value;
        Self { numbers: Numbers::from_array(numbers), ..self.clone() }
    }
}
