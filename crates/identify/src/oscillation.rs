//! Logs of an oscillation test: with the load held, the boom is dropped onto its locked cylinder (section
//! 5.2.2).

use crate::drive::Drive;
use hydroboom_measurement::{Signal, Signals, Track};

/// Motor speed below which it stands still \[rev/s\].
const STANDSTILL: f64 = 0.2;
/// The release is the first extreme of at least this share of the largest one.
const FIRST_EXTREME: f64 = 0.8;
/// Smallest amplitude of p_A that counts as an oscillation \[Pa\].
const SMALLEST_AMPLITUDE: f64 = 0.2e5;
/// Last share of the log whose mean is the final value of a signal.
const FINAL_SHARE: f64 = 0.5;

/// Moment of largest deflection, at which the boom is at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Release {
    /// Log time \[s\].
    pub(crate) time: f64,
    /// p_A at that time minus its final value \[Pa\].
    pub(crate) deflection: f64,
}

impl Release {
    /// Remark on its log.
    pub(crate) fn remark(self) -> String {
        format!(
            "an oscillation test: the load is held, the boom let go at {:.3} s with p_A {:+.2} bar off",
            self.time,
            self.deflection * 1e-5
        )
    }
}

/// Whether the machine is not driven and its load is held throughout.
pub(crate) fn is_held(drive: &Drive) -> bool {
    match drive {
        Drive::Pump(inputs) => {
            inputs.iter().all(|i| i.holding_valve < 0.5 && i.pump_speed.abs() < STANDSTILL)
        }
        Drive::Valve(..) => false,
    }
}

/// Start of an oscillation, if p_A was measured and oscillates.
pub(crate) fn release(signals: &Signals, begin: f64, end: f64) -> Option<Release> {
    let pressure = signals.get(Signal::PressureA)?;
    let rest = final_value(pressure, begin, end)?;
    let there = || {
        let pairs = pressure.time().iter().zip(pressure.values());
        pairs.map(|(t, v)| (*t, v - rest)).filter(|(t, _)| (begin..=end).contains(t))
    };
    let largest = there().fold(0.0_f64, |largest, (_, v)| largest.max(v.abs()));
    if largest < SMALLEST_AMPLITUDE {
        return None;
    }
    let seen: Vec<(f64, f64)> = there().collect();
    let first = seen.iter().position(|(_, v)| v.abs() >= FIRST_EXTREME * largest)?;
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
    Some(Release { time: seen[best].0, deflection: seen[best].1 })
}

/// Final value of a signal.
pub(crate) fn final_value(track: &Track, begin: f64, end: f64) -> Option<f64> {
    let from = end - FINAL_SHARE * (end - begin);
    let pairs = track.time().iter().zip(track.values());
    let (sum, count) = pairs
        .filter(|(t, _)| (from..=end).contains(*t))
        .fold((0.0, 0.0), |(sum, count), (_, v)| (sum + v, count + 1.0));
    (count > 0.0).then(|| sum / count)
}
