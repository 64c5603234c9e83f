//! Why a log cannot be used.

use thiserror::Error;

/// Why a log cannot be used.
#[derive(Debug, Error)]
pub enum MeasurementError {
    /// The file cannot be read.
    #[error("{file}: {error}")]
    File {
        /// Its path.
        file: String,
        /// What the system says.
        error: std::io::Error,
    },
    /// It is a folder, a pipe or a device.
    #[error("{file} is no regular file: a log is read more than once, so write it to a file first")]
    NoFile {
        /// Its path.
        file: String,
    },
    /// There is nothing, or not enough, in it.
    #[error("{file}: {found}; a log has a header and two rows of numbers at least")]
    Empty {
        /// Its path.
        file: String,
        /// What is there.
        found: String,
    },
    /// A cell is no number.
    #[error("{file}, line {line}, column `{column}`: \"{text}\" is not a number; {advice}")]
    Cell {
        /// Its path.
        file: String,
        /// Line, counted from one.
        line: u64,
        /// Name of the column.
        column: String,
        /// What was read.
        text: String,
        /// What to do.
        advice: &'static str,
    },
    /// The format is not understood.
    #[error("{file}: {reason}")]
    Format {
        /// Its path.
        file: String,
        /// What is wrong.
        reason: String,
    },
    /// A mapping is wrong.
    #[error("{file}: {reason}")]
    Mapping {
        /// Its path.
        file: String,
        /// What is wrong, and what is allowed.
        reason: String,
    },
    /// A signal that is needed has no column.
    #[error(
        "no column for {missing}; the log has: {columns}{misfits}. Name it in a mapping: [log.{key}] column = \"...\""
    )]
    Missing {
        /// What is missing.
        missing: String,
        /// Its key in a mapping.
        key: &'static str,
        /// Columns that are there.
        columns: String,
        /// Columns that are called so, and of another quantity.
        misfits: String,
    },
}
