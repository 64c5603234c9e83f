//! Logs: columns that carry their unit, written whole or not at all.

use crate::LabError;
use crate::mat_file::{Matrix, mat_file};
use std::fs::File;
use std::io::{BufWriter, Write};
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
/// log that is dropped before leaves nothing. A name that ends in `.mat` makes it a MAT file with a
/// variable for each column, any other a CSV file.
pub struct Log {
    path: PathBuf,
    partial: PathBuf,
    /// None once the log is complete.
    writer: Option<Writer>,
}

enum Writer {
    Csv(Box<csv::Writer<BufWriter<File>>>),
    /// Names and columns, kept until the end: the format wants whole columns.
    Mat(BufWriter<File>, Vec<(String, Vec<Vec<f64>>)>),
}

impl Writer {
    fn row(&mut self, values: &[f64]) -> std::io::Result<()> {
        match self {
            Self::Csv(writer) => {
                Ok(writer.write_record(values.iter().map(|v| format!("{v:.9e}")))?)
            }
            Self::Mat(_, columns) => {
                columns.iter_mut().zip(values).for_each(|((_, rows), v)| rows.push(vec![*v]));
                Ok(())
            }
        }
    }

    fn finish(&mut self) -> std::io::Result<()> {
        match self {
            Self::Csv(writer) => writer.flush(),
            Self::Mat(file, columns) => {
                let matrices: Vec<Matrix<'_>> =
                    columns.iter().map(|(name, rows)| Matrix { name, rows }).collect();
                file.write_all(&mat_file(&matrices, &[]))?;
                file.flush()
            }
        }
    }
}

impl Log {
    /// Begins a log with its header.
    ///
    /// # Errors
    ///
    /// [`LabError::File`] when it cannot be written.
    pub fn begin(path: &Path, header: &[String]) -> Result<Self, LabError> {
        let mut partial = path.as_os_str().to_owned();
        partial.push(".partial");
        let partial = PathBuf::from(partial);
        let file = File::create(&partial)
            .map_err(|error| LabError::File { path: partial.display().to_string(), error })?;
        let file = BufWriter::new(file);
        let mut begun = Ok(());
        let writer = if path.extension().is_some_and(|extension| extension == "mat") {
            Writer::Mat(file, header.iter().map(|name| (name.clone(), Vec::new())).collect())
        } else {
            let mut writer = csv::Writer::from_writer(file);
            begun = writer.write_record(header).map_err(std::io::Error::from);
            Writer::Csv(Box::new(writer))
        };
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
        let written = self.writer.as_mut().map_or(Ok(()), |writer| writer.row(values));
        written.map_err(|error| self.failed(error))
    }

    /// Completes the log and gives it its name.
    ///
    /// # Errors
    ///
    /// [`LabError::File`] when it cannot be written.
    pub fn finish(mut self) -> Result<(), LabError> {
        let flushed = self.writer.as_mut().map_or(Ok(()), Writer::finish);
        flushed
            .and_then(|()| std::fs::rename(&self.partial, &self.path))
            .map_err(|error| self.failed(error))?;
        self.writer = None;
        Ok(())
    }

    fn failed(&self, error: std::io::Error) -> LabError {
        LabError::File { path: self.path.display().to_string(), error }
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
