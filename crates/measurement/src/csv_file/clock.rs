//! Cells of rows as times.

use super::cell::{Cell, Stamp};
use super::times::Source;
use crate::time_unit::DAY;

/// Turns the cells of rows into times \[s\].
pub(super) struct Clock {
    source: Source,
    count: u64,
    /// Day of the first stamp.
    day: Option<i64>,
    /// Seconds of the day of the last stamp.
    last: f64,
    /// Days that a clock without a date went on \[s\].
    days_on: f64,
}

impl Clock {
    pub(super) fn new(source: Source) -> Self {
        Self { source, count: 0, day: None, last: f64::NEG_INFINITY, days_on: 0.0 }
    }

    /// The time of a row \[s\]; none where it has none. `origin` is what far times of the table are counted from \[s\].
    pub(super) fn time(&mut self, row: &[Cell], origin: &mut Option<f64>) -> Option<f64> {
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
                // the difference first: a number since 1970 has no digits left for parts of a second
                let zero = *origin.get_or_insert(number * factor + offset);
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
                        let first = *self.day.get_or_insert(day);
                        let time = (day - first) as f64 * DAY + seconds;
                        let zero = *origin.get_or_insert(time);
                        Some(time - zero)
                    }
                    // a time of the day goes on after midnight
                    None => {
                        if self.last - seconds > 0.5 * DAY {
                            self.days_on += DAY;
                        }
                        self.last = seconds;
                        let time = seconds + self.days_on;
                        let zero = *origin.get_or_insert(time);
                        Some(time - zero)
                    }
                }
            }
        }
    }
}
