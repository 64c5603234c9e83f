//! Tables for people, JSON for machines.

use miette::{IntoDiagnostic, Result, WrapErr};
use std::io::Write;
use std::path::Path;

/// Writes text to standard output; a closed pipe is no error.
pub fn text(text: &str) -> Result<()> {
    match writeln!(std::io::stdout(), "{text}") {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(error).into_diagnostic().wrap_err("cannot write the results")
        }
        _ => Ok(()),
    }
}

/// Writes JSON to standard output.
pub fn json(value: &serde_json::Value) -> Result<()> {
    text(&serde_json::to_string_pretty(value).into_diagnostic()?)
}

/// A table with aligned columns: numbers to the right, the first column and words to the left.
pub fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let width = |column: usize| {
        let cells = rows.iter().filter_map(|row| row.get(column)).map(|c| c.chars().count());
        cells.chain([header[column].chars().count()]).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..header.len()).map(width).collect();
    let is_number = |cell: &String| {
        cell.is_empty() || cell.starts_with(|c: char| c.is_ascii_digit() || "+-".contains(c))
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

/// Writes a file whole or not at all: beside its place first, then moved there.
pub fn file(path: &Path, content: &[u8]) -> Result<()> {
    let mut partial = path.as_os_str().to_owned();
    partial.push(".partial");
    let written = std::fs::write(&partial, content).and_then(|()| std::fs::rename(&partial, path));
    written.into_diagnostic().wrap_err_with(|| format!("{} cannot be written", path.display()))
}

/// A number with so many digits, or a dash.
pub fn optional(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "-".into(), |v| format!("{v:.digits$}"))
}

/// A number with all its digits, small ones by their power of ten.
pub fn number(value: f64) -> String {
    match value != 0.0 && value.abs() < 1e-3 {
        true => format!("{value:e}"),
        false => value.to_string(),
    }
}
