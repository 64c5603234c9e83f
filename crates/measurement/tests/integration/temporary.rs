//! Files that tests write.

use std::path::PathBuf;

/// Folder for the files of one module, because tests of several modules run at the same time.
pub fn folder(module: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(module.replace("::", "_"));
    std::fs::create_dir_all(&folder).unwrap();
    folder
}
