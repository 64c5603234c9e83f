//! The study of the paper's crane, which runs once for all tests.

use super::command::{folder, parsed};
use serde_json::Value;
use std::path::PathBuf;
use std::sync::OnceLock;

/// JSON of `hydroboom study`, and the folder with its report.
pub fn study() -> &'static (Value, PathBuf) {
    static STUDY: OnceLock<(Value, PathBuf)> = OnceLock::new();
    STUDY.get_or_init(|| {
        let folder = folder("study");
        let printed = parsed(&["study", "--json", "--out", folder.to_str().unwrap()]);
        (printed, folder)
    })
}
