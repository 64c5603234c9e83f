//! Conversion of the cells of rows to times.

use super::cell::{Cell, Stamp};
use super::times::Source;
use crate::time_unit::DAY;

/// Origin of the times of a table that are far from zero; shared by all its clocks.
#[derive(Default)]
pub(super) struct Origin {
    /// Day of the first stamp that has a date.
    day: Option<i64>,
    /// The first time \[s\], from that day on where it has a date.
    pub(super) zero: Option<f64>,
}

/// Converts the cells of rows to times \[s\].
pub(super) struct Clock {
    source: Source,
    count: u64,
    /// Seconds of the day of the last stamp.
    last: Option<f64>,
    /// Duration of the days that have passed for a clock without a date \[s\].
    days_on: f64,
}

impl Clock {
    pub(super) fn new(source: Source) -> Self {
        Self { source, count: 0, last: None, days_on: 0.0 }
    }

    /// The time of a row \[s\]; `None` if its cells hold no time.
    pub(super) fn time(&mut self, row: &[Cell], origin: &mut Origin) -> Option<f64> {
        let cell = |k: usize| row.get(k).copied().unwrap_or(Cell::Missing);
        match self.source {
            Source::Counted { interval } => {
                self.count += 1;
                Some((self.count - 1) as f64 * interval)
            }
            Source::Number { column, factor, offset, is_far } => {
                let Cell::Number(number) = cell(column) else { return None };
                if !is_far {
                    return Some(number * factor + offset);
                }
                // subtracts first: a double of seconds since 1970 does not resolve fine fractions of a second
                let zero = *origin.zero.get_or_insert(number * factor + offset);
                Some((number - (zero - offset) / factor) * factor)
            }
            Source::Stamp { column, date } => {
                let Cell::Stamp(Stamp { day, seconds }) = cell(column) else { return None };
                let beside = match date.map(cell) {
                    Some(Cell::Stamp(stamp)) => stamp.day,
                    _ => None,
                };
                let seconds = seconds.unwrap_or(0.0);
                match day.or(beside) {
                    Some(day) => {
                        let first = *origin.day.get_or_insert(day);
                        let time = (day - first) as f64 * DAY + seconds;
                        let zero = *origin.zero.get_or_insert(time);
                        Some(time - zero)
                    }
                    // a time of day that decreases has passed midnight
                    None => {
                        let zero = *origin.zero.get_or_insert(seconds);
                        if self.last.unwrap_or(zero) - seconds > 0.5 * DAY {
                            self.days_on += DAY;
                        }
                        self.last = Some(seconds);
                        let time = seconds + self.days_on;
                        Some(time - zero)
                    }
                }
            }
        }
    }
}
