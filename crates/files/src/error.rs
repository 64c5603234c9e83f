//! Why a file cannot be read or written.

use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// Why a file cannot be read or written.
#[derive(Debug, Error)]
pub enum FileError {
    /// The system refuses to read it.
    #[error("{} cannot be read: {error}", path.display())]
    Read {
        /// The file, as it was named.
        path: PathBuf,
        /// What the system says.
        error: io::Error,
    },
    /// It holds more than such a file can.
    #[error(
        "{} is too long: a {what} may have at most {limit_kb} kB{}",
        path.display(),
        if *is_device { " (it is a device)" } else { "" }
    )]
    TooLong {
        /// The file, as it was named.
        path: PathBuf,
        /// What it was read as.
        what: &'static str,
        /// Most that is read \[kB\].
        limit_kb: u64,
        /// Whether it is a device, which may have no end.
        is_device: bool,
    },
    /// It is not UTF-8.
    #[error("{} is not a text file (UTF-8): byte {at} is not valid", path.display())]
    NotText {
        /// The file, as it was named.
        path: PathBuf,
        /// Number of the first byte that is wrong, from 0.
        at: usize,
    },
    /// The system refuses to write it.
    #[error("{} cannot be written: {error}", path.display())]
    Write {
        /// The file, as it was named.
        path: PathBuf,
        /// What the system says.
        error: io::Error,
    },
    /// It is one of the inputs.
    #[error("{} cannot be written: it is the input {}", path.display(), input.display())]
    IsInput {
        /// The output, as it was named.
        path: PathBuf,
        /// The input, as it was named.
        input: PathBuf,
    },
}
