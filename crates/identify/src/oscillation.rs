//! Logs of an oscillation test: the load held, the boom dropped onto its locked cylinder (section 5.2.2).

use crate::drive::Drive;
use hydroboom_measurement::{Signal, Signals, Track};

/// A motor that turns no faster than this stands still \[rev/s\].
const STANDS: f64 = 0.2;
/// The boom is let go at the first extreme that is at least this share of the largest.
const FIRST: f64 = 0.8;
/// A swing of p_A smaller than this is none \[Pa\].
const SMALLEST: f64 = 0.2e5;
/// What a signal rests at is its mean over this last share of the log.
const RESTING: f64 = 0.5;

/// The moment at which the boom is farthest out, and at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Release {
    /// Time of the log \[s\].
    pub(crate) time: f64,
    /// p_A there, less what it comes to rest at \[Pa\].
    pub(crate) swing: f64,
}

/// Whether nothing drives the machine and its load is held throughout.
pub(crate) fn is_held(drive: &Drive) -> bool {
    match drive {
        Drive::Pump(inputs) => {
            inputs.iter().all(|i| i.holding_valve < 0.5 && i.pump_speed.abs() < STANDS)
        }
        Drive::Valve(..) => false,
    }
}

/// Where an oscillation begins, if p_A was measured and rings.
pub(crate) fn release(signals: &Signals, begin: f64, end: f64) -> Option<Release> {
    let pressure = signals.get(Signal::PressureA)?;
    let rest = resting(pressure, begin, end)?;
    let there = || {
        let pairs = pressure.time().iter().zip(pressure.values());
        pairs.map(|(t, v)| (*t, v - rest)).filter(|(t, _)| (begin..=end).contains(t))
    };
    let largest = there().fold(0.0_f64, |largest, (_, v)| largest.max(v.abs()));
    if largest < SMALLEST {
        return None;
    }
    let seen: Vec<(f64, f64)> = there().collect();
    let first = seen.iter().position(|(_, v)| v.abs() >= FIRST * largest)?;
    // from there up to the extreme
    let mut best = first;
    for k in first..seen.len() {
        let is_same_side = seen[k].1 * seen[first].1 > 0.0;
        if !is_same_side {
            break;
        }
        if seen[k].1.abs() > seen[best].1.abs() {
            best = k;
        }
    }
    Some(Release { time: seen[best].0, swing: seen[best].1 })
}

/// What a signal comes to rest at.
pub(crate) fn resting(track: &Track, begin: f64, end: f64) -> Option<f64> {
    let from = end - RESTING * (end - begin);
    let pairs = track.time().iter().zip(track.values());
    let (sum, count) = pairs
        .filter(|(t, _)| (from..=end).contains(*t))
        .fold((0.0, 0.0), |(sum, count), (_, v)| (sum + v, count + 1.0));
    (count > 0.0).then(|| sum / count)
}
