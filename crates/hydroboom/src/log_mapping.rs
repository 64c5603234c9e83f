//! The options that say which column of a log is which signal.

use crate::crane_file::text_of;
use crate::number;
use crate::origin;
use crate::paths::InputFile;
use clap::Args;
use hydroboom_measurement::{Mapping, Measurement, read};
use miette::{IntoDiagnostic, Result};
use std::os::unix::fs::FileTypeExt;
use std::path::Path;

/// The options that say which column of a log is which signal.
#[derive(Args, Clone)]
pub struct LogMapping {
    /// Mapping: a TOML file with a table `log`; what it does not name is guessed.
    #[arg(long, value_name = "FILE")]
    mapping: Option<InputFile>,
    /// Interval of the rows of a text file, where no column tells their time; takes precedence over a time column.
    #[arg(long, value_name = "MS", value_parser = sample_time)]
    sample_time_ms: Option<f64>,
}

fn sample_time(text: &str) -> std::result::Result<f64, String> {
    let interval = text.parse::<f64>().ok().filter(|ms| (1e-6..=1e9).contains(ms));
    interval.ok_or_else(|| "an interval in ms, more than zero".into())
}

impl LogMapping {
    /// Reads a log, and says which of its columns is what; what is assumed is among the log's remarks.
    pub fn read(&self, log: &Path) -> Result<(Measurement, Mapping)> {
        let mut given = match &self.mapping {
            Some(path) => Mapping::parse(&path.display().to_string(), &text_of(path, "mapping")?)
                .into_diagnostic()?,
            None => Mapping::default(),
        };
        if let Some(interval) = self.sample_time_ms {
            given.time.sample_time = Some(interval * 1e-3);
        }
        if is_device(log) {
            miette::bail!(
                help = "name a file or a pipe",
                "{} is a device, and no log",
                log.display()
            );
        }
        origin::log(log);
        let mut log = read(log, Some(&given.time)).into_diagnostic()?;
        let mapping = given.completed(&log).into_diagnostic()?;
        log.remarks.extend(mapping.assumptions(&log));
        Ok((log, mapping))
    }
}

/// Whether a path is a device, which may have no end.
fn is_device(path: &Path) -> bool {
    let found = std::fs::metadata(path);
    found.is_ok_and(|f| f.file_type().is_char_device() || f.file_type().is_block_device())
}

/// The options that choose a part of a log.
#[derive(Args, Clone, Copy)]
pub struct LogWindow {
    /// Use the log from here; from its beginning when not given.
    #[arg(long, allow_negative_numbers = true, value_parser = number::within(number::LOG_TIME, "s"))]
    from_s: Option<f64>,
    /// Use the log to here; to its end when not given.
    #[arg(long, allow_negative_numbers = true, value_parser = number::within(number::LOG_TIME, "s"))]
    to_s: Option<f64>,
}

impl LogWindow {
    /// The part.
    pub fn of(self) -> hydroboom_identify::Window {
        hydroboom_identify::Window { from: self.from_s, to: self.to_s }
    }
}
