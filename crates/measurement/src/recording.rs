//! Rows in the order of their times, divided into segments where the clock steps.
//!
//! A clock that is set back, jumps forward, or stands still while samples are lost begins a new segment. A few rows
//! with inconsistent times are left out if the rows after them continue those before.

use crate::error::MeasurementError;
use crate::thinning::Columns;

/// Number of rows from which the usual interval is determined.
const FIRST: usize = 64;
/// Number of successive rows with inconsistent times that begin a new segment; fewer are left out.
const HELD: usize = 16;
/// Ratio of an interval to the usual one above which it is a gap.
const GAP: f64 = 5.0;
/// Smallest time between segments \[s\], in place of a logged difference that is negative or above a day.
const AFTER: f64 = 1.0;
const DAY: f64 = 86_400.0;
/// Largest time \[s\]: three thousand years. Beyond it a double does not resolve the sampling interval.
const LARGEST: f64 = 1e11;
/// Largest number of segments; a column with more steps is not a time.
const MOST_SEGMENTS: usize = 10_000;
/// Largest number of segments that remarks list one by one.
const MOST_LISTED: usize = 5;

/// Beginning of a new segment.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Break {
    line: u64,
    /// Logged times before and after \[s\].
    logged: (f64, f64),
    /// Output time at the beginning of the segment \[s\].
    shown: f64,
}

struct Held {
    line: u64,
    row: Vec<f64>,
}

/// Sequential recording of rows; the first number of each is its time \[s\].
pub(crate) struct Recording {
    columns: Columns,
    /// Interval above which there is a gap \[s\].
    limit: f64,
    /// Time of the last row, as logged \[s\].
    last: Option<f64>,
    /// Difference of output time to logged time \[s\].
    shift: f64,
    /// Output time of the last row \[s\].
    shown: f64,
    held: Vec<Held>,
    is_begun: bool,
    breaks: Vec<Break>,
    /// Number of rows received.
    pub(crate) count: u64,
    repeated: u64,
    first_repeated: u64,
    strays: u64,
    first_stray: u64,
    jumps: u64,
}

/// Result of a recording.
pub(crate) struct Recorded {
    /// Times, increasing \[s\].
    pub(crate) time: Vec<f64>,
    /// The other columns.
    pub(crate) columns: Vec<Vec<f64>>,
    /// Rows at which a segment begins, without the first segment.
    pub(crate) breaks: Vec<usize>,
    /// Sentences about rows left out, repeated times and segments.
    pub(crate) remarks: Vec<String>,
}

impl Recording {
    /// A recording of `columns` columns besides the time, which keeps at most `most` numbers.
    pub(crate) fn new(columns: usize, most: usize) -> Self {
        Self {
            columns: Columns::new(columns + 1, most),
            limit: f64::INFINITY,
            last: None,
            shift: 0.0,
            shown: f64::NEG_INFINITY,
            held: Vec::new(),
            is_begun: false,
            breaks: Vec::new(),
            count: 0,
            repeated: 0,
            first_repeated: 0,
            strays: 0,
            first_stray: 0,
            jumps: 0,
        }
    }

    /// Adds a column; earlier rows have no value in it.
    pub(crate) fn add_column(&mut self) {
        self.columns.add_column();
    }

    /// Count of numbers kept if `more` columns were added.
    pub(crate) fn numbers_with(&self, more: usize) -> usize {
        self.columns.numbers_with(more)
    }

    /// Averages pairs of rows, those kept and those to come.
    pub(crate) fn halve(&mut self) {
        self.columns.halve();
    }

    /// Adds a row: its time \[s\], then the other columns. The time must not be missing.
    pub(crate) fn push(&mut self, line: u64, row: &[f64]) {
        self.count += 1;
        if row[0].abs() > LARGEST {
            self.first_stray = if self.strays == 0 { line } else { self.first_stray };
            self.strays += 1;
            return;
        }
        // too many steps for a time: `finish` returns the error, and nothing more is kept
        if self.jumps as usize > MOST_SEGMENTS {
            return;
        }
        if self.is_begun {
            self.place(line, row);
            return;
        }
        self.held.push(Held { line, row: row.to_vec() });
        if self.held.len() >= FIRST {
            self.begin();
        }
    }

    /// Starts recording once the usual interval is known.
    fn begin(&mut self) {
        self.is_begun = true;
        let first = std::mem::take(&mut self.held);
        if let Some(limit) = gap(&first) {
            self.limit = limit;
        }
        for Held { line, row } in first {
            self.place(line, &row);
        }
    }

