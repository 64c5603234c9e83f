//! Automatic assignment of columns to signals, by names, units and magnitudes.

use crate::channel::{Channel, Measurement};
use crate::dimension::Dimension;
use crate::mapping::{Entry, Mapping};
use crate::signal::Signal;
use crate::unit::Unit;

/// Name parts of columns that are not measured quantities.
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
/// Largest number of equally named columns that a message lists.
const MOST_NAMED: usize = 40;
/// Score at or above which a name is the signal's own.
const OWN: f64 = 0.9;
/// Share of the assigned column's score above which another column is reported as an alternative.
const ALTERNATIVE: f64 = 0.75;

impl Mapping {
    /// Assigns columns to signals by their names, units and magnitudes: for each signal the column of the highest
    /// score. A signal for which several columns have the same name and score stays without one.
    pub fn guess(log: &Measurement) -> Self {
        let mut candidates: Vec<(f64, Signal, &Channel)> = Vec::new();
        for channel in &log.channels {
            for signal in Signal::ALL {
                let score = column_score(signal, channel);
                if score > 0.0 {
                    candidates.push((score, signal, channel));
                }
            }
        }
        candidates.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut mapping = Self::default();
        // names with equal scores for one signal
        let mut doubtful: Vec<(Signal, f64, &str)> = Vec::new();
        for (score, signal, channel) in &candidates {
            // early exit for most of thousands of columns: the check below is quadratic
            let called = last_part(&channel.name);
            if mapping.entries.contains_key(signal) || doubtful.contains(&(*signal, *score, called))
            {
                continue;
            }
            let column = log.address(channel);
            if mapping.entries.values().any(|e| e.column == column) {
                continue;
            }
            // between equally named columns only a mapping can decide
            let is_other = |c: &&(f64, Signal, &Channel)| {
                c.0 == *score
                    && c.1 == *signal
                    && last_part(&c.2.name) == called
                    && !is_same(c.2, channel)
            };
            if candidates.iter().any(|c| is_other(&c)) {
                doubtful.push((*signal, *score, called));
                continue;
            }
            let mut entry = Entry { is_column_guessed: true, ..Entry::of(&column) };
            // no unit is guessed in place of an unknown stated one; the error is reported on use
            if let Ok((unit, is_guessed)) = entry.unit_of(*signal, channel) {
                (entry.unit, entry.is_unit_guessed) = (Some(unit), is_guessed);
            }
            mapping.entries.insert(*signal, entry);
        }
        mapping
    }

    /// Signals with several equally named columns that differ, and the names of these columns.
    pub(crate) fn ambiguous(log: &Measurement) -> Vec<(Signal, Vec<String>)> {
        let mut found = Vec::new();
        for signal in Signal::ALL {
            let likely: Vec<(f64, &Channel)> =
                log.channels.iter().map(|c| (column_score(signal, c), c)).collect();
            let best = likely.iter().map(|(score, _)| *score).fold(0.0, f64::max);
            let best: Vec<&Channel> =
                likely.iter().filter(|(s, _)| best > 0.0 && *s == best).map(|(_, c)| *c).collect();
            if let [first, rest @ ..] = best.as_slice()
                && rest
                    .iter()
                    .any(|c| last_part(&c.name) == last_part(&first.name) && !is_same(c, first))
            {
                let named = best.iter().take(MOST_NAMED).map(|c| log.address(c));
                found.push((signal, named.collect()));
            }
        }
        found
    }

    /// Signals that were assigned a column while another, different column without a signal scores almost as high.
    pub(crate) fn alternatives(&self, log: &Measurement) -> Vec<(Signal, Vec<String>)> {
        let taken: Vec<&Channel> =
            self.entries.values().filter_map(|e| log.channel(&e.column)).collect();
        let is_free = |c: &Channel| !taken.iter().any(|t| is_same(t, c));
        let mut found = Vec::new();
        for (signal, entry) in self.entries.iter().filter(|(_, e)| e.is_column_guessed) {
            let least =
                ALTERNATIVE * log.channel(&entry.column).map_or(0.0, |c| column_score(*signal, c));
            let others: Vec<String> = log
                .channels
                .iter()
                .filter(|c| column_score(*signal, c) >= least.max(f64::MIN_POSITIVE) && is_free(c))
                .take(MOST_NAMED)
                .map(|c| format!("\"{}\"", log.address(c)))
                .collect();
            if !others.is_empty() {
                found.push((*signal, others));
            }
        }
        found
    }

    /// Columns with a signal's name but a unit of another dimension.
    pub(crate) fn misfits(log: &Measurement) -> Vec<(Signal, &Channel)> {
        let mut found = Vec::new();
        for channel in log.channels.iter().filter(|c| c.unit.is_some()) {
            for signal in Signal::ALL {
                if channel.unit.is_some_and(|u| !signal.accepts(u.dimension))
                    && name_score(signal, channel) >= OWN
                {
                    found.push((signal, channel));
                }
            }
        }
        found
    }
}

/// Last part of a path: equal for `/cyl1.position` and `/cyl2.position`.
fn last_part(name: &str) -> &str {
    name.rsplit(['.', '/']).next().unwrap_or(name)
}

/// Whether two channels hold the same samples.
fn is_same(a: &Channel, b: &Channel) -> bool {
    let same = |a: &[f64], b: &[f64]| {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a == b || (a.is_nan() && b.is_nan()))
    };
    std::ptr::eq(a, b) || (same(&a.values, &b.values) && same(&a.time, &b.time))
}

/// The most common unit of a signal.
fn first_unit(signal: Signal) -> Unit {
    let name = signal.shown().0;
    Unit::find(name).unwrap_or(Unit::ALL[0])
}

/// The unit for which a column's magnitude is plausible.
pub(crate) fn by_size(signal: Signal, channel: &Channel, scale: f64) -> Unit {
    let largest = channel.range().map_or(0.0, |r| r.low.abs().max(r.high.abs())) * scale.abs();
    let name = match signal.dimension() {
        Dimension::Pressure if largest > 1e4 => "Pa",
        Dimension::Length if largest < 5.0 => "m",
        Dimension::Rotation if largest < 60.0 => "rev/s",
        _ => return first_unit(signal),
    };
    Unit::find(name).unwrap_or_else(|| first_unit(signal))
}

/// Score of a column as a signal, 0 to 1; zero excludes it.
fn column_score(signal: Signal, channel: &Channel) -> f64 {
    match channel.unit.is_none_or(|u| signal.accepts(u.dimension)) && channel.range().is_some() {
        true => name_score(signal, channel),
        false => 0.0,
    }
}

/// Score of a column's name for a signal, 0 to 1; zero excludes it.
fn name_score(signal: Signal, channel: &Channel) -> f64 {
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
    // `p1_pressure`, `s1_position`: the name repeats the dimension
    let said = match signal.dimension() {
        Dimension::Pressure => "pressure",
        Dimension::Length => "position",
        _ => "",
    };
    let short: String = words.iter().copied().filter(|word| *word != said).collect();
    // a PLC variable: its last part, without the type prefix
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
