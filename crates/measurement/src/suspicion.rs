//! Plausibility checks of signals and units.

use crate::channel::{Channel, Measurement};
use crate::contradiction::contradictions;
use crate::dimension::Dimension;
use crate::mapping::{Entry, Mapping};
use crate::signal::Signal;
use crate::signals::Signals;
use crate::unit::Unit;
use crate::unit_table::ATMOSPHERE;
use std::fmt::Write;

/// Largest number of candidate units in a message.
const MOST_NAMED: usize = 4;

/// No pressure of such a machine is higher \[Pa\].
const HIGHEST: f64 = 600e5;
/// Pressures on both sides of an open valve agree to this share: a unit that brings one no nearer to the other is not named.
const SAME: f64 = 0.05;

/// The pressure on the other side of a valve that is open while the machine moves.
fn beside(signal: Signal) -> Option<Signal> {
    match signal {
        Signal::PressureA => Some(Signal::PressurePumpA),
        Signal::PressurePumpA => Some(Signal::PressureA),
        Signal::PressureB => Some(Signal::PressurePumpB),
        Signal::PressurePumpB => Some(Signal::PressureB),
        _ => None,
    }
}

/// Implausible property of a signal, for the user.
#[derive(Clone, Debug, PartialEq)]
pub struct Suspicion {
    /// Signal concerned.
    pub signal: Signal,
    /// Description and possible cause, with the line of a mapping that corrects it.
    pub text: String,
    /// Whether the signal cannot be used without a correction. An absolute pressure can, because only its zero
    /// differs.
    pub is_unusable: bool,
}

/// Range of the atmospheric pressure \[Pa\]: a gauge pressure that rests here may be an absolute one.
const OPEN_AIR: std::ops::Range<f64> = 0.98e5..1.05e5;
/// Share of the log in which it must rest there.
const RESTING: f64 = 0.1;

/// Evidence of an absolute pressure in a channel that is assigned as a gauge pressure.
fn absolute(signal: Signal, entry: &Entry, unit: &Unit, channel: &Channel) -> Option<String> {
    if signal.dimension() != Dimension::Pressure || unit.offset != 0.0 || entry.offset != 0.0 {
        return None;
    }
    let small = channel.heading.to_lowercase();
    let is_named = small.split(|c: char| !c.is_alphanumeric()).any(|w| w.starts_with("abs"));
    let values = || channel.values.iter().filter(|v| v.is_finite()).map(|v| entry.si(unit, *v));
    let (mut count, mut resting, mut below) = (0_usize, 0_usize, 0_usize);
    for value in values() {
        count += 1;
        resting += usize::from(OPEN_AIR.contains(&value));
        below += usize::from(value < OPEN_AIR.start);
    }
    let rests = resting as f64 > RESTING * count as f64 && below * 100 <= count;
    let why = match (is_named, rests) {
        (true, _) => "is named as an absolute pressure".to_string(),
        (_, true) => format!(
            "rests at about 1 bar for {:.0} % of the log, and is never lower",
            100.0 * resting as f64 / count as f64
        ),
        _ => return None,
    };
    let offset = format!("offset = {:.4}", -ATMOSPHERE / (entry.sign * unit.factor));
    let stated = format!("{} abs", unit.name);
    let remedy = match Unit::find(&stated) {
        Some(unit) => format!("unit = \"{}\", or {offset}", unit.name),
        None => offset,
    };
    Some(format!(
        "{} (\"{}\") {why}, and is taken for gauge pressure: is it absolute? ([log.{}] {remedy})",
        signal.symbol(),
        entry.column,
        signal.key()
    ))
}

