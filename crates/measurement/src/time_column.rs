//! Source of the times of a log's rows.

use crate::dimension::Dimension;
use crate::unit::Unit;
use crate::unit_table::UNITS;

/// Source of the times of a log's rows, as a mapping states it: `time = unit (scale column + offset)`.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeColumn {
    /// Heading or name of the column.
    pub column: Option<String>,
    /// Unit of the column; `None` for the unit stated in the log.
    pub unit: Option<Unit>,
    /// Factor on the column, in the unit per unit of the column.
    pub scale: f64,
    /// Offset added to the scaled column, in the unit.
    pub offset: f64,
    /// Sampling interval \[s\] of a log without a time column; none with one.
    pub sample_time: Option<f64>,
    /// Whether column and unit were found by names, units and content and not stated by the user.
    pub is_guessed: bool,
}

impl TimeColumn {
    /// A time column found in the log, with the factor from its numbers to seconds, if it has numbers.
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
