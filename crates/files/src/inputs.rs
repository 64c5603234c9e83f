//! Input files: size-limited reading, and protection against overwriting.

use crate::{FileError, Identity};
use std::fs::File;
use std::io::Read;
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// An input of this process.
struct Input {
    /// Path, as given by the user.
    path: PathBuf,
    identity: Identity,
    /// Kept open, so that its inode is not reused if the file is deleted.
    _file: Option<File>,
}

/// Inputs of this process.
static INPUTS: Mutex<Vec<Input>> = Mutex::new(Vec::new());

/// Registers a file as an input, which this process refuses to write from then on.
pub fn protect(path: &Path) {
    let Some(identity) = Identity::of(path) else { return };
    let file = identity.is_file().then(|| File::open(path).ok()).flatten();
    // the list stays valid after a panic of another thread
    let mut inputs = INPUTS.lock().unwrap_or_else(PoisonError::into_inner);
    inputs.push(Input { path: path.into(), identity, _file: file });
}

/// Returns an error if an output is one of the inputs.
pub(crate) fn refuse_input(path: &Path) -> Result<(), FileError> {
    let Some(output) = Identity::of(path) else { return Ok(()) };
    let inputs = INPUTS.lock().unwrap_or_else(PoisonError::into_inner);
    match inputs.iter().find(|input| input.identity.is_same(&output)) {
        Some(input) => Err(FileError::IsInput { path: path.into(), input: input.path.clone() }),
        None => Ok(()),
    }
}

/// Reads a file of at most `limit` \[byte\] and registers it as an input. `what` names the kind of the file in error
/// messages.
///
/// # Errors
///
/// [`FileError`] if the file cannot be read or is longer than `limit`. An endless device is read up to the limit.
pub fn bytes(path: &Path, what: &'static str, limit: u64) -> Result<Vec<u8>, FileError> {
    protect(path);
    bounded(path, what, limit)
}

fn bounded(path: &Path, what: &'static str, limit: u64) -> Result<Vec<u8>, FileError> {
    let failed = |error| FileError::Read { path: path.into(), error };
    let file = File::open(path).map_err(failed)?;
    let is_device = file.metadata().is_ok_and(|found| {
        found.file_type().is_char_device() || found.file_type().is_block_device()
    });
    let mut read = Vec::new();
    file.take(limit.saturating_add(1)).read_to_end(&mut read).map_err(failed)?;
    match read.len() as u64 > limit {
        true => {
            let limit_kb = limit / 1000;
            Err(FileError::TooLong { path: path.into(), what, limit_kb, is_device })
        }
        false => Ok(read),
    }
}

/// Reads a UTF-8 text file of at most `limit` \[byte\]; otherwise as [`bytes`].
///
/// # Errors
///
/// [`FileError`] if the file cannot be read, is longer than `limit`, or is not UTF-8.
pub fn text(path: &Path, what: &'static str, limit: u64) -> Result<String, FileError> {
    decoded(path, bytes(path, what, limit)?)
}

/// Like [`text`], for a file that this program will overwrite, such as the saved state of an interrupted search: it is
/// not registered as an input.
///
/// # Errors
///
/// As [`text`].
pub fn own_text(path: &Path, what: &'static str, limit: u64) -> Result<String, FileError> {
    decoded(path, bounded(path, what, limit)?)
}

fn decoded(path: &Path, bytes: Vec<u8>) -> Result<String, FileError> {
    String::from_utf8(bytes)
        .map_err(|e| FileError::NotText { path: path.into(), at: e.utf8_error().valid_up_to() })
}
