//! Removal of samples outside the range of any sensor of the machine.

use crate::channel::Measurement;
use crate::dimension::Dimension;
use crate::mapping::Mapping;
use crate::signal::Signal;
use std::ops::Range;

/// Range of gauge pressures \[Pa\]: from below vacuum to ten times the highest pressure of a crane's pumps.
const PRESSURES: Range<f64> = -1.2e5..4000e5;
/// Range of positions in strokes of the cylinder; it includes the cylinder's own length.
const STROKES: Range<f64> = -5.0..10.0;
/// Largest speed in multiples of the motor's largest speed.
const SPEEDS: f64 = 5.0;
/// Largest share of outliers in a signal; more indicate another unit or signal.
const MOST: f64 = 0.01;

impl Mapping {
    /// Replaces samples outside the range of any sensor by NaN: lost telegrams, such as -9999 or 65535. The ranges are
    /// those of a cylinder with a stroke \[m\] and a motor with a largest speed \[rev/s\]. A signal with more than 1 %
    /// of such samples is left as it is, because another unit or signal is likelier.
    ///
    /// Returns a remark for each changed signal, with number and place of its outliers.
    pub fn without_outliers(
        &self,
        log: &mut Measurement,
        stroke: f64,
        motor_speed: f64,
    ) -> Vec<String> {
        let mut said = Vec::new();
        for (signal, entry) in &self.entries {
            let (Some(unit), Some(channel)) = (entry.unit, log.channel_mut(&entry.column)) else {
                continue;
            };
            let is_outlier = |number: &f64| {
                let value = entry.si(&unit, *number);
                number.is_finite() && !plausible(*signal, stroke, motor_speed).contains(&value)
            };
            let count = channel.values.iter().filter(|v| is_outlier(v)).count();
            let Some(first) = channel.values.iter().position(is_outlier) else { continue };
            if count as f64 > MOST * channel.values.len() as f64 {
                continue;
            }
            said.push(format!(
                "{count} samples of \"{}\" cannot be {}, the first {:?} at {:.3} s: they count as missing",
                channel.heading,
                signal.symbol(),
                channel.values[first],
                channel.time[first]
            ));
            channel.values.iter_mut().filter(|v| is_outlier(v)).for_each(|v| *v = f64::NAN);
        }
        said
    }
}

/// Range of a sensor of this signal, in SI units.
fn plausible(signal: Signal, stroke: f64, motor_speed: f64) -> Range<f64> {
    match signal.dimension() {
        Dimension::Pressure => PRESSURES,
        Dimension::Length => STROKES.start * stroke..STROKES.end * stroke,
        Dimension::Rotation => -SPEEDS * motor_speed..SPEEDS * motor_speed,
        _ => f64::NEG_INFINITY..f64::INFINITY,
    }
}
