//! CSV logs: columns that carry their unit, written whole or not at all.

use crate::LabError;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// Units of a log: suffix of the column and size in SI units.
fn shown_unit(unit: &str) -> (&'static str, f64) {
    match unit {
        "Pa" => ("bar", 1e5),
        "m" => ("mm", 1e-3),
        "m/s" => ("mm_s", 1e-3),
        "m³" => ("l", 1e-3),
        "m³/s" => ("l_min", 1.0 / 60_000.0),
        "rev/s" => ("rpm", 1.0 / 60.0),
        "N" => ("n", 1.0),
        _ => ("", 1.0),
    }
}

/// Columns for the entries of a record, from their names and SI units.
pub fn columns(names: &[&str], units: &[&str], prefix: &str) -> Vec<String> {
    let pairs = names.iter().zip(units);
    pairs
        .map(|(name, unit)| match shown_unit(unit).0 {
            "" => format!("{prefix}{name}"),
            suffix => format!("{prefix}{name}_{suffix}"),
        })
        .collect()
}

/// The values of these columns.
pub fn scaled<'a>(values: &'a [f64], units: &'a [&'static str]) -> impl Iterator<Item = f64> + 'a {
    values.iter().zip(units).map(|(value, unit)| value / shown_unit(unit).1)
}

/// A log that is being written, beside its final name; [`finish`](Log::finish) moves it there. A
/// log that is dropped before leaves nothing.
pub struct Log {
    path: PathBuf,
    partial: PathBuf,
    /// None once the log is complete.
    writer: Option<csv::Writer<BufWriter<File>>>,
}

impl Log {
    /// Begins a log with its header.
    ///
    /// # Errors
    ///
    /// [`LabError::File`] when it cannot be written.
    pub fn begin(path: &Path, header: &[String]) -> Result<Self, LabError> {
        let partial = path.with_extension("csv.partial");
        let file = File::create(&partial)
            .map_err(|error| LabError::File { path: partial.display().to_string(), error })?;
        let mut writer = csv::Writer::from_writer(BufWriter::new(file));
        let begun = writer.write_record(header);
        let log = Self { path: path.into(), partial, writer: Some(writer) };
        begun.map_err(|error| log.failed(error))?;
        Ok(log)
    }

    /// Adds a row.
    ///
    /// # Errors
    ///
    /// [`LabError::File`] when it cannot be written.
    pub fn row(&mut self, values: &[f64]) -> Result<(), LabError> {
        let fields = values.iter().map(|v| format!("{v:.9e}"));
        let written = self.writer.as_mut().map_or(Ok(()), |writer| writer.write_record(fields));
        written.map_err(|error| self.failed(error))
    }

    /// Completes the log and gives it its name.
    ///
    /// # Errors
    ///
    /// [`LabError::File`] when it cannot be written.
    pub fn finish(mut self) -> Result<(), LabError> {
        let flushed = self.writer.as_mut().map_or(Ok(()), csv::Writer::flush);
        flushed
            .and_then(|()| std::fs::rename(&self.partial, &self.path))
            .map_err(|error| self.failed(error.into()))?;
        self.writer = None;
        Ok(())
    }

    fn failed(&self, error: csv::Error) -> LabError {
        let path = self.path.display().to_string();
        LabError::File { path, error: std::io::Error::other(error) }
    }
}

impl Drop for Log {
    fn drop(&mut self) {
        if self.writer.take().is_some() {
            // nothing else can be done about a file that does not go away
            let _ = std::fs::remove_file(&self.partial);
        }
    }
}
