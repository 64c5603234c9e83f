//! Resolution of an output's path.

use std::fs;
use std::path::{Path, PathBuf};

/// Symbolic links followed before a path is refused; the same limit as in the Linux kernel.
const MOST_LINKS: usize = 40;

/// How and where an output is written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// A device, a pipe or an open file of a process: written in place.
    Device(PathBuf),
    /// Standard output or standard error of this process.
    Standard(Stream),
    /// A regular file, existing or new: written under a temporary name and renamed.
    Whole(PathBuf),
}

/// A standard stream of this process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stream {
    Output,
    Error,
}

/// Follows links to the place of an output.
pub(crate) fn place(path: &Path) -> Place {
    let mut at = path.to_path_buf();
    for _ in 0..MOST_LINKS {
        match at.to_str() {
            Some("/dev/stdout" | "/dev/fd/1" | "/proc/self/fd/1") => {
                return Place::Standard(Stream::Output);
            }
            Some("/dev/stderr" | "/dev/fd/2" | "/proc/self/fd/2") => {
                return Place::Standard(Stream::Error);
            }
            _ => {}
        }
        // an open file of a process must keep its inode: its owner would not see a renamed file
        if at.starts_with("/proc") || at.starts_with("/dev/fd") {
            return Place::Device(at);
        }
        match fs::read_link(&at) {
            Ok(target) => at = at.parent().unwrap_or(Path::new("")).join(target),
            Err(_) => break,
        }
    }
    match fs::metadata(&at) {
        Ok(found) if !found.is_file() && !found.is_dir() => Place::Device(at),
        _ => Place::Whole(at),
    }
}

/// A path without links and `..`; its last part, or what a last link points to, need not exist.
pub(crate) fn resolved(path: &Path) -> Option<PathBuf> {
    if let Ok(path) = path.canonicalize() {
        return Some(path);
    }
    let Place::Whole(at) = place(path) else { return None };
    Some(folder_of(&at).canonicalize().ok()?.join(at.file_name()?))
}

/// The folder of a file.
pub(crate) fn folder_of(file: &Path) -> &Path {
    match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}
