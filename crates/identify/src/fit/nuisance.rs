//! Delay and offset of each compared channel: nuisance parameters of the fit.
//!
//! A position delayed by 4 ms, or a transmitter of absolute pressure, is no property of the crane. If it is
//! omitted from the fit, the crane's keys are biased. As a parameter of the same fit it is estimated
//! together with them, and its correlation with the keys widens their intervals. Sources: Ljung, *System
//! Identification*, 2nd ed. 1999, section 14.1; Seber and Wild, *Nonlinear Regression*, 1989, section 5.9.

use super::Channel;
use crate::error::IdentifyError;
use crate::experiment::{COMPARED, CRANE};
use crate::prediction::Prediction;
use hydroboom_measurement::{Dimension, Signal};
use serde::Serialize;

/// Kind of a nuisance parameter: a delay or an offset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Effect {
    /// Delay of the channel relative to the inputs: sensor, filter, fieldbus, minus the driving signal's own
    /// delay.
    Delay,
    /// Offset of the reading, measured minus true value.
    Offset,
}

/// Nuisance parameter: the delay or the offset of one compared channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Nuisance {
    /// Delay or offset.
    pub effect: Effect,
    /// Signal of the channel.
    pub signal: Signal,
}

/// Range and prior of a nuisance parameter, in its display unit: ms, mm or bar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Allowed {
    /// Last part of its key, as `delay_ms` in `stroke.delay_ms`.
    pub name: &'static str,
    /// Display unit: ms, mm or bar.
    pub unit: &'static str,
    /// One display unit in SI units: 1e-3 for ms and mm, 1e5 for bar.
    pub size: f64,
    /// Smallest and largest estimate allowed, in the display unit; a fixed nuisance parameter is zero.
    pub range: [f64; 2],
    /// Prior standard deviation in the display unit, about a prior mean of zero.
    pub deviation: f64,
    /// Source of range and prior, as text.
    pub source: &'static str,
}

/// Range and prior of a delay.
const DELAY: Allowed = Allowed {
    name: "delay_ms",
    unit: "ms",
    size: 1e-3,
    range: [-50.0, 100.0],
    deviation: 20.0,
    source: "cycles of fieldbus and PLC (1 to 20 ms), filters of transmitters (1 to 50 ms); early where the driving signal is late itself",
};
/// Range and prior of a position's offset.
const LENGTH: Allowed = Allowed {
    name: "offset_mm",
    unit: "mm",
    size: 1e-3,
    range: [-10.0, 10.0],
    deviation: 2.0,
    source: "where a position sensor is mounted",
};
/// Range and prior of a pressure's offset.
const PRESSURE: Allowed = Allowed {
    name: "offset_bar",
    unit: "bar",
    size: 1e5,
    range: [-5.0, 5.0],
    deviation: 1.0,
    source: "0.5 % of 250 bar, and one atmosphere of a transmitter of absolute pressure",
};

impl Nuisance {
    /// Number of nuisance parameters of a log: delays, then offsets, each in the order of [`COMPARED`]. The
    /// motor speed has none, because its delay is the drive's dead time.
    pub const COUNT: usize = 2 * CRANE;

    /// The nuisance parameter of an index below [`COUNT`](Self::COUNT).
    pub(super) fn at_index(index: usize) -> Self {
        let effect = if index < CRANE { Effect::Delay } else { Effect::Offset };
        Self { effect, signal: COMPARED[index % CRANE] }
    }

    /// Range and prior standard deviation, with their source.
    pub fn allowed(self) -> &'static Allowed {
        match (self.effect, self.signal.dimension()) {
            (Effect::Delay, _) => &DELAY,
            (Effect::Offset, Dimension::Length) => &LENGTH,
            (Effect::Offset, _) => &PRESSURE,
        }
    }

    /// Key, as `stroke.delay_ms`: signal, effect and unit.
    pub fn path(self) -> String {
        format!("{}.{}", self.signal.key(), self.allowed().name)
    }

    /// Nuisance parameters of a name: one by its key, with or without its unit, or all of `delay`, `offset`
    /// or `all`.
    ///
    /// # Errors
    ///
    /// [`IdentifyError::Nuisance`] if there is none of this name.
    pub fn named(name: &str) -> Result<Vec<Self>, IdentifyError> {
        let matches_name = |n: &Self| {
            let (path, effect) = (n.path(), n.allowed().name.split('_').next().unwrap_or(""));
            name == path
                || name == effect
                || name == "all"
                || path.rsplit_once('_').is_some_and(|(without, _)| name == without)
        };
        let found: Vec<Self> = (0..Self::COUNT).map(Self::at_index).filter(matches_name).collect();
        match found.is_empty() {
            true => Err(IdentifyError::Nuisance { name: name.into() }),
            false => Ok(found),
        }
    }
}

/// Delays and offsets of channels, each the mean over its logs weighted by inverse variances. Zero if no log
/// determines it.
pub(super) fn weighted_means(channels: &[Channel]) -> Vec<(Nuisance, f64)> {
    let mut found: Vec<(Nuisance, f64)> = Vec::new();
    for channel in channels {
        if found.iter().any(|(nuisance, _)| *nuisance == channel.nuisance) {
            continue;
        }
        let of = channels.iter().filter(|other| other.nuisance == channel.nuisance);
        let (sum, weight) = of.fold((0.0, 0.0), |(sum, weight), c| {
            let inverse_variance = c.deviation.powi(-2);
            (sum + inverse_variance * c.value, weight + inverse_variance)
        });
        let is_known = weight > 0.0 && weight.is_finite();
        found.push((channel.nuisance, if is_known { sum / weight } else { 0.0 }));
    }
    found
}

