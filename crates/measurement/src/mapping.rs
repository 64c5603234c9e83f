//! Which column is which signal.

use crate::channel::{Channel, Measurement};
use crate::error::MeasurementError;
use crate::signal::Signal;
use crate::unit::{Dimension, Unit};
use std::collections::BTreeMap;
use std::fmt::Write;

/// A column that holds a signal: `signal = sign (column + offset)`, as it was `delay` before, on a clock that may
/// run fast.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Heading or name of the column.
    pub column: String,
    /// Unit of the column.
    pub unit: Unit,
    /// −1 where the column counts the other way.
    pub sign: f64,
    /// What is added to the column, in its unit.
    pub offset: f64,
    /// How late the column is \[s\].
    pub delay: f64,
    /// How much too fast the column's clock runs: it counts 1 + drift seconds in one.
    pub drift: f64,
    /// Time constant of a first-order filter that the column went through \[s\]; zero for none.
    pub filter: f64,
    /// Whether the unit was named, or found by the size of the numbers.
    pub is_unit_guessed: bool,
}

/// Which column is which signal.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mapping {
    /// Heading of the time's column, where it is not named as one.
    pub time: Option<String>,
    /// The columns.
    pub entries: BTreeMap<Signal, Entry>,
}

/// Something about a signal that looks wrong.
#[derive(Clone, Debug, PartialEq)]
pub struct Suspicion {
    /// The signal.
    pub signal: Signal,
    /// What looks wrong, and what it may be.
    pub text: String,
}

/// Names of columns that are not what was measured.
const OTHERS: [&str; 12] = [
    "ref",
    "simulated",
    "sim",
    "error",
    "setpoint",
    "target",
    "model",
    "filtered",
    "number",
    "estimate",
    "deviation",
    "innovation",
];

/// A clock is not off by more \[ppm\].
const MOST_DRIFT: f64 = 1e5;

impl Entry {
    /// When a sample was taken that its channel has at a time \[s\], for a channel that begins at another.
    pub fn taken(&self, time: f64, begin: f64) -> f64 {
        begin + (time - begin) / (1.0 + self.drift) - self.delay
    }
}

impl Mapping {
    /// A mapping from the `[log]` table of a TOML text; signals are keys, each a column's name or a table.
    ///
    /// # Errors
    ///
    /// [`MeasurementError::Mapping`] with what is wrong and what is allowed.
    pub fn parse(file: &str, text: &str) -> Result<Self, MeasurementError> {
        let wrong = |reason: String| MeasurementError::Mapping { file: file.into(), reason };
        let whole: toml::Table = text.parse().map_err(|e: toml::de::Error| wrong(e.to_string()))?;
        let Some(log) = whole.get("log").and_then(toml::Value::as_table) else {
            return Err(wrong("there is no table [log]".into()));
        };
        let mut mapping = Self::default();
        for (key, value) in log {
            if key == "time" {
                let name =
                    value.as_str().ok_or_else(|| wrong("log.time is a column's name".into()))?;
                mapping.time = Some(name.into());
                continue;
            }
            let Some(signal) = Signal::from_key(key) else {
                let all = Signal::ALL.map(Signal::key).join(", ");
                return Err(wrong(format!("log.{key} is no signal; signals are time, {all}")));
            };
            mapping
                .entries
                .insert(signal, entry(signal, value).map_err(|e| wrong(format!("log.{key}{e}")))?);
        }
        Ok(mapping)
    }

    /// As a `[log]` table, to be written to a file.
    pub fn to_toml(&self) -> String {
        let mut text = String::from("[log]\n");
        // writing to a String cannot fail
        if let Some(time) = &self.time {
            let _ = writeln!(text, "time = {}", quoted(time));
        }
        for (signal, e) in &self.entries {
            let _ = write!(
                text,
                "\n[log.{}]\ncolumn = {}\nunit = {}\n",
                signal.key(),
                quoted(&e.column),
                quoted(e.unit.name)
            );
            for (key, value, usual) in [
                ("sign", e.sign, 1.0),
                ("offset", e.offset, 0.0),
                ("delay_ms", e.delay * 1e3, 0.0),
                ("drift_ppm", e.drift * 1e6, 0.0),
                ("filter_ms", e.filter * 1e3, 0.0),
            ] {
                if value != usual {
                    let _ = writeln!(text, "{key} = {value:?}");
                }
            }
        }
        text
    }

