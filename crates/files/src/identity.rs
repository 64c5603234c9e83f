//! What a path names, by whichever way it is reached.

use crate::place::resolved;
use std::fs;
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};

/// What a path names: its device and inode, and the path without links. Two paths name the same file
/// where either agrees: a hard link shares the inode, and a file that was replaced since shares the
/// path.
#[derive(Clone, Debug)]
pub struct Identity {
    /// Path without links or `..`; its last part need not exist.
    path: PathBuf,
    /// Device and inode of a file that exists.
    node: Option<(u64, u64)>,
}

impl Identity {
    /// What a path names; none for what holds no content of its own (a pipe, a terminal, `/dev/null`)
    /// and for what cannot be looked at.
    pub fn of(path: &Path) -> Option<Self> {
        let node = match fs::metadata(path) {
            Ok(found) if found.is_file() || found.file_type().is_block_device() => {
                Some((found.dev(), found.ino()))
            }
            Ok(_) => return None,
            // not there yet
            Err(_) => None,
        };
        Some(Self { path: resolved(path)?, node })
    }

    /// Whether there is such a file.
    pub(crate) fn is_file(&self) -> bool {
        self.node.is_some()
    }

    /// Whether both are the same file.
    pub fn is_same(&self, other: &Self) -> bool {
        self.path == other.path || (self.node.is_some() && self.node == other.node)
    }
}
