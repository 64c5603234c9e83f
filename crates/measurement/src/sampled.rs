//! Columns that were sampled together, from formats with whole arrays (MAT, MDF), and their conversion to channels.

use crate::channel::{Channel, Measurement};
use crate::error::MeasurementError;
use crate::heading::Heading;
use crate::recording::{Recorded, Recording};
use crate::time_column::TimeColumn;
use crate::time_unit::{FAR, interval, resolve};
use std::sync::Arc;

/// A column.
#[derive(Clone, Debug)]
pub(crate) struct Column {
    heading: String,
    read: Heading,
    values: Vec<f64>,
}

/// Columns with a common time.
#[derive(Clone, Debug)]
pub(crate) struct Samples {
    pub(crate) time: Column,
    pub(crate) columns: Vec<Column>,
}

impl Column {
    /// A column whose unit is in its heading.
    pub(crate) fn new(heading: &str, values: Vec<f64>) -> Self {
        Self { heading: heading.into(), read: Heading::parse(heading), values }
    }

    /// A column with a parsed heading.
    pub(crate) fn of(heading: &str, read: Heading, values: Vec<f64>) -> Self {
        Self { heading: heading.into(), read, values }
    }

    /// Number of values.
    pub(crate) fn len(&self) -> usize {
        self.values.len()
    }
}

/// Builder of a log from columns.
pub(crate) struct Assembly<'a> {
    file: String,
    /// The mapping's statements about the time.
    stated: Option<&'a TimeColumn>,
    channels: Vec<Channel>,
    remarks: Vec<String>,
    /// Origin of times that are far from zero \[s\].
    begin: Option<f64>,
    /// The time columns found.
    times: Vec<TimeColumn>,
}

impl<'a> Assembly<'a> {
    pub(crate) fn new(file: &str, stated: Option<&'a TimeColumn>, remarks: Vec<String>) -> Self {
        Self {
            file: file.into(),
            stated,
            channels: Vec::new(),
            remarks,
            begin: None,
            times: Vec::new(),
        }
    }

    /// Adds a remark about the log.
    pub(crate) fn remark(&mut self, text: String) {
        self.remarks.push(text);
    }

    /// Adds columns with their common time.
    ///
    /// # Errors
    ///
    /// [`MeasurementError`] if that column is not a time.
    pub(crate) fn add(&mut self, samples: Samples) -> Result<(), MeasurementError> {
        let Samples { time: Column { heading, read, values: mut time }, columns } = samples;
        let found = time.iter().filter(|t| t.is_finite()).count();
        if found < 2 {
            self.remark(format!("{heading} has {found} numbers: it is no time"));
            return Ok(());
        }
        if let Some(stated) = self.stated {
            time.iter_mut().for_each(|t| *t = stated.scale * *t + stated.offset);
        }
        let unit = self.unit(&heading, &read, &time)?;
        self.times.push(TimeColumn::found(&heading, Some(unit)));
        let begin = self.begin(time.iter().copied().find(|t| t.is_finite()).unwrap_or(0.0) * unit);
        // determines which samples are kept, and their times
        let mut recording = Recording::new(1, usize::MAX);
        for (k, number) in time.iter().enumerate().filter(|(_, t)| t.is_finite()) {
            recording.push(k as u64 + 1, &[(number - begin / unit) * unit, k as f64]);
        }
        if found < time.len() {
            let lost = time.len() - found;
            self.remark(format!("{lost} samples have no time ({heading}) and are left out"));
        }
        let mut recorded = recording.finish(&self.file, &format!("sample (of {heading})"))?;
        let kept = recorded.columns.pop().unwrap_or_default();
        let is_whole = kept.len() == time.len();
        drop(time);
        let chosen = |values: Vec<f64>| match is_whole {
            true => values,
            false => {
                let value = |k: &f64| values.get(*k as usize).copied().unwrap_or(f64::NAN);
                kept.iter().map(value).collect()
            }
        };
        let (headings, values): (Vec<_>, Vec<_>) =
            columns.into_iter().map(|c| ((c.heading, c.read), chosen(c.values))).unzip();
        self.add_recorded(headings, Recorded { columns: values, ..recorded });
        Ok(())
    }

    /// Adds columns that were recorded row by row.
    pub(crate) fn add_recorded(&mut self, headings: Vec<(String, Heading)>, recorded: Recorded) {
        self.remarks.extend(recorded.remarks);
        let Some(first) = recorded.time.first().copied() else { return };
        if recorded.time.len() < 2 {
            return;
        }
        let mut time = recorded.time;
        let begin = self.begin(first);
        if first.abs() > FAR && begin != 0.0 {
            time.iter_mut().for_each(|t| *t -= begin);
        }
        let (time, breaks): (Arc<[f64]>, Arc<[usize]>) = (time.into(), recorded.breaks.into());
        for ((heading, read), mut values) in headings.into_iter().zip(recorded.columns) {
            values.resize(time.len(), f64::NAN);
            let channel = Channel::of(read, &heading, Arc::clone(&time), values);
            self.channels.push(channel.broken_at(Arc::clone(&breaks)));
        }
    }

