//! Times in seconds of rows that come one after the other: the first rows are held until their numbers tell what they count.

use crate::heading::Heading;
use crate::time_column::TimeColumn;
use crate::time_unit::{interval, resolve};

/// Rows from which the unit is judged.
const FIRST: usize = 64;

/// From the numbers of a time to seconds.
pub(crate) struct TimeScale {
    heading: String,
    read: Heading,
    stated: Option<TimeColumn>,
    /// One of its numbers, where the format says so \[s\].
    own: Option<f64>,
    /// What a number is multiplied by, and what is added then \[s\]; none while it is not known.
    seconds: Option<(f64, f64)>,
    held: Vec<(u64, Vec<f64>)>,
    /// What is to be said of it.
    pub(crate) remark: Option<String>,
}

impl TimeScale {
    /// The scale of a time that is called so, as a mapping states it, else as the format says, else as its numbers tell.
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

    /// Adds a row, whose first number is a time as it was logged. Calls with each row whose time is known in seconds now, in order.
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

    /// No more rows come before the unit is judged: calls with those that are held.
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
