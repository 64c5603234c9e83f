//! Reading and writing of a mapping as TOML.

use crate::error::MeasurementError;
use crate::mapping::{Entry, Mapping};
use crate::signal::Signal;
use crate::time_column::TimeColumn;
use crate::unit::{Unit, UnitError};
use std::fmt::Write;

/// Largest rate error of a clock \[ppm\].
const MOST_DRIFT: f64 = 1e5;
/// Keys of a column.
const KEYS: &str = "column, unit, scale, sign, offset, delay_ms, drift_ppm, filter_ms";
/// Keys of the time.
const TIME_KEYS: &str = "column, unit, scale, offset";

impl Mapping {
    /// Mapping from the `[log]` table of a TOML text; keys are signals, values a column's name or a table. `file` is
    /// the name of the text in messages.
    ///
    /// # Errors
    ///
    /// [`MeasurementError::Mapping`] with the reason and the allowed values.
    pub fn parse(file: &str, text: &str) -> Result<Self, MeasurementError> {
        let wrong = |reason: String| MeasurementError::Mapping { file: file.into(), reason };
        let whole: toml::Table = text.parse().map_err(|e| wrong(place(&e, text)))?;
        let Some(log) = whole.get("log").and_then(toml::Value::as_table) else {
            return Err(wrong("there is no table [log]".into()));
        };
        let mut mapping = Self::default();
        for (key, value) in log {
            match key.as_str() {
                "time" => {
                    let sample_time = mapping.time.sample_time;
                    mapping.time = time(value).map_err(|e| wrong(format!("log.time{e}")))?;
                    mapping.time.sample_time = sample_time;
                }
                "sample_time_ms" => {
                    let interval = number(value).filter(|ms| (1e-6..=1e9).contains(ms));
                    let interval = interval.ok_or_else(|| {
                        wrong(
                            "log.sample_time_ms is the interval of rows in ms, more than zero"
                                .into(),
                        )
                    })?;
                    mapping.time.sample_time = Some(interval * 1e-3);
                }
                _ => {
                    let Some(signal) = Signal::from_key(key) else {
                        let all = Signal::ALL.map(Signal::key).join(", ");
                        let key: String = key.chars().take(40).collect();
                        return Err(wrong(format!(
                            "log.{key} is no signal; signals are time, {all}; beside them there is sample_time_ms"
                        )));
                    };
                    let entry = entry(signal, value).map_err(|e| wrong(format!("log.{key}{e}")))?;
                    mapping.entries.insert(signal, entry);
                }
            }
        }
        Ok(mapping)
    }

    /// The `[log]` table of the mapping as TOML; guessed entries are marked by a comment.
    pub fn to_toml(&self) -> String {
        let mut text = String::from("[log]\n");
        // writing to a String cannot fail
        if let Some(interval) = self.time.sample_time {
            let _ = writeln!(text, "sample_time_ms = {:?}", interval * 1e3);
        }
        if self.time.column.is_some() || self.time.unit.is_some() || self.time.scale != 1.0 {
            text += "\n[log.time]\n";
            if let Some(column) = &self.time.column {
                let guessed = match self.time.is_guessed {
                    true => "  # guessed, with its unit, by name and content",
                    false => "",
                };
                let _ = writeln!(text, "column = {}{guessed}", quoted(column));
            }
            if let Some(unit) = self.time.unit {
                let _ = writeln!(text, "unit = {}", quoted(unit.name));
            }
            numbers(
                &mut text,
                &[("scale", self.time.scale, 1.0), ("offset", self.time.offset, 0.0)],
            );
        }
        for (signal, e) in &self.entries {
            let by_name = if e.is_column_guessed { "  # guessed by its name" } else { "" };
            let _ =
                writeln!(text, "\n[log.{}]\ncolumn = {}{by_name}", signal.key(), quoted(&e.column));
            if let Some(unit) = e.unit {
                let by_size = match e.is_unit_guessed {
                    true => "  # guessed by the size of the numbers: the log states none",
                    false => "",
                };
                let _ = writeln!(text, "unit = {}{by_size}", quoted(unit.name));
            }
            numbers(
                &mut text,
                &[
                    ("scale", e.scale, 1.0),
                    ("sign", e.sign, 1.0),
                    ("offset", e.offset, 0.0),
                    ("delay_ms", e.delay * 1e3, 0.0),
                    ("drift_ppm", e.drift * 1e6, 0.0),
                    ("filter_ms", e.filter * 1e3, 0.0),
                ],
            );
        }
        text
    }
}

