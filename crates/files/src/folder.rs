//! A folder that is written whole or not at all.

use crate::FileError;
use crate::place::folder_of;
use std::ffi::OsString;
use std::fs::{self, File, Permissions};
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A new folder that is being filled beside its place; one that is dropped before
/// [`finish`](Folder::finish) leaves nothing.
#[derive(Debug)]
pub struct Folder {
    at: PathBuf,
    beside: TempDir,
}

impl Folder {
    /// Begins a folder, which must not be there yet.
    ///
    /// # Errors
    ///
    /// [`FileError::Write`] when it is there, or cannot be made.
    pub fn begin(at: &Path) -> Result<Self, FileError> {
        let failed = |error| FileError::Write { path: at.into(), error };
        if fs::symlink_metadata(at).is_ok() {
            return Err(failed(io::ErrorKind::AlreadyExists.into()));
        }
        let mut prefix = at.file_name().map_or_else(OsString::new, ToOwned::to_owned);
        prefix.push(".");
        let beside = tempfile::Builder::new()
            .prefix(&prefix)
            .suffix(".partial")
            // less what the user's mask takes away
            .permissions(Permissions::from_mode(0o777))
            .tempdir_in(folder_of(at))
            .map_err(failed)?;
        Ok(Self { at: at.into(), beside })
    }

    /// Where it is filled.
    pub fn path(&self) -> &Path {
        self.beside.path()
    }

    /// Gives it its name.
    ///
    /// # Errors
    ///
    /// [`FileError::Write`] when something came there in the meantime, or the system refuses.
    pub fn finish(self) -> Result<(), FileError> {
        let Self { at, beside } = self;
        let done = match fs::symlink_metadata(&at) {
            // a rename would put it over an empty folder
            Ok(_) => Err(io::ErrorKind::AlreadyExists.into()),
            Err(_) => fs::rename(beside.path(), &at),
        };
        match done {
            Ok(()) => {
                // it is not there any more under that name, and nothing is to be removed
                let _ = beside.keep();
                let _ = File::open(folder_of(&at)).and_then(|folder| folder.sync_all());
                Ok(())
            }
            Err(error) => Err(FileError::Write { path: at, error }),
        }
    }
}
