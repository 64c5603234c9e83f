//! Errors of reading a log.

use thiserror::Error;

/// Reason why a log cannot be used.
#[derive(Debug, Error)]
pub enum MeasurementError {
    /// The file cannot be read.
    #[error("{file}: {error}")]
    File {
        /// Path of the file.
        file: String,
        /// Error of the operating system.
        error: std::io::Error,
    },
    /// The path is a folder, a pipe or a device.
    #[error("{file} is no regular file: a log is read more than once, so write it to a file first")]
    NoFile {
        /// Path of the file.
        file: String,
    },
    /// The file is empty, or has too few rows.
    #[error("{file}: {found}; a log has a header and two rows of numbers at least")]
    Empty {
        /// Path of the file.
        file: String,
        /// Description of its content.
        found: String,
    },
    /// A cell is not a number.
    #[error("{file}, line {line}, column `{column}`: \"{text}\" is not a number; {advice}")]
    Cell {
        /// Path of the file.
        file: String,
        /// Line number, from 1.
        line: u64,
        /// Name of the column.
        column: String,
        /// Text of the cell.
        text: String,
        /// Remedy.
        advice: &'static str,
    },
    /// The format is unknown, or the file is damaged.
    #[error("{file}: {reason}")]
    Format {
        /// Path of the file.
        file: String,
        /// Reason for the failure.
        reason: String,
    },
    /// A mapping is invalid.
    #[error("{file}: {reason}")]
    Mapping {
        /// Path of the mapping or the log.
        file: String,
        /// Reason for the failure, and the allowed values.
        reason: String,
    },
    /// A required signal has no column.
    #[error(
        "no column for {missing}; the log has: {columns}{misfits}. Name it in a mapping: [log.{key}] column = \"...\""
    )]
    Missing {
        /// Name of the missing signal.
        missing: String,
        /// Its key in a mapping.
        key: &'static str,
        /// Columns of the log.
        columns: String,
        /// Columns with the signal's name but another dimension.
        misfits: String,
    },
}