    /// What the columns are, as far as their names, units and sizes tell.
    pub fn guess(log: &Measurement) -> Self {
        let mut candidates: Vec<(f64, Signal, &Channel)> = Vec::new();
        for channel in &log.channels {
            for signal in Signal::ALL {
                let score = likeness(signal, channel);
                if score > 0.0 {
                    candidates.push((score, signal, channel));
                }
            }
        }
        candidates.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut mapping = Self::default();
        for (_, signal, channel) in candidates {
            let is_used = mapping.entries.values().any(|e| e.column == channel.heading);
            if is_used || mapping.entries.contains_key(&signal) {
                continue;
            }
            let unit = channel.unit.filter(|u| u.dimension == signal.dimension());
            mapping.entries.insert(
                signal,
                Entry {
                    column: channel.heading.clone(),
                    unit: unit.unwrap_or_else(|| by_size(signal, channel)),
                    sign: 1.0,
                    offset: 0.0,
                    delay: 0.0,
                    drift: 0.0,
                    filter: 0.0,
                    is_unit_guessed: unit.is_none(),
                },
            );
        }
        mapping
    }

    /// This mapping, completed by what is guessed of what it does not name.
    pub fn completed(mut self, log: &Measurement) -> Self {
        let taken: Vec<String> = self.entries.values().map(|e| e.column.clone()).collect();
        for (signal, entry) in Self::guess(log).entries {
            if !taken.contains(&entry.column) {
                self.entries.entry(signal).or_insert(entry);
            }
        }
        self
    }

    /// What looks wrong with units and sizes, for a cylinder with a stroke \[m\] and a motor with a largest speed
    /// \[rev/s\].
    pub fn suspicions(&self, log: &Measurement, stroke: f64, motor_speed: f64) -> Vec<Suspicion> {
        let mut found = Vec::new();
        for (signal, entry) in &self.entries {
            let Some(range) = log.channel(&entry.column).and_then(Channel::range) else { continue };
            let si = |v: f64| entry.sign * (v + entry.offset) * entry.unit.size;
            let (a, b) = (si(range.low), si(range.high));
            let (low, high) = (a.min(b), a.max(b));
            let fits = |low: f64, high: f64| match signal.dimension() {
                Dimension::Length => {
                    low >= -0.01 * stroke - 5e-3
                        && high <= 1.02 * stroke + 5e-3
                        && high > 1e-3 * stroke
                }
                Dimension::Pressure => low >= -1.2e5 && high <= 600e5 && high > 0.2e5,
                Dimension::Rotation => low.abs().max(high.abs()) <= 1.5 * motor_speed,
                Dimension::Share => low >= -0.01 && high <= 1.01,
                _ => true,
            };
            if fits(low, high) {
                continue;
            }
            let (shown, size) = signal.shown();
            let mut text = format!(
                "{} is {:.4} to {:.4} {shown} with \"{}\" in {}",
                signal.symbol(),
                low / size,
                high / size,
                entry.column,
                entry.unit.name
            );
            let other = Unit::ALL.into_iter().filter(|u| u.dimension == signal.dimension());
            let scaled = |u: &Unit| u.size / entry.unit.size;
            let better: Vec<&str> =
                other.filter(|u| fits(low * scaled(u), high * scaled(u))).map(|u| u.name).collect();
            // a length that moves by what the piston can, elsewhere: the cylinder's own length, say
            let is_shifted = signal.dimension() == Dimension::Length
                && (0.05 * stroke..=stroke).contains(&(high - low));
            match (better.as_slice(), fits(-high, -low)) {
                _ if is_shifted && low > 0.0 => {
                    let _ = write!(
                        text,
                        ": has it another zero? (offset, {:.1} at most)",
                        -low / entry.unit.size
                    );
                }
                (_, true) => text += ": does it count the other way? (sign = -1)",
                ([], _) => text += ": has it another zero (offset), or is it another signal?",
                (names, _) => {
                    let _ = write!(text, ": is it in {}?", names.join(" or "));
                }
            }
            found.push(Suspicion { signal: *signal, text });
        }
        found
    }
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.into()).to_string()
}