    fn place(&mut self, line: u64, row: &[f64]) {
        let time = row[0];
        let Some(last) = self.last else { return self.take(line, row) };
        let step = time - last;
        let goes_on = step > 0.0 && step <= self.limit;
        match (goes_on, self.held.is_empty()) {
            (true, true) => self.take(line, row),
            (true, false) => {
                self.left_out();
                self.take(line, row);
            }
            (false, true) if step == 0.0 => self.repeat(line),
            // the pending rows follow a gap: the clock has continued meanwhile
            (false, _) => {
                self.held.push(Held { line, row: row.to_vec() });
                if self.held.len() >= HELD {
                    self.new_segment();
                }
            }
        }
    }

    /// Handles a row with the time of the row before.
    fn repeat(&mut self, line: u64) {
        if self.repeated == 0 {
            self.first_repeated = line;
        }
        self.repeated += 1;
    }

    fn take(&mut self, line: u64, row: &[f64]) {
        let time = row[0];
        self.last = Some(time);
        let shown = time + self.shift;
        // a huge time does not resolve a small step
        if shown <= self.shown {
            return self.repeat(line);
        }
        self.shown = shown;
        if self.shift == 0.0 {
            return self.columns.push(row);
        }
        let mut shifted = row.to_vec();
        shifted[0] = shown;
        self.columns.push(&shifted);
    }

    /// Leaves out the pending rows.
    fn left_out(&mut self) {
        if self.strays == 0 {
            self.first_stray = self.held.first().map_or(0, |h| h.line);
        }
        self.strays += self.held.len() as u64;
        self.held.clear();
    }

    /// Begins a segment with the first pending row.
    fn new_segment(&mut self) {
        let held = std::mem::take(&mut self.held);
        let (Some(first), Some(last)) = (held.first(), self.last) else { return };
        let (time, line) = (first.row[0], first.line);
        let step = time - last;
        if step <= 0.0 || step > DAY {
            let after = if self.limit.is_finite() { AFTER.max(2.0 * self.limit) } else { AFTER };
            self.shift += last + after - time;
        }
        self.jumps += 1;
        if self.breaks.len() < MOST_LISTED {
            self.breaks.push(Break { line, logged: (last, time), shown: time + self.shift });
        }
        self.columns.begin_segment();
        if let Some(limit) = gap(&held) {
            self.limit = limit;
        }
        self.last = None;
        for Held { line, row } in held {
            self.place(line, &row);
        }
    }

    /// Finishes the recording. `unit` names the rows in messages: "line", "row", "message".
    ///
    /// # Errors
    ///
    /// [`MeasurementError::Format`] if the time has too many steps.
    pub(crate) fn finish(mut self, file: &str, unit: &str) -> Result<Recorded, MeasurementError> {
        if !self.is_begun {
            self.begin();
        }
        let times: Vec<f64> = self.held.iter().map(|h| h.row[0]).collect();
        let goes_on = times.windows(2).all(|w| w[1] > w[0] && w[1] - w[0] <= self.limit);
        match goes_on && times.len() >= 2 {
            true => self.new_segment(),
            false => self.left_out(),
        }
        // rows that became pending again while they were placed
        self.left_out();
        if self.jumps as usize > MOST_SEGMENTS {
            let reason = format!(
                "its time goes back or jumps {} times: is the column one of times? Name another ([log] time = \"...\" in a mapping), or count rows (--sample-time-ms)",
                self.jumps
            );
            return Err(MeasurementError::Format { file: file.into(), reason });
        }
        let remarks = self.remarks(unit);
        let (mut columns, breaks) = self.columns.finish();
        let time = if columns.is_empty() { Vec::new() } else { columns.remove(0) };
        Ok(Recorded { time, columns, breaks, remarks })
    }

    fn remarks(&self, unit: &str) -> Vec<String> {
        let mut said = Vec::new();
        for b in &self.breaks {
            let (before, after) = b.logged;
            let how = match after - before {
                step if step <= 0.0 => "the clock goes back",
                _ => "samples are missing, or the clock jumps,",
            };
            let shown = match (b.shown - after).abs() > 1e-9 * after.abs().max(1.0) {
                true => format!(", shown from {:.3} s on", b.shown),
                false => String::new(),
            };
            said.push(format!(
                "{how} from {before:.3} to {after:.3} s at {unit} {}: a new segment{shown}",
                b.line
            ));
        }
        let more = self.jumps.saturating_sub(self.breaks.len() as u64);
        if more > 0 {
            said.push(format!("{more} more segments begin later"));
        }
        if self.strays > 0 {
            said.push(format!(
                "{} rows whose time is out of order, first at {unit} {}, are left out",
                self.strays, self.first_stray
            ));
        }
        if self.repeated > 0 {
            said.push(format!(
                "{} rows repeat the time of the one before, first at {unit} {}: the first of each counts",
                self.repeated, self.first_repeated
            ));
        }
        if self.columns.stride > 1
            && let Some(usual) = (self.limit.is_finite()).then_some(self.limit / GAP)
        {
            let stride = self.columns.stride;
            let span = usual * stride as f64;
            said.push(format!(
                "{} rows are too many to keep: each {stride} are averaged, over {:.3} ms, which halves the power at {:.3} Hz; what is faster is attenuated and aliased",
                self.count,
                span * 1e3,
                0.443 / span
            ));
        }
        said
    }
}

