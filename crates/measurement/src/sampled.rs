//! Columns that were sampled together, as formats with whole arrays have them (MAT, MDF), on their way to channels.

use crate::channel::{Channel, Measurement};
use crate::dimension::Dimension;
use crate::error::MeasurementError;
use crate::heading::Heading;
use crate::time_column::TimeColumn;
use std::sync::Arc;

/// Times that are larger are counted from something far away, and are shown from the first one on \[s\].
const FAR: f64 = 1e7;
const DAY: f64 = 86_400.0;
/// MATLAB counts days from year 0: those of the years 1900 to 2100.
const DATENUM: std::ops::RangeInclusive<f64> = 693_962.0..=767_010.0;
/// A time that counts days has smaller intervals: 8.64 s. As seconds they would be those of a log that begins a week after its
/// clock did.
const DATENUM_INTERVAL: f64 = 1e-4;

/// A column.
#[derive(Clone, Debug)]
pub(crate) struct Column {
    heading: String,
    read: Heading,
    values: Vec<f64>,
}

/// Columns with the time that they share.
#[derive(Clone, Debug)]
pub(crate) struct Samples {
    pub(crate) time: Column,
    pub(crate) columns: Vec<Column>,
}

impl Column {
    /// A column, its unit from its heading.
    pub(crate) fn new(heading: &str, values: Vec<f64>) -> Self {
        Self { heading: heading.into(), read: Heading::parse(heading), values }
    }

    /// A column whose heading has been read.
    pub(crate) fn of(heading: &str, read: Heading, values: Vec<f64>) -> Self {
        Self { heading: heading.into(), read, values }
    }

    /// How many values it has.
    pub(crate) fn len(&self) -> usize {
        self.values.len()
    }
}

/// A log that is put together from columns.
pub(crate) struct Assembly<'a> {
    file: String,
    /// What a mapping says of the time.
    stated: Option<&'a TimeColumn>,
    channels: Vec<Channel>,
    remarks: Vec<String>,
    /// What times that are far away are counted from \[s\].
    begin: Option<f64>,
}

impl<'a> Assembly<'a> {
    pub(crate) fn new(file: &str, stated: Option<&'a TimeColumn>, remarks: Vec<String>) -> Self {
        Self { file: file.into(), stated, channels: Vec::new(), remarks, begin: None }
    }

    /// Says something about the log.
    pub(crate) fn remark(&mut self, text: String) {
        self.remarks.push(text);
    }

    /// Adds columns.
    ///
    /// # Errors
    ///
    /// [`MeasurementError::Time`] when their time goes back.
    pub(crate) fn add(&mut self, samples: Samples) -> Result<(), MeasurementError> {
        let Samples { time: Column { heading, read, values: mut time }, mut columns } = samples;
        // a row without a time is of no use
        let is_row: Vec<bool> = time.iter().map(|t| t.is_finite()).collect();
        let lost = is_row.iter().filter(|is| !**is).count();
        if lost > 0 {
            let keep = |values: &mut Vec<f64>| {
                let mut row = is_row.iter();
                values.retain(|_| row.next().is_some_and(|is| *is));
            };
            keep(&mut time);
            columns.iter_mut().for_each(|c| keep(&mut c.values));
            self.remarks.push(format!("{lost} rows have no time ({heading}) and are left out"));
        }
        if time.len() < 2 {
            self.remarks.push(format!("{heading} has {} values: no time", time.len()));
            return Ok(());
        }
        if let Some(stated) = self.stated {
            time.iter_mut().for_each(|t| *t = stated.scale * *t + stated.offset);
        }
        let stated = self.stated.and_then(|s| s.unit);
        let unit = stated.or(read.unit.filter(|u| u.dimension == Dimension::Time));
        let unit = match unit {
            Some(unit) => unit.factor,
            None if is_datenum(&read.name, &time) => {
                self.remarks.push(format!("{heading} counts days (datenum)"));
                DAY
            }
            None => 1.0,
        };
        if time[0] * unit > FAR && self.begin.is_none() {
            self.begin = Some(time[0] * unit);
            self.remarks.push("time is counted from the first sample".into());
        }
        let begin = self.begin.unwrap_or(0.0) / unit;
        if let Some(k) = time.windows(2).position(|w| w[1] < w[0]) {
            return Err(MeasurementError::Time {
                file: self.file.clone(),
                line: k as u64 + 2,
                column: heading,
                before: time[k],
                after: time[k + 1],
            });
        }
        time.iter_mut().for_each(|t| *t = (*t - begin) * unit);
        let time: Arc<[f64]> = time.into();
        for column in columns {
            let Column { heading, read, mut values } = column;
            values.resize(time.len(), f64::NAN);
            self.channels.push(Channel::of(read, &heading, Arc::clone(&time), values));
        }
        Ok(())
    }

