//! Logs as CSV or MAT files, with the unit in each column's name. A log file is complete or absent.

use crate::mat_file::{Matrix, mat_file};
use hydroboom_files::{FileError, Output};
use std::io::Write;
use std::path::Path;

/// Suffix of a column for an SI unit, and the size of the displayed unit in SI units.
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

/// Column names for the fields of a record from their names and SI units: prefix, name, and the display unit, as
/// `pressure_a_bar`. A field without a unit has no such ending.
pub fn columns(names: &[&str], units: &[&str], prefix: &str) -> Vec<String> {
    let pairs = names.iter().zip(units);
    pairs
        .map(|(name, unit)| match shown_unit(unit).0 {
            "" => format!("{prefix}{name}"),
            suffix => format!("{prefix}{name}_{suffix}"),
        })
        .collect()
}

/// Values in the display units of these columns (bar, mm, mm/s, l, l/min, rpm, N), from values in their SI units. A
/// value of any other unit is unchanged.
pub fn scaled<'a>(values: &'a [f64], units: &'a [&'static str]) -> impl Iterator<Item = f64> + 'a {
    values.iter().zip(units).map(|(value, unit)| value / shown_unit(unit).1)
}

/// Log being written; [`finish`](Log::finish) renames it to its final name. A log that is dropped before
/// leaves no file. A name ending in `.mat` gives a MAT file with a variable per column. Any other name
/// gives a CSV file whose numbers are restored exactly.
///
/// If writing fails, for instance on a full disk, the recorded computation continues.
/// [`finish`](Log::finish) returns the error.
pub struct Log {
    /// Writer; an error ends the writing.
    writer: Result<Writer, FileError>,
}

enum Writer {
    Csv(Box<csv::Writer<Output>>),
    /// Names and columns, kept until the end because the format requires whole columns.
    Mat(Output, Vec<(String, Vec<Vec<f64>>)>),
}

impl Writer {
    fn begin(path: &Path, header: &[String]) -> Result<Self, FileError> {
        let output = Output::begin(path)?;
        if path.extension().is_some_and(|extension| extension == "mat") {
            let columns = header.iter().map(|name| (name.clone(), Vec::new())).collect();
            return Ok(Self::Mat(output, columns));
        }
        let mut writer = csv::Writer::from_writer(output);
        match writer.write_record(header) {
            Ok(()) => Ok(Self::Csv(Box::new(writer))),
            Err(error) => Err(FileError::Write { path: path.into(), error: error.into() }),
        }
    }

    fn row(&mut self, values: &[f64]) -> Result<(), FileError> {
        match self {
            Self::Csv(writer) => {
                // shortest text that is read back as the same number
                let cells = values.iter().map(|v| format!("{v:e}"));
                writer.write_record(cells).map_err(|error| writer.get_ref().failed(error.into()))
            }
            Self::Mat(_, columns) => {
                columns.iter_mut().zip(values).for_each(|((_, rows), v)| rows.push(vec![*v]));
                Ok(())
            }
        }
    }

    fn finish(self) -> Result<(), FileError> {
        match self {
            Self::Csv(mut writer) => {
                writer.flush().map_err(|error| writer.get_ref().failed(error))?;
                match writer.into_inner() {
                    Ok(output) => output.finish(),
                    Err(error) => {
                        let why = std::io::Error::other(error.error().to_string());
                        Err(error.into_inner().get_ref().failed(why))
                    }
                }
            }
            Self::Mat(mut output, columns) => {
                let matrices: Vec<Matrix<'_>> =
                    columns.iter().map(|(name, rows)| Matrix { name, rows }).collect();
                output
                    .write_all(&mat_file(&matrices, &[]))
                    .map_err(|error| output.failed(error))?;
                output.finish()
            }
        }
    }
}

impl Log {
    /// Begins a log with its header. An error of creating the file is reported by [`finish`](Self::finish).
    pub fn begin(path: &Path, header: &[String]) -> Self {
        Self { writer: Writer::begin(path, header) }
    }

    /// Appends a row, with a value for each column of the header; NaN and infinite values are written as such. Another
    /// number of values fails in a CSV file. An earlier error makes this call do nothing.
    pub fn row(&mut self, values: &[f64]) {
        if let Ok(writer) = &mut self.writer
            && let Err(error) = writer.row(values)
        {
            self.writer = Err(error);
        }
    }

    /// Completes the log and renames it to its final name.
    ///
    /// # Errors
    ///
    /// [`FileError`] of creating the file, of the first row that could not be written, or of the renaming.
    pub fn finish(self) -> Result<(), FileError> {
        self.writer?.finish()
    }
}
