//! Identity of a file, independent of the path by which it is reached.

use crate::place::resolved;
use std::fs;
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};

/// Identity of a file: device and inode, and the path with links resolved. Two paths name the same file if either
/// agrees. A hard link shares the inode; a file that was replaced since shares the path.
#[derive(Clone, Debug)]
pub struct Identity {
    /// Path without links or `..`; its last part need not exist.
    path: PathBuf,
    /// Device and inode, if the file exists.
    node: Option<(u64, u64)>,
}

impl Identity {
    /// Identity of a path; `None` for a file without content of its own (a pipe, a terminal, `/dev/null`) and for a
    /// path that cannot be resolved.
    pub fn of(path: &Path) -> Option<Self> {
        let node = match fs::metadata(path) {
            Ok(found) if found.is_file() || found.file_type().is_block_device() => {
                Some((found.dev(), found.ino()))
            }
            Ok(_) => return None,
            // the file does not exist yet
            Err(_) => None,
        };
        Some(Self { path: resolved(path)?, node })
    }

    /// Whether the file exists.
    pub(crate) fn is_file(&self) -> bool {
        self.node.is_some()
    }

    /// Whether both are the same file.
    pub fn is_same(&self, other: &Self) -> bool {
        self.path == other.path || (self.node.is_some() && self.node == other.node)
    }
}
