//! How the time of a log's rows is found.

use crate::dimension::Dimension;
use crate::unit::Unit;
use crate::unit_table::UNITS;

/// How the time of a log's rows is found, where a mapping says so: `time = unit (scale column + offset)`.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeColumn {
    /// Heading or name of the column.
    pub column: Option<String>,
    /// Its unit; the one that the log states where none.
    pub unit: Option<Unit>,
    /// What the column is multiplied by.
    pub scale: f64,
    /// What is added then, in the unit.
    pub offset: f64,
    /// Interval of rows \[s\], where no column tells their time.
    pub sample_time: Option<f64>,
    /// Whether column and unit were found by names, units and content, and stated by nobody.
    pub is_guessed: bool,
}

impl TimeColumn {
    /// A column that was found, and the factor from its numbers to seconds, where it has numbers.
    pub(crate) fn found(heading: &str, factor: Option<f64>) -> Self {
        let is_it = |u: &&Unit| u.dimension == Dimension::Time && Some(u.factor) == factor;
        let unit = UNITS.iter().find(is_it).copied();
        Self { column: Some(heading.into()), unit, is_guessed: true, ..Self::default() }
    }
}

impl Default for TimeColumn {
    fn default() -> Self {
        Self {
            column: None,
            unit: None,
            scale: 1.0,
            offset: 0.0,
            sample_time: None,
            is_guessed: false,
        }
    }
}
