//! Delay and offset of each compared channel: nuisance parameters of the fit.
//!
//! A position that comes 4 ms late, or a transmitter that reads absolute pressure, is no property of the crane. Left out of the
//! problem it moves the crane's keys; as a parameter of the same problem it takes its share, and its correlation with the keys
//! widens their intervals (Ljung, *System Identification*, 2nd ed. 1999, section 14.1; Seber and Wild, *Nonlinear Regression*, 1989, section 5.9).

use super::Channel;
use crate::error::IdentifyError;
use crate::experiment::{COMPARED, CRANE};
use crate::prediction::Prediction;
use hydroboom_measurement::{Dimension, Signal};
use serde::Serialize;

/// What a channel may be off by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Effect {
    /// How much later the channel is than the inputs say: sensor, filter, fieldbus, and the driving signal's own lag.
    Delay,
    /// What the channel reads too much.
    Offset,
}

/// A nuisance parameter: delay or offset of a compared channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Nuisance {
    /// What it is.
    pub effect: Effect,
    /// The channel.
    pub signal: Signal,
}

/// What is allowed and known of a nuisance parameter, in its unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Allowed {
    /// Name of its key, after the channel's: `stroke.delay_ms`.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// The unit in SI units.
    pub size: f64,
    /// What it may be; zero where it is fixed.
    pub range: [f64; 2],
    /// Known beforehand: this deviation from zero.
    pub deviation: f64,
    /// Why so much.
    pub source: &'static str,
}

const DELAY: Allowed = Allowed {
    name: "delay_ms",
    unit: "ms",
    size: 1e-3,
    range: [-50.0, 100.0],
    deviation: 20.0,
    source: "cycles of fieldbus and PLC (1 to 20 ms), filters of transmitters (1 to 50 ms); early where the driving signal is late itself",
};
const LENGTH: Allowed = Allowed {
    name: "offset_mm",
    unit: "mm",
    size: 1e-3,
    range: [-10.0, 10.0],
    deviation: 2.0,
    source: "where a position sensor is mounted",
};
const PRESSURE: Allowed = Allowed {
    name: "offset_bar",
    unit: "bar",
    size: 1e5,
    range: [-5.0, 5.0],
    deviation: 1.0,
    source: "0.5 % of 250 bar, and one atmosphere of a transmitter of absolute pressure",
};

impl Nuisance {
    /// All there are, delays first, in the order of [`COMPARED`]. The motor's speed has none: its delay is the drive's dead time.
    pub const COUNT: usize = 2 * CRANE;

    /// The one at a place among all.
    pub(super) fn at(place: usize) -> Self {
        let effect = if place < CRANE { Effect::Delay } else { Effect::Offset };
        Self { effect, signal: COMPARED[place % CRANE] }
    }

    /// What is allowed and known of it.
    pub fn allowed(self) -> &'static Allowed {
        match (self.effect, self.signal.dimension()) {
            (Effect::Delay, _) => &DELAY,
            (Effect::Offset, Dimension::Length) => &LENGTH,
            (Effect::Offset, _) => &PRESSURE,
        }
    }

    /// Its key: `stroke.delay_ms`.
    pub fn path(self) -> String {
        format!("{}.{}", self.signal.key(), self.allowed().name)
    }

    /// Those that a name means: one by its key, with or without its unit, or `delay`, `offset` or `all`.
    ///
    /// # Errors
    ///
    /// [`IdentifyError::Nuisance`] when it means none.
    pub fn named(name: &str) -> Result<Vec<Self>, IdentifyError> {
        let is_meant = |n: &Self| {
            let (path, effect) = (n.path(), n.allowed().name.split('_').next().unwrap_or(""));
            name == path
                || name == effect
                || name == "all"
                || path.rsplit_once('_').is_some_and(|(without, _)| name == without)
        };
        let found: Vec<Self> = (0..Self::COUNT).map(Self::at).filter(is_meant).collect();
        match found.is_empty() {
            true => Err(IdentifyError::Nuisance { name: name.into() }),
            false => Ok(found),
        }
    }
}

