//! Sampling times of messages: their log time, or a field of the message.

use crate::path;
use crate::recording::Recording;
use crate::time_column::TimeColumn;
use crate::time_scale::TimeScale;

/// [`crate::time_unit::FAR`] in whole seconds.
const FAR: i64 = crate::time_unit::FAR as i64;

/// Time base shared by all messages.
pub(super) struct Clock<'a> {
    /// The time field that a mapping names.
    stated: Option<(&'a TimeColumn, &'a str)>,
    /// Origin: zero, or the first time if that is far from zero. Seconds and nanoseconds, so that no digit is lost.
    begin: Option<(i64, i64)>,
}

/// Sampling time of a message.
pub(super) enum Stamp {
    /// Seconds and nanoseconds.
    Exact(i64, i64),
    /// A number, in the unit of the field.
    Number(f64),
}

impl<'a> Clock<'a> {
    pub(super) fn new(time: Option<&'a TimeColumn>) -> Self {
        let stated = time.and_then(|t| Some((t, t.column.as_deref()?)));
        Self { stated, begin: None }
    }

    /// The sampling time of a message; `None` if it lacks the time field.
    pub(super) fn stamp(
        &self,
        log_time: u64,
        field: impl Fn(&str) -> Option<f64>,
    ) -> Option<Stamp> {
        let Some((stated, column)) = self.stated else {
            let nanoseconds = (log_time % 1_000_000_000) as i64;
            return Some(Stamp::Exact((log_time / 1_000_000_000) as i64, nanoseconds));
        };
        // a ROS stamp has two parts
        let parts = field(&format!("{column}.sec")).zip(field(&format!("{column}.nanosec")));
        match parts {
            Some((seconds, nanoseconds)) if stated.scale == 1.0 && stated.offset == 0.0 => {
                Some(Stamp::Exact(seconds as i64, nanoseconds as i64))
            }
            Some((seconds, nanoseconds)) => {
                let seconds = stated.scale * (seconds + nanoseconds * 1e-9) + stated.offset;
                let whole = seconds.floor();
                Some(Stamp::Exact(whole as i64, ((seconds - whole) * 1e9) as i64))
            }
            None => field(column).map(Stamp::Number),
        }
    }

    /// Conversion of the time field's numbers to seconds.
    pub(super) fn scale(&self) -> TimeScale {
        let column = self.stated.map_or("", |(_, column)| column);
        TimeScale::new(column, &path::heading(column), self.stated.map(|(stated, _)| stated), None)
    }

    /// A time relative to the origin \[s\].
    pub(super) fn time(&mut self, seconds: i64, nanoseconds: i64) -> Option<f64> {
        let far = if seconds.saturating_abs() > FAR { (seconds, nanoseconds) } else { (0, 0) };
        let begin = *self.begin.get_or_insert(far);
        // a single division, so that the time equals its decimal text parsed as a double
        let whole = i128::from(seconds.checked_sub(begin.0)?) * 1_000_000_000;
        Some((whole + i128::from(nanoseconds.checked_sub(begin.1)?)) as f64 / 1e9)
    }

    /// Records a row whose first number is a time in seconds.
    pub(super) fn record(&mut self, recording: &mut Recording, line: u64, row: &[f64]) {
        let whole = row[0].floor();
        let nanoseconds = ((row[0] - whole) * 1e9) as i64;
        if let Some(time) = self.time(whole as i64, nanoseconds) {
            let mut row = row.to_vec();
            row[0] = time;
            recording.push(line, &row);
        }
    }

    /// Whether the origin is far from zero.
    pub(super) fn is_far(&self) -> bool {
        self.begin.is_some_and(|begin| begin != (0, 0))
    }
}
