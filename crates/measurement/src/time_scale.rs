//! Conversion of sequential rows' times to seconds; the first rows are kept back until the unit can be determined.

use crate::heading::Heading;
use crate::time_column::TimeColumn;
use crate::time_unit::{interval, resolve};

/// Number of rows from which the unit is determined.
const FIRST: usize = 64;

/// Conversion of a time's numbers to seconds.
pub(crate) struct TimeScale {
    heading: String,
    read: Heading,
    stated: Option<TimeColumn>,
    /// Size of one unit as the format defines it \[s\].
    own: Option<f64>,
    /// Factor and offset to seconds; `None` until they are determined.
    seconds: Option<(f64, f64)>,
    held: Vec<(u64, Vec<f64>)>,
    /// Remark about the assumed unit.
    pub(crate) remark: Option<String>,
}

impl TimeScale {
    /// The conversion for a time with this heading: stated by a mapping, else by the format, else determined from
    /// numbers.
    pub(crate) fn new(
        heading: &str,
        read: &Heading,
        stated: Option<&TimeColumn>,
        own: Option<f64>,
    ) -> Self {
        Self {
            heading: heading.into(),
            read: read.clone(),
            stated: stated.cloned(),
            own,
            seconds: None,
            held: Vec::new(),
            remark: None,
        }
    }

    /// Adds a row whose first number is a logged time. Calls `each` with all rows whose time in seconds is now known,
    /// in order.
    ///
    /// # Errors
    ///
    /// As [`resolve`].
    pub(crate) fn push(
        &mut self,
        line: u64,
        row: &mut [f64],
        mut each: impl FnMut(u64, &[f64]),
    ) -> Result<(), String> {
        if let Some((factor, offset)) = self.seconds {
            row[0] = row[0] * factor + offset;
            each(line, row);
            return Ok(());
        }
        self.held.push((line, row.to_vec()));
        if self.held.len() < FIRST { Ok(()) } else { self.finish(each) }
    }

    /// Determines the unit without further rows, and calls `each` with the rows kept back.
    ///
    /// # Errors
    ///
    /// As [`resolve`].
    pub(crate) fn finish(&mut self, mut each: impl FnMut(u64, &[f64])) -> Result<(), String> {
        let held = std::mem::take(&mut self.held);
        let times: Vec<f64> = held.iter().map(|(_, row)| row[0]).collect();
        let Some(first) = times.first().copied() else { return Ok(()) };
        let stated = self.stated.as_ref();
        let (unit, remark) =
            resolve(&self.heading, &self.read, stated, self.own, first, interval(&times))?;
        self.remark = remark;
        let (scale, offset) = stated.map_or((1.0, 0.0), |s| (s.scale, s.offset));
        let (factor, offset) = (scale * unit, offset * unit);
        self.seconds = Some((factor, offset));
        for (line, mut row) in held {
            row[0] = row[0] * factor + offset;
            each(line, &row);
        }
        Ok(())
    }
}
