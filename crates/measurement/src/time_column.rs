//! How the time of a log's rows is found.

use crate::unit::Unit;

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
}

impl Default for TimeColumn {
    fn default() -> Self {
        Self { column: None, unit: None, scale: 1.0, offset: 0.0, sample_time: None }
    }
}