fn entry(signal: Signal, value: &toml::Value) -> Result<Entry, String> {
    let from_name = |column: &str| Entry {
        column: column.into(),
        unit: Unit::split(column).1.unwrap_or_else(|| first_unit(signal)),
        sign: 1.0,
        offset: 0.0,
        delay: 0.0,
        drift: 0.0,
        filter: 0.0,
        is_unit_guessed: Unit::split(column).1.is_none(),
    };
    let table = match value {
        toml::Value::String(column) => return Ok(from_name(column)),
        toml::Value::Table(table) => table,
        _ => {
            return Err(
                " is a column's name, or a table with column, unit, sign, offset, delay_ms, drift_ppm, filter_ms"
                    .into(),
            );
        }
    };
    let column = table.get("column").and_then(toml::Value::as_str);
    let mut entry = from_name(column.ok_or(" has no column")?);
    for (key, value) in table {
        let number =
            value.as_float().or(value.as_integer().map(|i| i as f64)).filter(|v| v.is_finite());
        match (key.as_str(), number, value.as_str()) {
            ("column", _, Some(_)) => {}
            ("unit", _, Some(text)) => {
                let unit = Unit::from_text(text).filter(|u| u.dimension == signal.dimension());
                entry.unit = unit.ok_or_else(|| {
                    let fitting = Unit::ALL.iter().filter(|u| u.dimension == signal.dimension());
                    let names: Vec<&str> = fitting.map(|u| u.name).collect();
                    format!(".unit = \"{text}\": one of {}", names.join(", "))
                })?;
                entry.is_unit_guessed = false;
            }
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
            _ => {
                return Err(format!(
                    ".{key} is not understood: column, unit, sign, offset, delay_ms, drift_ppm, filter_ms are"
                ));
            }
        }
    }
    Ok(entry)
}

/// The unit people use most.
fn first_unit(signal: Signal) -> Unit {
    let name = signal.shown().0;
    Unit::ALL.into_iter().find(|u| u.name == name).unwrap_or(Unit::ALL[0])
}

/// The unit in which a column's numbers have a likely size.
fn by_size(signal: Signal, channel: &Channel) -> Unit {
    let largest = channel.range().map_or(0.0, |r| r.low.abs().max(r.high.abs()));
    let name = match signal.dimension() {
        Dimension::Pressure if largest > 1e4 => "Pa",
        Dimension::Length if largest < 5.0 => "m",
        Dimension::Rotation if largest < 60.0 => "rev/s",
        _ => return first_unit(signal),
    };
    Unit::ALL.into_iter().find(|u| u.name == name).unwrap_or_else(|| first_unit(signal))
}

/// How likely a column is a signal: zero for not at all.
fn likeness(signal: Signal, channel: &Channel) -> f64 {
    if channel.unit.is_some_and(|u| u.dimension != signal.dimension()) || channel.range().is_none()
    {
        return 0.0;
    }
    let small = channel.name.to_lowercase();
    let words: Vec<&str> =
        small.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty()).collect();
    let is_command =
        matches!(signal, Signal::MotorCommand | Signal::HoldingValve | Signal::ValveCommand);
    let is_other = words.iter().any(|w| OTHERS.iter().any(|o| w.starts_with(o)));
    if is_other || (!is_command && words.iter().any(|w| w.starts_with("command") || *w == "cmd")) {
        return 0.0;
    }
    let whole: String = words.concat();
    // `p1_pressure`, `s1_position`: what it is of, said once more
    let said = match signal.dimension() {
        Dimension::Pressure => "pressure",
        Dimension::Length => "position",
        _ => "",
    };
    let short: String = words.iter().copied().filter(|word| *word != said).collect();
    // a variable of a PLC: the last part counts, without its prefix of type
    let last = channel.name.rsplit(['.', '/']).next().unwrap_or("");
    let last: String = last.chars().filter(|c| c.is_alphanumeric()).collect();
    let bare = last.trim_start_matches(['f', 'l', 'r', 'n', 'b']);
    let bare = if bare.starts_with(char::is_uppercase) {
        bare.to_lowercase()
    } else {
        last.to_lowercase()
    };
    let best = signal.names().iter().enumerate().map(|(rank, name)| {
        let telling = 1.0 - 0.02 * rank as f64;
        match () {
            _ if whole == *name || bare == *name => telling,
            _ if short == *name && short != whole => 0.9 * telling,
            _ if name.len() >= 5 && whole.contains(name) => 0.8 * telling,
            _ => 0.0,
        }
    });
    best.fold(0.0, f64::max)
}
