//! Errors of reading and writing files.

use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// Reason why a file cannot be read or written.
#[derive(Debug, Error)]
pub enum FileError {
    /// The operating system refuses to read the file.
    #[error("{} cannot be read: {error}", path.display())]
    Read {
        /// Path, as given by the user.
        path: PathBuf,
        /// Error of the operating system.
        error: io::Error,
    },
    /// The file is longer than its kind allows.
    #[error(
        "{} is too long: a {what} may have at most {limit_kb} kB{}",
        path.display(),
        if *is_device { " (it is a device)" } else { "" }
    )]
    TooLong {
        /// Path, as given by the user.
        path: PathBuf,
        /// Kind of the file, as named in messages.
        what: &'static str,
        /// Largest allowed size \[kB\].
        limit_kb: u64,
        /// Whether it is a device, which may be endless.
        is_device: bool,
    },
    /// The file is not UTF-8 text.
    #[error("{} is not a text file (UTF-8): byte {at} is not valid", path.display())]
    NotText {
        /// Path, as given by the user.
        path: PathBuf,
        /// Offset of the first invalid byte \[byte\].
        at: usize,
    },
    /// The operating system refuses to write the file.
    #[error("{} cannot be written: {error}", path.display())]
    Write {
        /// Path, as given by the user.
        path: PathBuf,
        /// Error of the operating system.
        error: io::Error,
    },
    /// The output is one of the inputs.
    #[error("{} cannot be written: it is the input {}", path.display(), input.display())]
    IsInput {
        /// Path of the output, as given by the user.
        path: PathBuf,
        /// Path of the input, as given by the user.
        input: PathBuf,
    },
}