fn numbers(text: &mut String, list: &[(&str, f64, f64)]) {
    for (key, value, usual) in list {
        if value != usual {
            let _ = writeln!(text, "{key} = {value:?}");
        }
    }
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.into()).to_string()
}

/// Reason and position of a TOML error, without the text itself.
fn place(error: &toml::de::Error, text: &str) -> String {
    let line = error.span().map_or(0, |span| {
        let before = text.as_bytes().get(..span.start).unwrap_or_default();
        before.iter().filter(|byte| **byte == b'\n').count() + 1
    });
    let message: String = error.message().chars().take(200).collect();
    format!("line {line}: {}", message.replace('\n', "; "))
}

fn number(value: &toml::Value) -> Option<f64> {
    value.as_float().or(value.as_integer().map(|i| i as f64)).filter(|v| v.is_finite())
}

fn time(value: &toml::Value) -> Result<TimeColumn, String> {
    let mut time = TimeColumn::default();
    let table = match value {
        toml::Value::String(column) => {
            time.column = Some(column.clone());
            return Ok(time);
        }
        toml::Value::Table(table) => table,
        _ => return Err(format!(" is a column's name, or a table with {TIME_KEYS}")),
    };
    for (key, value) in table {
        match (key.as_str(), number(value), value.as_str()) {
            ("column", _, Some(name)) => time.column = Some(name.into()),
            ("unit", _, Some(text)) => {
                let unit = Unit::of_dimension(text, crate::Dimension::Time);
                time.unit = Some(unit.map_err(|e| format!(".unit: {e}"))?);
            }
            ("scale", Some(scale), _) if scale > 0.0 => time.scale = scale,
            ("scale", ..) => return Err(".scale is more than zero".into()),
            ("offset", Some(offset), _) => time.offset = offset,
            _ => return Err(not_understood(key, value, TIME_KEYS)),
        }
    }
    Ok(time)
}

fn entry(signal: Signal, value: &toml::Value) -> Result<Entry, String> {
    let table = match value {
        toml::Value::String(column) => return Ok(Entry::of(column)),
        toml::Value::Table(table) => table,
        _ => return Err(format!(" is a column's name, or a table with {KEYS}")),
    };
    let column = table.get("column").and_then(toml::Value::as_str);
    let mut entry = Entry::of(column.ok_or(" has no column")?);
    for (key, value) in table {
        match (key.as_str(), number(value), value.as_str()) {
            ("column", _, Some(_)) => {}
            ("unit", _, Some(text)) => {
                entry.unit = Some(unit(signal, text).map_err(|e| format!(".unit: {e}"))?);
            }
            ("scale", Some(scale), _) if scale != 0.0 => entry.scale = scale,
            ("scale", ..) => return Err(".scale is a number, and not zero".into()),
            ("sign", Some(sign), _) if sign.abs() == 1.0 => entry.sign = sign,
            ("sign", ..) => return Err(".sign is 1 or -1".into()),
            ("offset", Some(offset), _) => entry.offset = offset,
            ("delay_ms", Some(delay), _) => entry.delay = delay * 1e-3,
            ("drift_ppm", Some(drift), _) if drift.abs() <= MOST_DRIFT => {
                entry.drift = drift * 1e-6;
            }
            ("filter_ms", Some(time), _) if time >= 0.0 => entry.filter = time * 1e-3,
            ("filter_ms", ..) => return Err(".filter_ms is zero or more".into()),
            ("drift_ppm", ..) => {
                return Err(format!(".drift_ppm is between -{MOST_DRIFT} and {MOST_DRIFT}"));
            }
            _ => return Err(not_understood(key, value, KEYS)),
        }
    }
    Ok(entry)
}

fn not_understood(key: &str, value: &toml::Value, keys: &str) -> String {
    if keys.split(", ").any(|known| known == key) {
        let value: String = value.to_string().chars().take(40).collect();
        let wanted = if matches!(key, "column" | "unit") { "a text" } else { "a finite number" };
        return format!(".{key} is {wanted}, not {value}");
    }
    let key: String = key.chars().take(40).collect();
    format!(".{key} is not understood: {keys} are")
}

/// Parses the unit that a mapping states for a signal.
fn unit(signal: Signal, text: &str) -> Result<Unit, UnitError> {
    match Unit::from_text(text) {
        Ok(unit) if signal.accepts(unit.dimension) => Ok(unit),
        _ => Unit::of_dimension(text, signal.dimension()),
    }
}
