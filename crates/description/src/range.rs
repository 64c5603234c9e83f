//! Ranges of values, from a crane file or from default spreads.

use crate::schema::{KEYS, Key, Numbers};
use crate::{Description, DescriptionError, spread};

/// Source of a range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RangeSource {
    /// The crane file.
    File,
    /// The key's default spread about its value.
    Default,
    /// No source: the key has no default spread, so the range contains only its value.
    Value,
}

impl RangeSource {
    /// Name of the source: in tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::File => "file",
            Self::Default => "default",
            Self::Value => "value",
        }
    }
}

/// Range of plausible values of a number, in SI units. It contains the current value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValueRange {
    /// Smallest value, in SI units.
    pub low: f64,
    /// Largest value, in SI units.
    pub high: f64,
    /// Source of this range.
    pub source: RangeSource,
}

/// Ranges of plausible values of all numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranges {
    /// Smallest values, in SI units.
    pub low: Numbers<f64>,
    /// Largest values, in SI units.
    pub high: Numbers<f64>,
    /// Source of each range, in the order of [`KEYS`].
    pub sources: [RangeSource; KEYS.len()],
}

impl Description {
    /// Range of the key with this path, in SI units; `None` for an unknown key.
    ///
    /// The source is the crane file, or else the key's default spread about its value. A default spread is clipped to
    /// the key's limits and to possible machines. A file's range is not ([`warnings`](Self::warnings) lists those
    /// that are too wide). A value set beyond its file's range extends the range.
    pub fn range(&self, path: &str) -> Option<ValueRange> {
        let index = KEYS.iter().position(|key| key.path() == path)?;
        Some(self.range_at(index))
    }

    /// Ranges of all numbers, each as in [`range`](Self::range).
    ///
    /// Ranges are independent: the machine with all numbers at their ends may be impossible.
    pub fn ranges(&self) -> Ranges {
        let all: [ValueRange; KEYS.len()] = std::array::from_fn(|index| self.range_at(index));
        Ranges {
            low: Numbers::from_array(all.map(|range| range.low)),
            high: Numbers::from_array(all.map(|range| range.high)),
            sources: all.map(|range| range.source),
        }
    }

    /// Keys of this kind of crane, with the range in the key's own unit and its source.
    pub fn own_ranges(&self) -> impl Iterator<Item = (&'static Key, [f64; 2], RangeSource)> {
        self.own_keys().map(|index| {
            let (key, range) = (&KEYS[index], self.range_at(index));
            (key, [key.to_unit(range.low), key.to_unit(range.high)], range.source)
        })
    }

    /// Overrides one key as [`set`](Self::set) does, if the value is within the crane file's range. A key without a
    /// range in the file is not limited.
    ///
    /// # Errors
    ///
    /// [`DescriptionError`] as for [`set`](Self::set), and if the value is outside the file's range.
    pub fn set_within_range(&mut self, assignment: &str) -> Result<(), DescriptionError> {
        self.set_together_within_range([assignment])
    }

    /// Overrides several keys as [`set_together`](Self::set_together) does, each within its range of the crane file.
    ///
    /// # Errors
    ///
    /// As for [`set_within_range`](Self::set_within_range); no key is changed then.
    pub fn set_together_within_range<'a>(
        &mut self,
        assignments: impl IntoIterator<Item = &'a str>,
    ) -> Result<(), DescriptionError> {
        let all: Vec<&str> = assignments.into_iter().collect();
        all.iter().try_for_each(|assignment| self.is_within_range(assignment))?;
        self.set_together(all)
    }

    /// Checks that the value is within the crane file's range, if there is one.
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

    /// Ranges of the file that include impossible machines.
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
        // an effect that is off has no spread
        let source = if low == high { RangeSource::Value } else { RangeSource::Default };
        ValueRange { low, high, source }
    }

    /// The same machine with one number changed, in SI units.
    pub(crate) fn with_number(&self, index: usize, value: f64) -> Self {
        let mut numbers = self.numbers.to_array();
        numbers[index] = value;
        Self { numbers: Numbers::from_array(numbers), ..self.clone() }
    }
}