    /// The log.
    ///
    /// # Errors
    ///
    /// [`MeasurementError::Format`] when no column was added, with what was left out.
    pub(crate) fn finish(mut self) -> Result<Measurement, MeasurementError> {
        if self.channels.is_empty() {
            let reason = match self.remarks.is_empty() {
                true => "it has no signal".into(),
                false => format!("it has no signal that can be used ({})", self.remarks.join("; ")),
            };
            return Err(MeasurementError::Format { file: self.file, reason });
        }
        number_repeated(&mut self.channels);
        Ok(Measurement { name: self.file, channels: self.channels, remarks: self.remarks })
    }
}

/// Headings that are there already get a number: `p`, `p#2`, `p#3`.
fn number_repeated(channels: &mut [Channel]) {
    let mut seen = std::collections::BTreeMap::<String, usize>::new();
    for channel in channels {
        let count = seen.entry(channel.heading.clone()).or_default();
        *count += 1;
        if *count > 1 {
            channel.heading = format!("{}#{count}", channel.heading);
        }
    }
}

fn is_datenum(name: &str, time: &[f64]) -> bool {
    let within = time.iter().all(|t| DATENUM.contains(t));
    let mut intervals: Vec<f64> = time.windows(2).map(|w| w[1] - w[0]).collect();
    let middle = intervals.len() / 2;
    let interval = *intervals.select_nth_unstable_by(middle, f64::total_cmp).1;
    name.to_lowercase().contains("datenum") || (within && interval.abs() < DATENUM_INTERVAL)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log(name: &str, time: &[f64]) -> Measurement {
        let mut assembly = Assembly::new("test", None, Vec::new());
        let time = Column::new(name, time.to_vec());
        let column = || Column::new("p_A_bar", vec![1.0; time.values.len()]);
        assembly.add(Samples { columns: vec![column(), column()], time: time.clone() }).unwrap();
        assembly.finish().unwrap()
    }

    #[test]
    fn times_are_seconds_from_what_their_unit_and_size_say() {
        let day = 739_000.0 + 0.25;
        for (name, time, wanted) in [
            ("t", [5.0, 6.0, 7.0], [5.0, 6.0, 7.0]),
            ("t_ms", [5.0, 6.0, 7.0], [5e-3, 6e-3, 7e-3]),
            ("t", [1.7e9, 1.7e9 + 0.5, 1.7e9 + 1.0], [0.0, 0.5, 1.0]),
            ("t", [day, day + 1.0 / 86_400.0, day + 2.0 / 86_400.0], [0.0, 1.0, 2.0]),
            ("datenum", [day, day + 1.0, day + 2.0], [0.0, DAY, 2.0 * DAY]),
            // seconds of a clock that ran for a week
            ("t", [739_000.0, 739_000.01, 739_000.02], [739_000.0, 739_000.01, 739_000.02]),
        ] {
            let log = log(name, &time);
            for (found, wanted) in log.channels[0].time.iter().zip(wanted) {
                assert!((found - wanted).abs() < 2e-5, "{name}: {found} for {wanted}");
            }
        }
    }

    #[test]
    fn rows_without_a_time_are_left_out_and_repeated_names_are_numbered() {
        let log = log("t", &[0.0, f64::NAN, 1.0]);
        assert_eq!(log.headings(), "p_A_bar, p_A_bar#2");
        assert_eq!(log.channels[0].values.len(), 2);
        assert!(log.remarks[0].contains("1 rows"), "{:?}", log.remarks);
    }
}
