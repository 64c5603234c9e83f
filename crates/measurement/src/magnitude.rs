//! Plausibility of guessed units against the magnitudes that a crane's model predicts.

use crate::channel::Measurement;
use crate::contradiction::speeds;
use crate::mapping::{Entry, Mapping};
use crate::signal::Signal;
use crate::signals::Signals;
use crate::suspicion::Suspicion;
use crate::unit::Unit;

/// Magnitudes that a crane's model predicts for its signals, to judge guessed units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    /// Smallest and largest piston-side pressure in equilibrium over the stroke \[Pa\].
    pub holding_pressure: [f64; 2],
    /// Piston travel per revolution of the motor \[m/rev\].
    pub travel: f64,
}

/// Ratio of measured to expected magnitude up to which a unit is plausible; other loads, leakage and acceleration
/// explain it.
const PLAUSIBLE: f64 = 3.0;
/// Another unit is proposed if it brings the ratio within this factor.
const NEAR: f64 = 2.0;
/// Usual units of pressures.
const PRESSURES: [&str; 6] = ["bar", "MPa", "psi", "kPa", "mbar", "Pa"];
const ROTATIONS: [&str; 4] = ["rpm", "rad/s", "rev/s", "deg/s"];

impl Mapping {
    /// Guessed units whose magnitudes do not fit the crane, with the unit that would fit. Checked are the load
    /// pressure against equilibrium, and the motor speed against the piston speed. A unit is doubted if measured and
    /// expected magnitude differ by more than a factor of 3 (estimate). Units that the log states are not questioned.
    pub fn unit_suspicions(&self, log: &Measurement, expected: &Expected) -> Vec<Suspicion> {
        let mut found = Vec::new();
        let pressures = [Signal::PressureA, Signal::PressurePumpA];
        found
            .extend(pressures.iter().find_map(|signal| self.load_pressure(log, expected, *signal)));
        found.extend(self.motor_speed(log, expected));
        found
    }

    /// The entry of a signal whose unit was guessed, with that unit.
    fn guessed(&self, signal: Signal) -> Option<(&Entry, Unit)> {
        let entry = self.entries.get(&signal).filter(|entry| entry.is_unit_guessed)?;
        Some((entry, entry.unit?))
    }

    fn load_pressure(
        &self,
        log: &Measurement,
        expected: &Expected,
        signal: Signal,
    ) -> Option<Suspicion> {
        let (entry, unit) = self.guessed(signal)?;
        let channel = log.channel(&entry.column)?;
        let mut values: Vec<f64> =
            channel.values.iter().filter(|v| v.is_finite()).map(|v| entry.si(&unit, *v)).collect();
        let middle = values.len() / 2;
        let median = *values.get_mut(..)?.select_nth_unstable_by(middle, f64::total_cmp).1;
        let [low, high] = expected.holding_pressure;
        let ratio = median / (low * high).max(0.0).sqrt();
        let other = fitting(ratio, &unit, &PRESSURES)?;
        let bar = 1e-5;
        let text = format!(
            "{} is {:.3} bar in the middle, with \"{}\" taken for {} by its size alone; this crane rests at {:.0} to {:.0} bar there: is it in {name}? \
             ([log.{}] unit = \"{name}\"; other pressures without a unit may be so, too)",
            signal.symbol(),
            median * bar,
            entry.column,
            unit.name,
            low * bar,
            high * bar,
            signal.key(),
            name = other.name
        );
        Some(Suspicion { signal, text, is_unusable: false })
    }

    fn motor_speed(&self, log: &Measurement, expected: &Expected) -> Option<Suspicion> {
        let signal = Signal::MotorSpeed;
        let (entry, unit) = self.guessed(signal)?;
        let pairs = speeds(&Signals::of(log, self).ok()?)?;
        let (both, square) = pairs.iter().fold((0.0, 0.0), |(both, square), (piston, motor)| {
            (both + piston * motor, square + motor * motor)
        });
        // least-squares ratio of the motor speed to the one that the piston speed requires
        let ratio = expected.travel * square / both.abs();
        let other = fitting(ratio, &unit, &ROTATIONS)?;
        let text = format!(
            "the motor, with \"{}\" taken for {} by its size alone, turns {:.3} times as fast as this crane's piston moves: is it in {name}? \
             ([log.{}] unit = \"{name}\")",
            entry.column,
            unit.name,
            ratio,
            signal.key(),
            name = other.name
        );
        Some(Suspicion { signal, text, is_unusable: false })
    }
}

/// The unit that brings `ratio` (measured over expected magnitude) nearest to 1. `None` if the ratio is plausible or no
/// unit brings it within [`NEAR`].
fn fitting(ratio: f64, taken: &Unit, names: &[&str]) -> Option<Unit> {
    let off = |ratio: f64| ratio.ln().abs();
    if !ratio.is_finite() || ratio <= 0.0 || off(ratio) <= PLAUSIBLE.ln() {
        return None;
    }
    let units = names.iter().filter_map(|name| Unit::find(name));
    let of = |unit: &Unit| off(ratio * unit.factor / taken.factor);
    units.min_by(|a, b| of(a).total_cmp(&of(b))).filter(|unit| of(unit) <= NEAR.ln())
}
