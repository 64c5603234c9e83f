//! Output of the commands: tables for people, JSON for programs, files.
//!
//! An output that cannot be written does not end a command. The error is printed at once and the other
//! outputs are still written. [`conclude`] then ends the program with a list of what is missing.

use crate::origin::origin;
use hydroboom_lab::report::Page;
use miette::{IntoDiagnostic, Result, miette};
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Output that was not written.
struct Failure {
    /// Path; none for standard output.
    path: Option<PathBuf>,
    /// Error message.
    message: String,
}

/// Outputs of this process that were not written.
static FAILURES: Mutex<Vec<Failure>> = Mutex::new(Vec::new());

/// Writes text to standard output; a closed pipe is no error.
///
/// # Errors
///
/// None: a failure is reported by [`conclude`].
pub fn text(text: &str) -> Result<()> {
    let mut stdout = std::io::stdout();
    let written = writeln!(stdout, "{}", escaped(text)).and_then(|()| stdout.flush());
    if let Err(error) = written
        && error.kind() != std::io::ErrorKind::BrokenPipe
    {
        failed(None, format!("the results cannot be printed: {error}"));
    }
    Ok(())
}

/// Writes JSON to standard output.
///
/// # Errors
///
/// If the value has no text, as with keys that are no strings.
pub fn json(value: &serde_json::Value) -> Result<()> {
    text(&serde_json::to_string_pretty(value).into_diagnostic()?)
}

/// Prints a note on standard error, without control characters.
pub fn note(text: &str) {
    // an error means that standard error was closed on purpose
    let _ = writeln!(std::io::stderr(), "{}", escaped(text));
}

/// Prints a warning on standard error.
pub fn warn(text: &str) {
    note(&format!("warning: {text}"));
}

/// Writes a file completely or not at all; returns whether it was written.
pub fn file(path: &Path, content: &[u8]) -> bool {
    written(path, hydroboom_files::write(path, content))
}

/// Writes a report, and its figures as SVG and CSV into the folder `NAME-figures` next to it, but not for a
/// device or a pipe. `seed` is that of the random numbers.
pub fn page(path: &Path, report: &Page, seed: Option<u64>) {
    let is_written = file(path, report.html(&origin(seed)).as_bytes());
    if !is_written || !path.is_file() || report.figures.is_empty() {
        return;
    }
    let mut name = path.file_stem().unwrap_or_default().to_os_string();
    name.push("-figures");
    let figures = path.with_file_name(name);
    folder(&figures);
    for figure in &report.figures {
        file(&figures.join(format!("{}.svg", figure.name)), figure.svg.as_bytes());
        file(&figures.join(format!("{}.csv", figure.name)), figure.csv.as_bytes());
    }
}

/// Writes a report with its figures into a folder; returns the report's path.
pub fn page_in_folder(at: &Path, name: &str, report: &Page, seed: Option<u64>) -> PathBuf {
    folder(at);
    let path = at.join(format!("{name}.html"));
    page(&path, report, seed);
    path
}

/// Creates a folder for files if it does not exist; a failure is recorded.
pub fn folder(path: &Path) {
    if let Err(error) = hydroboom_files::folder(path) {
        failed(Some(path), error.to_string());
    }
}

/// Records the result of writing a file; returns whether it was written.
pub fn written(path: &Path, result: Result<(), impl std::fmt::Display>) -> bool {
    match result {
        Ok(()) => true,
        Err(error) => {
            failed(Some(path), error.to_string());
            false
        }
    }
}

/// Line that names a written file, as `report: run.html`, or that it was not written.
pub fn named(what: &str, path: &Path) -> String {
    match is_written(path) {
        false => format!("\n{what}: {} is NOT written", path.display()),
        true => format!("\n{what}: {}", path.display()),
    }
}

/// Whether a file was written, and its folder created.
pub fn is_written(path: &Path) -> bool {
    let failures = FAILURES.lock().unwrap_or_else(PoisonError::into_inner);
    !failures.iter().any(|f| f.path.as_deref().is_some_and(|failed| path.starts_with(failed)))
}

