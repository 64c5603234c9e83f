//! A folder that is written atomically: complete or not at all.

use crate::FileError;
use crate::place::folder_of;
use std::ffi::OsString;
use std::fs::{self, File, Permissions};
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A new folder, filled under a temporary name beside its final place. Dropping it before
/// [`finish`](Folder::finish) deletes it.
#[derive(Debug)]
pub struct Folder {
    at: PathBuf,
    beside: TempDir,
}

impl Folder {
    /// Creates the temporary folder beside `at`; `at` itself must not exist.
    ///
    /// # Errors
    ///
    /// [`FileError::Write`] if the final folder exists or the temporary one cannot be created.
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
            // the process's umask reduces these permissions
            .permissions(Permissions::from_mode(0o777))
            .tempdir_in(folder_of(at))
            .map_err(failed)?;
        Ok(Self { at: at.into(), beside })
    }

    /// Path of the temporary folder.
    pub fn path(&self) -> &Path {
        self.beside.path()
    }

    /// Renames the folder to its final name.
    ///
    /// # Errors
    ///
    /// [`FileError::Write`] if the final name has been taken since, or the system refuses.
    pub fn finish(self) -> Result<(), FileError> {
        let Self { at, beside } = self;
        let done = match fs::symlink_metadata(&at) {
            // a rename would replace an empty folder
            Ok(_) => Err(io::ErrorKind::AlreadyExists.into()),
            Err(_) => fs::rename(beside.path(), &at),
        };
        match done {
            Ok(()) => {
                // the temporary name is gone: disarm the deletion on drop
                let _ = beside.keep();
                let _ = File::open(folder_of(&at)).and_then(|folder| folder.sync_all());
                Ok(())
            }
            Err(error) => Err(FileError::Write { path: at, error }),
        }
    }
}
