//! The program as a user starts it.

use super::json_schema;
use std::path::PathBuf;
use std::process::{Command, Output};

/// Runs the program.
pub fn hydroboom(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_hydroboom")).args(arguments).output().unwrap()
}

/// Empty folder for one test.
pub fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

/// Paths of files in an empty folder for one test.
pub fn files(name: &str) -> impl Fn(&str) -> String {
    let folder = folder(name);
    move |file| folder.join(file).to_str().unwrap().to_string()
}

/// Checks that the command failed with a message that contains `wanted`.
pub fn fails_with(output: &Output, wanted: &str) {
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success(), "should fail and say {wanted}");
    assert!(message.contains(wanted), "{message}");
}

/// Printed JSON, which is that of the command's schema.
pub fn parsed(arguments: &[&str]) -> serde_json::Value {
    let printed = serde_json::from_slice(&hydroboom(arguments).stdout).unwrap();
    json_schema::check(arguments, &printed);
    printed
}

/// Checks that a JSON object has these keys.
pub fn keys(value: &serde_json::Value, wanted: &[&str]) {
    for key in wanted {
        assert!(value.get(key).is_some(), "no {key} in {value}");
    }
}