/// Prints and records that an output was not written; `path` is none for standard output.
fn failed(path: Option<&Path>, message: String) {
    let mut failures = FAILURES.lock().unwrap_or_else(PoisonError::into_inner);
    // files in a folder that could not be created
    let is_known = |f: &Failure| {
        f.path.as_deref().zip(path).is_some_and(|(known, path)| path.starts_with(known))
    };
    if !failures.iter().any(is_known) {
        note(&message);
        failures.push(Failure { path: path.map(Path::to_path_buf), message });
    }
}

/// Result of a command: an error also if an output is missing.
///
/// # Errors
///
/// That of the command, otherwise a list of the outputs that were not written.
pub fn conclude(result: Result<()>) -> Result<()> {
    let failures = std::mem::take(&mut *FAILURES.lock().unwrap_or_else(PoisonError::into_inner));
    if failures.is_empty() {
        return result;
    }
    let list: Vec<String> = failures.into_iter().map(|failure| failure.message).collect();
    if let Err(error) = result {
        note(&format!("not written:\n  {}", list.join("\n  ")));
        return Err(error);
    }
    Err(miette!("not all outputs are written:\n  {}", list.join("\n  ")))
}

/// Prints the error of a command on standard error.
pub fn error(error: &miette::Report) {
    let message = without_commands(&cut(&format!("{error:?}")));
    let _ = writeln!(std::io::stderr(), "Error: {message}");
}

/// Prints an error of the command line, or the requested help.
pub fn usage(error: &clap::Error) {
    let message = error.render();
    let colourful = |text: &str| without_commands(&cut(text));
    let _ = match (error.use_stderr(), std::io::stderr().is_terminal()) {
        (true, true) => write!(std::io::stderr(), "{}", colourful(&message.ansi().to_string())),
        (true, false) => write!(std::io::stderr(), "{}", colourful(&message.to_string())),
        // help is the program's own text
        (false, _) => error.print(),
    };
}

/// Largest number of letters per line of a message.
const MOST_LETTERS: usize = 2000;
/// Largest number of lines of a message.
const MOST_LINES: usize = 400;

/// Message with overlong lines and excess lines cut: text quoted from a file may have any length.
fn cut(text: &str) -> String {
    let count = text.lines().count();
    let mut lines: Vec<String> = text
        .lines()
        .take(MOST_LINES)
        .map(|line| match line.char_indices().nth(MOST_LETTERS) {
            Some((at, _)) => format!("{} ...", &line[..at]),
            None => line.to_string(),
        })
        .collect();
    if count > MOST_LINES {
        lines.push(format!("... and {} more lines", count - MOST_LINES));
    }
    if text.ends_with('\n') {
        lines.push(String::new());
    }
    lines.join("\n")
}

/// Text made for a terminal without control sequences other than colours (ECMA-48, SGR).
fn without_commands(text: &str) -> String {
    let mut parts = text.split("\x1b[");
    let mut shown = escaped(parts.next().unwrap_or_default());
    for part in parts {
        let end = part.find(|c: char| !(c.is_ascii_digit() || c == ';')).unwrap_or(part.len());
        match part[end..].strip_prefix('m') {
            Some(rest) => shown += &format!("\x1b[{}m{}", &part[..end], escaped(rest)),
            None => shown += &format!("\\u{{1b}}[{}", escaped(part)),
        }
    }
    shown
}

