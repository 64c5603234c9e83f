//! Options that assign columns of a log to signals.

use crate::crane_file::text_of;
use crate::number;
use crate::origin;
use crate::paths::InputFile;
use clap::Args;
use hydroboom_description::Description;
use hydroboom_description::schema::CircuitChoice;
use hydroboom_lab::plant;
use hydroboom_measurement::{Expected, Mapping, Measurement, Suspicion, read};
use hydroboom_model::Scheme;
use miette::{IntoDiagnostic, Result, miette};
use std::path::Path;

/// The options that say which column of a log is which signal.
#[derive(Args, Clone)]
pub struct LogMapping {
    /// Mapping: a TOML file with a table `log`; signals that it does not name are guessed.
    #[arg(long, value_name = "FILE")]
    mapping: Option<InputFile>,
    /// Interval of the rows of a text file without a time column; takes precedence over a time column.
    #[arg(long, value_name = "MS", value_parser = sample_time)]
    sample_time_ms: Option<f64>,
}

/// Parses the interval of the rows of a log \[ms\].
fn sample_time(text: &str) -> std::result::Result<f64, String> {
    let interval = text.parse::<f64>().ok().filter(|ms| (1e-6..=1e9).contains(ms));
    interval.ok_or_else(|| "it is an interval from 1e-6 to 1e9 ms".into())
}

impl LogMapping {
    /// Reads a log of a crane and assigns its columns to signals. Outliers are removed; these and assumptions are added
    /// to the log's remarks.
    ///
    /// # Errors
    ///
    /// If log or mapping cannot be read, or a column has an unknown unit or a wrong dimension.
    pub fn read(&self, log: &Path, crane: &Description) -> Result<(Measurement, Mapping)> {
        let (log, mapping, refused) = self.read_where_known(log, crane)?;
        match refused.into_iter().next() {
            None => Ok((log, mapping)),
            Some(reason) => Err(miette!("{}: {reason}", log.name)),
        }
    }

    /// The same without the columns of unknown unit or wrong dimension; their errors are returned.
    ///
    /// # Errors
    ///
    /// If log or mapping cannot be read.
    pub fn read_where_known(
        &self,
        log: &Path,
        crane: &Description,
    ) -> Result<(Measurement, Mapping, Vec<String>)> {
        let mut given = match &self.mapping {
            Some(path) => Mapping::parse(&path.display().to_string(), &text_of(path, "mapping")?)
                .into_diagnostic()?,
            None => Mapping::default(),
        };
        if let Some(interval) = self.sample_time_ms {
            given.time.sample_time = Some(interval * 1e-3);
        }
        origin::log(log);
        let mut log = read(log, Some(&given.time)).into_diagnostic()?;
        let (mapping, refused) = given.completed_where_known(&log).into_diagnostic()?;
        let n = &crane.numbers;
        let outliers = mapping.without_outliers(&mut log, n.stroke, n.motor_speed);
        log.remarks.extend(outliers);
        log.remarks.extend(mapping.assumptions(&log));
        Ok((log, mapping, refused))
    }
}

/// Suspicious values in the columns of a log: beyond the crane's stroke and motor speed, or of a magnitude that
/// suggests another unit.
pub fn suspicions(log: &Measurement, mapping: &Mapping, crane: &Description) -> Vec<Suspicion> {
    let n = &crane.numbers;
    let mut suspicions = mapping.suspicions(log, n.stroke, n.motor_speed);
    if let Some(expected) = expected(crane) {
        suspicions.extend(mapping.unit_suspicions(log, &expected));
    }
    suspicions
}

/// Expected magnitudes of the signals of a self-contained crane; none if it has no state of rest.
fn expected(crane: &Description) -> Option<Expected> {
    if crane.choices.circuit != CircuitChoice::SelfContained {
        return None;
    }
    let n = &crane.numbers;
    let holding = |share: f64| {
        let start = crane.start(share * n.stroke);
        let at_rest = plant(crane, &start, Scheme::Implicit, 1e-3).ok()?;
        Some(at_rest.outputs().pressure_a)
    };
    let [a, b, c] = [holding(0.0)?, holding(0.5)?, holding(1.0)?];
    Some(Expected {
        holding_pressure: [a.min(b).min(c), a.max(b).max(c)],
        travel: n.displacement * n.flow_gain / crane.cylinder().piston_area,
    })
}

/// The options that choose a part of a log.
#[derive(Args, Clone, Copy)]
pub struct LogWindow {
    /// Beginning of the used part of the log. Default: its first sample.
    #[arg(long, value_parser = number::within(number::LOG_TIME, "s"))]
    from_s: Option<f64>,
    /// End of the used part of the log. Default: its last sample.
    #[arg(long, value_parser = number::within(number::LOG_TIME, "s"))]
    to_s: Option<f64>,
}

impl LogWindow {
    /// Part of the log, in its time \[s\].
    pub fn of(self) -> hydroboom_identify::Window {
        hydroboom_identify::Window { from: self.from_s, to: self.to_s }
    }
}