    /// Origin of the times \[s\]: zero, or the first time if that is far from zero.
    fn begin(&mut self, first: f64) -> f64 {
        if first.abs() > FAR && self.begin.is_none() {
            self.begin = Some(first);
            self.remark("time is counted from the first sample".into());
        }
        if first.abs() > FAR { self.begin.unwrap_or(0.0) } else { 0.0 }
    }

    /// Size of one unit of a time's numbers \[s\].
    fn unit(
        &mut self,
        heading: &str,
        read: &Heading,
        time: &[f64],
    ) -> Result<f64, MeasurementError> {
        let there: Vec<f64> = time.iter().copied().filter(|t| t.is_finite()).take(2000).collect();
        let first = there.first().copied().unwrap_or(0.0);
        let (factor, remark) =
            resolve(heading, read, self.stated, None, first, interval(&there))
                .map_err(|reason| MeasurementError::Mapping { file: self.file.clone(), reason })?;
        self.remarks.extend(remark);
        Ok(factor)
    }

    /// The finished log.
    ///
    /// # Errors
    ///
    /// [`MeasurementError::Format`] if no column was added, with the parts left out.
    pub(crate) fn finish(self) -> Result<Measurement, MeasurementError> {
        if self.channels.is_empty() {
            let reason = match self.remarks.is_empty() {
                true => "it has no signal".into(),
                false => format!("it has no signal that can be used ({})", self.remarks.join("; ")),
            };
            return Err(MeasurementError::Format { file: self.file, reason });
        }
        let Self { file: name, channels, remarks, mut times, .. } = self;
        let time = times.pop().filter(|_| times.is_empty());
        Ok(Measurement { name, channels, remarks, time })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time_unit::DAY;

    fn log(name: &str, time: &[f64]) -> Measurement {
        let mut assembly = Assembly::new("test", None, Vec::new());
        let time = Column::new(name, time.to_vec());
        let values: Vec<f64> = (0..time.len()).map(|k| k as f64).collect();
        let column = || Column::new("p_A_bar", values.clone());
        assembly.add(Samples { columns: vec![column(), column()], time: time.clone() }).unwrap();
        assembly.finish().unwrap()
    }

    #[test]
    fn times_are_converted_to_seconds_by_unit_and_magnitude() {
        let day = 739_000.0 + 0.25;
        for (name, time, wanted) in [
            ("t", [5.0, 6.0, 7.0], [5.0, 6.0, 7.0]),
            ("t_ms", [5.0, 6.0, 7.0], [5e-3, 6e-3, 7e-3]),
            ("t", [1.7e9, 1.7e9 + 0.5, 1.7e9 + 1.0], [0.0, 0.5, 1.0]),
            ("t", [1.7e12, 1.7e12 + 500.0, 1.7e12 + 1000.0], [0.0, 0.5, 1.0]),
            ("t", [day, day + 1.0 / DAY, day + 2.0 / DAY], [0.0, 1.0, 2.0]),
            // before 1970, or a countdown to an event
            ("t_s", [-2e9, -2e9 + 0.5, -2e9 + 1.0], [0.0, 0.5, 1.0]),
            ("datenum", [day, day + 1.0, day + 2.0], [0.0, DAY, 2.0 * DAY]),
            // a clock that has counted seconds for a week
            ("t", [739_000.0, 739_000.01, 739_000.02], [739_000.0, 739_000.01, 739_000.02]),
        ] {
            let log = log(name, &time);
            for (found, wanted) in log.channels[0].time.iter().zip(wanted) {
                assert!((found - wanted).abs() < 2e-5, "{name}: {found} for {wanted}");
            }
        }
    }

    #[test]
    fn a_time_with_an_unknown_unit_or_one_of_no_time_is_refused() {
        for (name, wanted) in
            [("t [ticks]", "\"ticks\" is no known unit"), ("x_mm", "mm is a length, not a time")]
        {
            let mut assembly = Assembly::new("test", None, Vec::new());
            let time = Column::new(name, vec![0.0, 1.0, 2.0]);
            let columns = vec![Column::new("p_A_bar", vec![0.0; 3])];
            let message = assembly.add(Samples { columns, time }).unwrap_err().to_string();
            assert!(message.contains(wanted) && message.contains("[log.time]"), "{message}");
        }
    }

    #[test]
    fn samples_without_a_time_and_repeated_ones_are_left_out() {
        let log = log("t_s", &[0.0, f64::NAN, 1.0, 1.0, 2.0]);
        assert_eq!(log.headings(), "p_A_bar#1, p_A_bar#2");
        assert_eq!(log.channels[0].values, [0.0, 2.0, 4.0]);
        assert!(log.remarks.iter().any(|r| r.contains("1 samples")), "{:?}", log.remarks);
        assert!(log.remarks.iter().any(|r| r.contains("repeat")), "{:?}", log.remarks);
    }

    #[test]
    fn a_clock_set_back_starts_a_segment() {
        let once = || (0..100).map(|k| f64::from(k) * 0.01);
        let time: Vec<f64> = once().chain(once()).collect();
        let log = log("t_s", &time);
        assert_eq!(*log.channels[0].breaks, [100]);
        assert_eq!(log.channels[0].values.len(), 200);
    }
}
