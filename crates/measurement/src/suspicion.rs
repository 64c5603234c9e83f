//! What looks wrong with the size of signals.

use crate::channel::Measurement;
use crate::dimension::Dimension;
use crate::mapping::Mapping;
use crate::signal::Signal;
use crate::unit::Unit;
use std::fmt::Write;

/// Units that are named as what a signal may be in, at most.
const MOST_NAMED: usize = 4;

/// Something about a signal that looks wrong.
#[derive(Clone, Debug, PartialEq)]
pub struct Suspicion {
    /// The signal.
    pub signal: Signal,
    /// What looks wrong, and what it may be.
    pub text: String,
}

impl Mapping {
    /// What looks wrong with units and sizes, for a cylinder with a stroke \[m\] and a motor with a largest speed
    /// \[rev/s\].
    pub fn suspicions(&self, log: &Measurement, stroke: f64, motor_speed: f64) -> Vec<Suspicion> {
        let mut found = Vec::new();
        for (signal, entry) in &self.entries {
            let Some(channel) = log.channel(&entry.column) else { continue };
            let Some(range) = channel.range() else { continue };
            let Ok((unit, _)) = entry.unit_of(*signal, channel) else { continue };
            let si = |v: f64| entry.si(&unit, v);
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
                unit.name
            );
            let other =
                Unit::ALL.iter().filter(|u| u.dimension == unit.dimension && u.offset == 0.0);
            let scaled = |u: &Unit| u.factor / unit.factor;
            let better: Vec<&str> = other
                .filter(|u| fits(low * scaled(u), high * scaled(u)))
                .map(|u| u.name)
                .take(MOST_NAMED)
                .collect();
            // a length that moves by what the piston can, elsewhere: the cylinder's own length, say
            let is_shifted = signal.dimension() == Dimension::Length
                && (0.05 * stroke..=stroke).contains(&(high - low));
            match (better.as_slice(), fits(-high, -low)) {
                _ if is_shifted && low > 0.0 => {
                    let _ = write!(
                        text,
                        ": has it another zero? (offset, {:.1} at most)",
                        -low / unit.factor
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