/// Delays and offsets of channels, each the mean over its logs, weighed by inverse variances; zero where nothing is known of it.
pub(super) fn means(channels: &[Channel]) -> Vec<(Nuisance, f64)> {
    let mut found: Vec<(Nuisance, f64)> = Vec::new();
    for channel in channels {
        if found.iter().any(|(nuisance, _)| *nuisance == channel.nuisance) {
            continue;
        }
        let of = channels.iter().filter(|other| other.nuisance == channel.nuisance);
        let (sum, weight) = of.fold((0.0, 0.0), |(sum, weight), c| {
            let share = c.deviation.powi(-2);
            (sum + share * c.value, weight + share)
        });
        let is_known = weight > 0.0 && weight.is_finite();
        found.push((channel.nuisance, if is_known { sum / weight } else { 0.0 }));
    }
    found
}

/// What a signal shows that comes late \[s\], from its samples an interval apart \[s\]; with its slope along the delay.
///
/// Between samples a cubic goes through both with slopes by central differences (Catmull and Rom, 1974), which is smooth, so the slope along
/// the delay is exactly minus the course's slope. Before it began it was at rest; after its end it goes on straight.
pub(super) fn delayed(course: &[f64], delay: f64, interval: f64) -> (Vec<f64>, Vec<f64>) {
    let last = course.len().saturating_sub(1);
    let tangent = |k: usize| {
        let (a, b) = (k.saturating_sub(1), (k + 1).min(last));
        (course[b] - course[a]) / (b - a).max(1) as f64
    };
    let shifted = (0..course.len()).map(|k| {
        let at = k as f64 - delay / interval;
        if at <= 0.0 {
            // at zero its slope is that of leaving rest
            return (course[0], if at == 0.0 { tangent(0) } else { 0.0 });
        }
        let before = (at as usize).min(last);
        if before == last {
            return (course[last] + (at - last as f64) * tangent(last), tangent(last));
        }
        let s = at - before as f64;
        let (a, b) = (course[before], course[before + 1]);
        let (from, to) = (tangent(before), tangent(before + 1));
        // Hermite's cubic, and its slope
        let rise = b - a;
        let value =
            a + s * (from + s * ((3.0 * rise - 2.0 * from - to) + s * (from + to - 2.0 * rise)));
        let slope =
            from + s * (2.0 * (3.0 * rise - 2.0 * from - to) + 3.0 * s * (from + to - 2.0 * rise));
        (value, slope)
    });
    shifted.map(|(value, slope)| (value, -slope / interval)).unzip()
}

/// A prediction with each signal late \[s\]; zero delays leave it as it is.
pub(super) fn all_delayed(
    prediction: &mut Prediction,
    delays: &[f64; COMPARED.len()],
    interval: f64,
) {
    for (place, delay) in delays.iter().enumerate().filter(|(_, delay)| **delay != 0.0) {
        let course: Vec<f64> = prediction.iter().map(|row| row[place]).collect();
        for (row, value) in prediction.iter_mut().zip(delayed(&course, *delay, interval).0) {
            row[place] = value;
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
    fn a_delayed_signal_is_that_of_earlier() {
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
    fn the_slope_along_a_delay_is_what_a_little_more_delay_does() {
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

    /// What is not significantly other than zero goes along as it was found, and of two logs the one that tells more counts more.
    #[test]
    fn sensors_are_means_over_logs_by_how_well_each_tells_them() {
        let channel = |name: &str, value: f64, deviation: f64| Channel {
            log: "log".into(),
            nuisance: Nuisance::named(name).unwrap()[0],
            value,
            deviation,
            partner: None,
        };
        let (pressure, stroke) = ("pressure_a.offset", "stroke.delay");
        let found = means(&[
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
        let said = Nuisance::named("stroke.late").unwrap_err().to_string();
        assert!(said.contains("stroke.late") && said.contains("stroke.delay_ms"), "{said}");
    }
}
