//! Plausibility of measurements: range, rate of change, stuck and noisy signals, age.

use super::fault::Cause;
use super::limits::{Limits, Observation};
use crate::measurement::AxisSignals;

/// Ratio of piston speed to the largest speed by pump flow above which the piston counts as running away \[1\].
pub const RUNAWAY: f64 = 1.5;
/// Readings that the velocity is averaged over.
pub(crate) const VELOCITY_WINDOW: f64 = 20.0;
/// Readings that the scatter of a signal is averaged over.
const SCATTER_WINDOW: u32 = 64;
/// How far beyond its stroke a piston may be read \[m\]: end stops give way, encoders have a zero.
pub(crate) const STROKE_SLACK: f64 = 5e-3;
/// Lowest pressure that is read of a sound transducer \[Pa\]: a vacuum, and the transducer's error.
pub(crate) const LOWEST_PRESSURE: f64 = -1.5e5;
/// Signals that are watched one by one: position, then five pressures.
const SIGNALS: usize = 6;

/// State of the plausibility checks.
#[derive(Clone, Debug, Default)]
pub(crate) struct Plausibility {
    last: Option<AxisSignals<f64>>,
    /// Time for which each signal has repeated itself \[s\].
    repeated: [f64; SIGNALS],
    /// Mean square of each signal's second difference, a sixth of it.
    scatter: [f64; SIGNALS],
    differences: [f64; SIGNALS],
    /// Velocity of the piston, averaged \[m/s\].
    velocity: f64,
    /// Largest velocity of late, forgotten within a swing or two \[m/s\].
    swing: f64,
    /// New readings since the start, saturating.
    readings: u32,
}

impl Plausibility {
    /// Velocity of the piston, averaged \[m/s\].
    pub(crate) fn velocity(&self) -> f64 {
        self.velocity
    }

    /// Largest velocity of late \[m/s\].
    pub(crate) fn swing(&self) -> f64 {
        self.swing
    }

    /// What is wrong with the readings themselves. While the valve is switching pressures may step.
    pub(crate) fn judge(
        &self,
        seen: &Observation,
        l: &Limits,
        is_switching: bool,
    ) -> Option<Cause> {
        let values = signals(&seen.reading);
        if !(values.iter().all(|v| v.is_finite()) && seen.reading.motor_speed.is_finite()) {
            return Some(Cause::NotANumber);
        }
        if seen.age.is_nan() || seen.age > l.stale {
            return Some(Cause::MachineLost);
        }
        let [stroke, pressures @ ..] = values;
        let [stroke_range, pressure_ranges @ ..] = signals(&ranges(l));
        let is_within =
            |value: &f64, (lowest, highest): (f64, f64)| (lowest..=highest).contains(value);
        if !is_within(&stroke, stroke_range) {
            return Some(Cause::PositionImplausible);
        }
        if !pressures.iter().zip(pressure_ranges).all(|(p, range)| is_within(p, range)) {
            return Some(Cause::PressureImplausible);
        }
        if let Some(last) = self.last.filter(|_| seen.new_readings > 0) {
            let [before, pressures_before @ ..] = signals(&last);
            // what the piston can do between both readings, and the scatter of its encoder
            let fastest = l.speed.max(l.motor_speed * l.speed_per_motor_speed);
            let periods = f64::from(seen.new_readings) + 1.0;
            let reach = periods * l.period * RUNAWAY * fastest + 6.0 * l.scatter.0;
            if (stroke - before).abs() > reach {
                return Some(Cause::PositionJumped);
            }
            let pairs = pressures.iter().zip(pressures_before);
            let steps =
                pairs.into_iter().any(|(now, before)| (now - before).abs() > l.pressure_step);
            if steps && !is_switching {
                return Some(Cause::PressureJumped);
            }
        }
        // a transducer at the end of its range stands still because the pressure is too high
        let repeats = self.repeated.iter().zip(values);
        let is_stuck = repeats
            .enumerate()
            .any(|(k, (time, value))| *time > l.stuck && (k == 0 || value <= l.pressure));
        if l.stuck > 0.0 && is_stuck {
            return Some(Cause::SensorStuck);
        }
        let [position_scatter, pressure_scatters @ ..] = self.scatter;
        let noisy = position_scatter > l.scatter.0 * l.scatter.0
            || pressure_scatters.iter().any(|s| *s > l.scatter.1 * l.scatter.1);
        if self.readings > SCATTER_WINDOW && noisy {
            return Some(Cause::SensorNoisy);
        }
        // last, because it is the mildest: what is worse is not hidden behind it
        if pressures.iter().any(|p| *p > l.pressure) {
            return Some(Cause::OverPressure);
        }
        None
    }

    /// Takes a new reading into what is watched over time.
    pub(crate) fn remember(&mut self, seen: &Observation, l: &Limits, swing_memory: f64) {
        let values = signals(&seen.reading);
        if seen.new_readings == 0 || values.iter().any(|v| !v.is_finite()) {
            return;
        }
        if let Some(last) = self.last {
            let before = signals(&last);
            // where readings were missed, it has moved for as many periods
            let readings = f64::from(seen.new_readings);
            let passed = readings * l.period;
            let velocity = (values[0] - before[0]) / passed;
            self.velocity += (velocity - self.velocity) * (readings / VELOCITY_WINDOW).min(1.0);
            let forgotten = (self.swing * (1.0 - passed / swing_memory)).max(0.0);
            self.swing = forgotten.max(self.velocity.abs());
            for k in 0..SIGNALS {
                let difference = (values[k] - before[k]) / readings;
                self.repeated[k] = match difference == 0.0 {
                    true => self.repeated[k] + passed,
                    false => 0.0,
                };
                // the second difference: a steady motion does not scatter
                let most = 10.0 * if k == 0 { l.scatter.0 } else { l.scatter.1 };
                // one jump, however large, is no noise
                let second = (difference - self.differences[k]).max(-most).min(most);
                let share = 1.0 / f64::from(SCATTER_WINDOW);
                self.scatter[k] += share * (second * second / 6.0 - self.scatter[k]);
                self.differences[k] = difference;
            }
        }
        self.last = Some(seen.reading);
        self.readings = self.readings.saturating_add(1);
    }
}

/// Plausible range of each signal, lowest and highest value, for a machine with these limits.
///
/// The position may lie 5 mm outside the stroke. A pressure lies between −1.5e5 Pa and twice the largest pressure. The
/// motor speed has no range here.
pub fn ranges(l: &Limits) -> AxisSignals<(f64, f64)> {
    let pressure = (LOWEST_PRESSURE, 2.0 * l.pressure);
    AxisSignals {
        stroke: (-STROKE_SLACK, l.stroke + STROKE_SLACK),
        pressure_pump_a: pressure,
        pressure_a: pressure,
        pressure_b: pressure,
        pressure_pump_b: pressure,
        pressure_accumulator: pressure,
        motor_speed: (f64::NEG_INFINITY, f64::INFINITY),
    }
}

/// Position, then the pressures.
fn signals<T: Copy>(r: &AxisSignals<T>) -> [T; SIGNALS] {
    [
        r.stroke,
        r.pressure_pump_a,
        r.pressure_a,
        r.pressure_b,
        r.pressure_pump_b,
        r.pressure_accumulator,
    ]
}