/// Longest interval within a segment \[s\]: 5 times the 90th percentile of the intervals; `None` if no time increases.
fn gap(rows: &[Held]) -> Option<f64> {
    let steps = rows.windows(2).map(|w| w[1].row[0] - w[0].row[0]);
    let mut steps: Vec<f64> = steps.filter(|step| *step > 0.0).collect();
    if steps.is_empty() {
        return None;
    }
    let most = (steps.len() * 9 / 10).min(steps.len() - 1);
    Some(GAP * *steps.select_nth_unstable_by(most, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recorded(times: impl IntoIterator<Item = f64>) -> Recorded {
        let mut recording = Recording::new(1, 1_000_000);
        for (k, time) in times.into_iter().enumerate() {
            recording.push(k as u64 + 1, &[time, k as f64]);
        }
        recording.finish("log", "line").unwrap()
    }

    fn even(from: f64, count: u32) -> impl Iterator<Item = f64> {
        (0..count).map(move |k| from + f64::from(k) * 0.01)
    }

    #[test]
    fn a_clock_adjustment_starts_a_segment() {
        for (second, kind) in [(3600.0, "jumps"), (0.0, "goes back"), (1.7e9, "jumps")] {
            let all = recorded(even(0.0, 500).chain(even(second, 500)));
            assert_eq!(all.breaks, [500], "{second}");
            assert_eq!(all.time.len(), 1000);
            assert!(all.time.windows(2).all(|w| w[1] > w[0]));
            assert!((all.time[999] - all.time[500] - 4.99).abs() < 1e-6);
            assert!(all.remarks.len() == 1 && all.remarks[0].contains(kind), "{:?}", all.remarks);
        }
        // a gap shortly before the end of the log
        let all = recorded(even(0.0, 500).chain(even(5.5, 5)));
        assert_eq!((all.breaks, all.time.len()), (vec![500], 505));
    }

    #[test]
    fn rows_with_stray_times_are_left_out_and_reported() {
        let stray = |time: f64| {
            let mut times: Vec<f64> = even(0.0, 500).collect();
            times[300] = time;
            recorded(times)
        };
        for time in [2.9899, 0.0, 999.0, 1.7e9, -7.9e21] {
            let all = stray(time);
            assert_eq!(all.time.len(), 499, "{time}");
            assert!(all.breaks.is_empty() && !all.columns[0].contains(&300.0));
            assert!(
                all.remarks[0].contains("1 rows whose time is out of order, first at line 301")
            );
        }
        let all = recorded(even(0.0, 300).flat_map(|t| [t, t]));
        assert_eq!(all.time.len(), 300);
        // the first of each pair with the same time
        assert_eq!(all.columns[0][7], 14.0);
        assert!(all.remarks[0].contains("300 rows repeat"), "{:?}", all.remarks);
    }

    #[test]
    fn a_change_of_rate_adds_exactly_one_segment() {
        let slow = (0..200).map(|k| 5.0 + f64::from(k) * 0.5);
        let all = recorded(even(0.0, 500).chain(slow));
        assert_eq!(all.breaks.len(), 1, "{:?}", all.remarks);
        assert_eq!(all.time.len(), 700);
        // the varying step size of a solver is no gap
        let solver = (0..300).scan(0.0, |t, k| {
            *t += if k % 4 == 0 { 0.04 } else { 0.01 };
            Some(*t)
        });
        assert!(recorded(solver).breaks.is_empty());
    }

    #[test]
    fn a_column_that_is_no_time_is_refused() {
        let mut recording = Recording::new(0, 1000);
        for k in 0..2_000_000_u32 {
            recording.push(1, &[f64::from((k.wrapping_mul(2_654_435_761)) >> 8)]);
        }
        let error = recording.finish("noise.csv", "line").err().map(|e| e.to_string());
        assert!(error.is_some_and(|e| e.contains("is the column one of times?")));
    }
}