/// Signal sampled every `interval` \[s\], delayed by `delay` \[s\], and its derivative with respect to the
/// delay.
///
/// Between samples it is a cubic with central differences as tangents (Catmull and Rom, A class of local
/// interpolating splines, in: Computer Aided Geometric Design, 1974, 317-326). The derivative with respect to
/// the delay is exactly minus its time derivative. Before the first sample the signal is constant, and after
/// the last one it is extrapolated linearly.
pub(super) fn delayed(course: &[f64], delay: f64, interval: f64) -> (Vec<f64>, Vec<f64>) {
    let last = course.len().saturating_sub(1);
    let tangent = |k: usize| {
        let (a, b) = (k.saturating_sub(1), (k + 1).min(last));
        (course[b] - course[a]) / (b - a).max(1) as f64
    };
    let shifted = (0..course.len()).map(|k| {
        let position = k as f64 - delay / interval;
        if position <= 0.0 {
            // at the first sample the derivative is the one to the right
            return (course[0], if position == 0.0 { tangent(0) } else { 0.0 });
        }
        let before = (position as usize).min(last);
        if before == last {
            return (course[last] + (position - last as f64) * tangent(last), tangent(last));
        }
        let s = position - before as f64;
        let (a, b) = (course[before], course[before + 1]);
        let (from, to) = (tangent(before), tangent(before + 1));
        // Hermite cubic and its derivative
        let rise = b - a;
        let value =
            a + s * (from + s * ((3.0 * rise - 2.0 * from - to) + s * (from + to - 2.0 * rise)));
        let slope =
            from + s * (2.0 * (3.0 * rise - 2.0 * from - to) + 3.0 * s * (from + to - 2.0 * rise));
        (value, slope)
    });
    shifted.map(|(value, slope)| (value, -slope / interval)).unzip()
}

/// Delays each signal of a prediction \[s\]; a zero delay changes nothing.
pub(super) fn all_delayed(
    prediction: &mut Prediction,
    delays: &[f64; COMPARED.len()],
    interval: f64,
) {
    for (index, delay) in delays.iter().enumerate().filter(|(_, delay)| **delay != 0.0) {
        let course: Vec<f64> = prediction.iter().map(|row| row[index]).collect();
        for (row, value) in prediction.iter_mut().zip(delayed(&course, *delay, interval).0) {
            row[index] = value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INTERVAL: f64 = 5e-3;

    fn ringing(time: f64) -> f64 {
        if time <= 0.0 { 3.0 } else { 3.0 + 0.4 * (1.0 - (15.0 * time).cos()) }
    }

    #[test]
    fn a_delayed_signal_has_its_earlier_values() {
        let course: Vec<f64> = (0..400).map(|k| ringing(f64::from(k) * INTERVAL)).collect();
        for delay in [-0.0123, -1e-9, 0.0, 0.0021, 0.0177] {
            let (shown, _) = delayed(&course, delay, INTERVAL);
            for (k, v) in shown.iter().enumerate().take(390) {
                let exact = ringing(k as f64 * INTERVAL - delay);
                assert!((v - exact).abs() < 3e-4, "{v} for {exact} at {k}, {delay} late");
            }
        }
    }

    #[test]
    fn the_derivative_with_respect_to_a_delay_equals_its_finite_difference() {
        let course: Vec<f64> = (0..200).map(|k| ringing(f64::from(k) * INTERVAL)).collect();
        let little = 1e-7;
        for delay in [-0.0123, 0.0021, 0.0177] {
            let (_, slope) = delayed(&course, delay, INTERVAL);
            let [less, more] =
                [delay - little, delay + little].map(|d| delayed(&course, d, INTERVAL).0);
            for k in 0..course.len() {
                let by_difference = (more[k] - less[k]) / (2.0 * little);
                assert!((slope[k] - by_difference).abs() < 1e-5, "{} {by_difference}", slope[k]);
            }
        }
    }

    /// An insignificant estimate is kept, and of two logs the one of smaller variance has the larger weight.
    #[test]
    fn sensors_are_means_over_logs_weighted_by_inverse_variance() {
        let channel = |name: &str, value: f64, deviation: f64| Channel {
            log: "log".into(),
            nuisance: Nuisance::named(name).unwrap()[0],
            value,
            deviation,
            partner: None,
        };
        let (pressure, stroke) = ("pressure_a.offset", "stroke.delay");
        let found = weighted_means(&[
            channel(pressure, -1.0, 1.0),
            channel(stroke, 3.0, f64::INFINITY),
            channel(pressure, 1.0, 0.5),
        ]);
        let of = |name| Nuisance::named(name).unwrap()[0];
        assert_eq!(found, [(of(pressure), 0.6), (of(stroke), 0.0)]);
    }

    #[test]
    fn nuisance_parameters_are_named_alone_and_together() {
        let paths = |name: &str| -> Vec<String> {
            Nuisance::named(name).unwrap().into_iter().map(Nuisance::path).collect()
        };
        assert_eq!(paths("stroke.delay_ms"), ["stroke.delay_ms"]);
        assert_eq!(paths("pressure_a.offset"), ["pressure_a.offset_bar"]);
        assert_eq!(paths("delay").len(), CRANE);
        assert_eq!(paths("all").len(), Nuisance::COUNT);
        let message = Nuisance::named("stroke.late").unwrap_err().to_string();
        assert!(
            message.contains("stroke.late") && message.contains("stroke.delay_ms"),
            "{message}"
        );
    }
}
