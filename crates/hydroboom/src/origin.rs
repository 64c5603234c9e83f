//! Origin of a report: inputs, command and date.

use hydroboom_lab::report::Origin;
use hydroboom_measurement::{digest, digest_of};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::SystemTime;

/// Crane files and mappings that were read: kind, name, SHA-256.
static READ: Mutex<Vec<(String, String, String)>> = Mutex::new(Vec::new());

/// Logs that were read. They may be long: their digests are computed when a report is written.
static LOGS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Records that a log was read, for the origin of reports.
pub fn log(path: &Path) {
    let mut all = LOGS.lock().unwrap_or_else(PoisonError::into_inner);
    if !all.iter().any(|known| known == path) {
        all.push(path.into());
    }
}

/// Logs as kind, name and SHA-256; pipes, which cannot be read twice, are left out.
fn logs() -> Vec<(String, String, String)> {
    let all = LOGS.lock().unwrap_or_else(PoisonError::into_inner).clone();
    let regular = all.into_iter().filter(|path| path.is_file());
    let digested =
        |path: PathBuf| Some(("log".into(), path.display().to_string(), digest(&path).ok()?));
    regular.filter_map(digested).collect()
}

/// Records that a file was read: `what` is its kind, `content` its text.
pub fn read(what: &str, path: &Path, content: &str) {
    record(what, &path.display().to_string(), content);
}

/// Records that an embedded crane file was used, by the crane's name and the file's text.
pub fn embedded(name: &str, content: &str) {
    record("crane file", &format!("{name} (embedded)"), content);
}

/// Adds a file to those that were read, once.
fn record(what: &str, name: &str, content: &str) {
    let read = (what.to_string(), name.to_string(), digest_of(content.as_bytes()));
    // the list is consistent after each push, so that a poisoned lock can be used
    let mut all = READ.lock().unwrap_or_else(PoisonError::into_inner);
    if !all.contains(&read) {
        all.push(read);
    }
}

/// Origin of a report written now: version, command, date, inputs with their digests. `seed` is that of the random
/// numbers; none without them.
pub fn origin(seed: Option<u64>) -> Origin {
    let command: Vec<String> =
        std::env::args_os().map(|argument| quoted(&argument.to_string_lossy())).collect();
    Origin {
        version: env!("CARGO_PKG_VERSION").into(),
        command: command.join(" "),
        date: humantime::format_rfc3339_seconds(SystemTime::now()).to_string(),
        read: [READ.lock().unwrap_or_else(PoisonError::into_inner).clone(), logs()].concat(),
        seed,
    }
}

/// Argument quoted for a shell.
fn quoted(argument: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_./=,:+@%".contains(c);
    match !argument.is_empty() && argument.chars().all(is_plain) {
        true => argument.into(),
        false => format!("'{}'", argument.replace('\'', "'\\''")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_shown_with_shell_quoting() {
        for plain in ["--set", "payload.mass_kg=340", "a/b-c_d.toml", "größe"] {
            assert_eq!(quoted(plain), plain);
        }
        assert_eq!(quoted("it's a"), r"'it'\''s a'");
        assert_eq!(quoted(""), "''");
    }
}