/// Text without control characters except line ends and tabs, so that the content of a file cannot control
/// a terminal.
pub fn escaped(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for letter in text.chars() {
        // characters that change the direction of writing can hide text
        let is_turning = matches!(letter, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
        match is_turning || letter.is_control() && !matches!(letter, '\n' | '\t') {
            true => shown.extend(letter.escape_default()),
            false => shown.push(letter),
        }
    }
    shown
}

/// Table as of [`table`], without columns of the paper that have dashes only, as for another crane.
pub fn table_beside_paper(header: &[&str], rows: &[Vec<String>]) -> String {
    let is_kept = |column: &usize| {
        !header[*column].contains("paper") || rows.iter().any(|row| row[*column] != "-")
    };
    let columns: Vec<usize> = (0..header.len()).filter(is_kept).collect();
    let header: Vec<&str> = columns.iter().map(|column| header[*column]).collect();
    let kept = |row: &Vec<String>| columns.iter().map(|column| row[*column].clone()).collect();
    table(&header, &rows.iter().map(kept).collect::<Vec<_>>())
}

/// Table with aligned columns: numbers to the right, the first column and words to the left. Each row has at most as
/// many cells as the header.
pub fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let width = |column: usize| {
        let cells = rows.iter().filter_map(|row| row.get(column)).map(|c| c.chars().count());
        cells.chain([header[column].chars().count()]).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..header.len()).map(width).collect();
    let is_number = |cell: &String| {
        cell.is_empty() || cell.starts_with(|c: char| c.is_ascii_digit() || "+-=".contains(c))
    };
    let to_the_left: Vec<bool> = (0..header.len())
        .map(|column| column == 0 || !rows.iter().filter_map(|row| row.get(column)).all(is_number))
        .collect();
    let line = |cells: &mut dyn Iterator<Item = String>| {
        let padded: Vec<String> = cells
            .zip(&widths)
            .enumerate()
            .map(|(i, (cell, width))| match to_the_left[i] {
                true => format!("{cell:<width$}"),
                false => format!("{cell:>width$}"),
            })
            .collect();
        padded.join("  ").trim_end().to_string()
    };
    let mut lines = vec![line(&mut header.iter().map(|h| h.to_string()))];
    lines.push(widths.iter().map(|w| "-".repeat(*w)).collect::<Vec<_>>().join("  "));
    lines.extend(rows.iter().map(|row| line(&mut row.iter().cloned())));
    lines.join("\n")
}

/// Number with so many decimals; a dash for none.
pub fn optional(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "-".into(), |v| format!("{v:.digits$}"))
}

/// Number with four significant digits, very small and very large ones with an exponent.
pub fn short(value: f64) -> String {
    let four: f64 = format!("{value:.3e}").parse().unwrap_or(value);
    match four != 0.0 && !(1e-3..1e6).contains(&four.abs()) {
        true => format!("{four:e}"),
        false => four.to_string(),
    }
}

/// Number with three significant digits and at most six decimals; 0 below 1e-6, a dash for NaN and infinity.
pub fn three_digits(value: f64) -> String {
    let size = value.abs();
    match size.is_finite() && size >= 1e-6 {
        true => format!("{value:.*}", (2 - size.log10().floor() as i32).clamp(0, 6) as usize),
        false => {
            if size.is_finite() {
                "0".into()
            } else {
                "-".into()
            }
        }
    }
}

/// Number with all its digits, small ones with an exponent.
pub fn number(value: f64) -> String {
    match value != 0.0 && value.abs() < 1e-3 {
        true => format!("{value:e}"),
        false => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_shown_escaped() {
        assert_eq!(escaped("a\u{202e}b"), "a\\u{202e}b");
        assert_eq!(escaped("a\x1b[2Jb\r\u{9b}\tc\n"), "a\\u{1b}[2Jb\\r\\u{9b}\tc\n");
        // colours of the program's own messages are kept
        assert_eq!(without_commands("\x1b[31mred\x1b[0m"), "\x1b[31mred\x1b[0m");
        assert_eq!(without_commands("\x1b[2J\x1b]0;t\x07"), "\\u{1b}[2J\\u{1b}]0;t\\u{7}");
    }

    #[test]
    fn overlong_messages_are_cut() {
        let message = cut(&format!("ä{}\nshort", "[".repeat(200_000)));
        assert!(message.len() < 2100 && message.ends_with("...\nshort"), "{message}");
        assert!(cut(&"x\n".repeat(100_000)).len() < 2000);
        assert_eq!(cut("a\nb\n"), "a\nb\n");
    }
}
