//! Which column is which signal, as far as names, units and sizes tell.

use crate::channel::{Channel, Measurement};
use crate::dimension::Dimension;
use crate::mapping::{Entry, Mapping};
use crate::signal::Signal;
use crate::unit::Unit;

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
/// Columns that are named of those that are called the same, at most.
const MOST_NAMED: usize = 40;
/// A name that is as likely is the signal's own.
const OWN: f64 = 0.9;
/// A column may be a signal too that is so likely beside the one that was taken.
const RIVAL: f64 = 0.75;

impl Mapping {
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
        // what several columns are called that are as likely, for a signal
        let mut doubtful: Vec<(Signal, f64, &str)> = Vec::new();
        for (score, signal, channel) in &candidates {
            // of thousands of columns most end here: what follows looks at all of them
            let called = last_part(&channel.name);
            if mapping.entries.contains_key(signal) || doubtful.contains(&(*signal, *score, called))
            {
                continue;
            }
            let column = log.address(channel);
            if mapping.entries.values().any(|e| e.column == column) {
                continue;
            }
            // of several that are called the same, which one is meant is for a mapping to say
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
            // a unit that is stated and unknown is no reason to guess another: it is told where the mapping is used
            if let Ok((unit, is_guessed)) = entry.unit_of(*signal, channel) {
                (entry.unit, entry.is_unit_guessed) = (Some(unit), is_guessed);
            }
            mapping.entries.insert(*signal, entry);
        }
        mapping
    }

    /// Signals for which several columns stand that are called the same and differ, with what those are called.
    pub(crate) fn ambiguous(log: &Measurement) -> Vec<(Signal, Vec<String>)> {
        let mut found = Vec::new();
        for signal in Signal::ALL {
            let likely: Vec<(f64, &Channel)> =
                log.channels.iter().map(|c| (likeness(signal, c), c)).collect();
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

    /// Columns that may be a signal too for which another one was guessed, where they differ and are taken for nothing else.
    pub(crate) fn rivals(&self, log: &Measurement) -> Vec<(Signal, Vec<String>)> {
        let taken: Vec<&Channel> =
            self.entries.values().filter_map(|e| log.channel(&e.column)).collect();
        let is_free = |c: &Channel| !taken.iter().any(|t| is_same(t, c));
        let mut found = Vec::new();
        for (signal, entry) in self.entries.iter().filter(|(_, e)| e.is_column_guessed) {
            let least = RIVAL * log.channel(&entry.column).map_or(0.0, |c| likeness(*signal, c));
            let others: Vec<String> = log
                .channels
                .iter()
                .filter(|c| likeness(*signal, c) >= least.max(f64::MIN_POSITIVE) && is_free(c))
                .take(MOST_NAMED)
                .map(|c| format!("\"{}\"", log.address(c)))
                .collect();
            if !others.is_empty() {
                found.push((*signal, others));
            }
        }
        found
    }

    /// Columns that are named as a signal, in a unit that is none of it.
    pub(crate) fn misfits(log: &Measurement) -> Vec<(Signal, &Channel)> {
        let mut found = Vec::new();
        for channel in log.channels.iter().filter(|c| c.unit.is_some()) {
            for signal in Signal::ALL {
                if channel.unit.is_some_and(|u| !signal.accepts(u.dimension))
                    && likeness_of_name(signal, channel) >= OWN
                {
                    found.push((signal, channel));
                }
            }
        }
        found
    }
}

/// What a name ends with: of `/cyl1.position` and `/cyl2.position` the same.
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

/// The unit people use most.
fn first_unit(signal: Signal) -> Unit {
    let name = signal.shown().0;
    Unit::find(name).unwrap_or(Unit::ALL[0])
}

/// The unit in which a column's numbers have a likely size.
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

/// How likely a column is a signal: zero for not at all.
fn likeness(signal: Signal, channel: &Channel) -> f64 {
    match channel.unit.is_none_or(|u| signal.accepts(u.dimension)) && channel.range().is_some() {
        true => likeness_of_name(signal, channel),
        false => 0.0,
    }
}

/// How likely a column's name is a signal's: zero for not at all.
fn likeness_of_name(signal: Signal, channel: &Channel) -> f64 {
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