impl Mapping {
    /// Median of a signal's values over that of another one's, both in SI units; none where one was not measured.
    fn size_over(&self, signal: Signal, other: Signal, log: &Measurement) -> Option<f64> {
        let median = |signal: Signal| {
            let entry = self.entries.get(&signal)?;
            let channel = log.channel(&entry.column)?;
            let (unit, _) = entry.unit_of(signal, channel).ok()?;
            let values = channel.values.iter().filter(|v| v.is_finite());
            let mut values: Vec<f64> = values.map(|v| entry.si(&unit, *v)).collect();
            if values.is_empty() {
                return None;
            }
            let middle = values.len() / 2;
            Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
        };
        // one that is in another unit itself tells nothing
        let there = median(other).filter(|size| (0.0..=HIGHEST).contains(size))?;
        Some(median(signal)? / there).filter(|ratio| ratio.is_finite())
    }

    /// Implausible units and magnitudes, and contradictions between signals, for a cylinder with a stroke \[m\] and a
    /// motor with a largest speed \[rev/s\].
    pub fn suspicions(&self, log: &Measurement, stroke: f64, motor_speed: f64) -> Vec<Suspicion> {
        let mut found = Vec::new();
        for (signal, entry) in &self.entries {
            let Some(channel) = log.channel(&entry.column) else { continue };
            let Some(range) = channel.range() else { continue };
            let Ok((unit, _)) = entry.unit_of(*signal, channel) else { continue };
            let si = |v: f64| entry.si(&unit, v);
            if let Some(text) = absolute(*signal, entry, &unit, channel) {
                found.push(Suspicion { signal: *signal, text, is_unusable: false });
            }
            let (a, b) = (si(range.low), si(range.high));
            let (low, high) = (a.min(b), a.max(b));
            let fits = |low: f64, high: f64| match signal.dimension() {
                Dimension::Length => {
                    low >= -0.01 * stroke - 5e-3
                        && high <= 1.02 * stroke + 5e-3
                        && high > 1e-3 * stroke
                }
                // a tank line's pressure may be zero
                Dimension::Pressure => {
                    let least = if *signal == Signal::PressureTank { -1.2e5 } else { 0.2e5 };
                    low >= -1.2e5 && high <= HIGHEST && high > least
                }
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
                unit.name
            );
            let other =
                Unit::ALL.iter().filter(|u| u.dimension == unit.dimension && u.offset == 0.0);
            let scaled = |u: &Unit| u.factor / unit.factor;
            let size = beside(*signal).and_then(|other| self.size_over(*signal, other, log));
            let is_of_size =
                |u: &Unit| size.is_none_or(|size| (size * scaled(u) - 1.0).abs() < SAME);
            // no unit makes a pressure below vacuum of one above
            let is_below = signal.dimension() == Dimension::Pressure && low < -SAME * high;
            let better: Vec<&str> = other
                .filter(|u| !is_below && fits(low * scaled(u), high * scaled(u)) && is_of_size(u))
                .map(|u| u.name)
                .take(MOST_NAMED)
                .collect();
            // a length with the range of the stroke but another zero, for example of the whole cylinder
            let is_shifted = signal.dimension() == Dimension::Length
                && (0.05 * stroke..=stroke).contains(&(high - low));
            match (better.as_slice(), fits(-high, -low)) {
                _ if is_shifted && low > 0.0 => {
                    let _ = write!(
                        text,
                        ": has it another zero? (offset = {:.1} makes its smallest value 0)",
                        entry.offset - low / (entry.sign * unit.factor)
                    );
                }
                (_, true) if signal.dimension() == Dimension::Pressure => {
                    text += ": has it another zero (offset), or does it count the other way (sign = -1)?";
                }
                (_, true) => text += ": does it count the other way? (sign = -1)",
                ([], _) => text += ": has it another zero (offset), or is it another signal?",
                (names, _) => {
                    let _ = write!(text, ": is it in {}?", names.join(" or "));
                }
            }
            found.push(Suspicion { signal: *signal, text, is_unusable: true });
        }
        // an invalid mapping is reported where it is used
        let signals = Signals::of(log, self).unwrap_or_default();
        found.extend(contradictions(&signals));
        found
    }
}
