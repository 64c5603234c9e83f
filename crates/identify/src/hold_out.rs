//! Hold-out validation: stretches of a log that are excluded from the fit, and the prediction error there.

use crate::differences::{Difference, differences};
use crate::experiment::{COMPARED, Experiment};
use crate::prediction::Prediction;
use hydroboom_measurement::Signal;

/// Interval of a log, in log time \[s\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// Start, included \[s\].
    pub from: f64,
    /// End, excluded \[s\].
    pub to: f64,
}

/// RMS prediction errors of one signal on a held-out interval, in its SI unit: the model and simple extrapolations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PredictionError {
    /// Compared signal.
    pub signal: Signal,
    /// RMS error of the model.
    pub model: f64,
    /// RMS error of the regression line through the samples before the interval, over half of its length; none if
    /// there are fewer than three.
    pub line: Option<f64>,
    /// RMS error of the value just before the interval, from a regression line over a tenth of its length; none if
    /// there are fewer than three samples.
    pub constant: Option<f64>,
    /// RMS error of the regression line through the interval itself. It is no prediction, but shows how far the signal
    /// departs from a line.
    pub own_line: f64,
}

/// Hold-out validation of a model on an interval that was excluded from its fit.
#[derive(Clone, Debug)]
pub struct HeldOut {
    /// Name of the log.
    pub log: String,
    /// Held-out interval.
    pub stretch: Stretch,
    /// Prediction errors of the signals with at least ten samples in the interval.
    pub signals: Vec<PredictionError>,
    /// Differences over the whole log, of the model fitted without the interval; they contain frequency and damping.
    pub whole: Vec<Difference>,
}

impl Experiment {
    /// Experiment without the measurements of some intervals, for a fit that excludes them; inputs and times are kept.
    pub fn without(&self, stretches: &[Stretch]) -> Self {
        let mut rest = self.clone();
        for sample in &mut rest.samples {
            let time = self.begin + sample.time;
            if stretches.iter().any(|s| (s.from..s.to).contains(&time)) {
                sample.values = [None; COMPARED.len()];
            }
        }
        rest
    }
}

/// RMS prediction errors on an interval of an experiment that still contains its measurements. `prediction` has one
/// row for each sample, from the model fitted without the interval. None if no signal has ten samples there.
pub fn held_out(
    experiment: &Experiment,
    prediction: &Prediction,
    stretch: Stretch,
) -> Option<HeldOut> {
    let mut signals = Vec::new();
    for (place, signal) in COMPARED.into_iter().enumerate() {
        let seen: Vec<(f64, f64, f64)> = experiment
            .samples
            .iter()
            .zip(prediction)
            .filter_map(|(s, p)| Some((experiment.begin + s.time, s.values[place]?, p[place])))
            .collect();
        let inside: Vec<(f64, f64, f64)> =
            seen.iter().filter(|s| (stretch.from..stretch.to).contains(&s.0)).copied().collect();
        if inside.len() < 10 {
            continue;
        }
        let rms = |of: &dyn Fn(&(f64, f64, f64)) -> f64| {
            let sum: f64 = inside.iter().map(|s| (s.1 - of(s)).powi(2)).sum();
            (sum / inside.len() as f64).sqrt()
        };
        let length = stretch.to - stretch.from;
        let before = |share: f64| {
            let from = stretch.from - share * length;
            let part = seen.iter().filter(move |s| (from..stretch.from).contains(&s.0));
            line(part.map(|s| (s.0, s.1)))
        };
        // half as long, so that earlier oscillations or the initial transient have little effect on the
        // line
        let earlier = before(0.5);
        let last = before(0.1).map(|l| l.at(stretch.from - 0.05 * length));
        let own = line(inside.iter().map(|s| (s.0, s.1)))?;
        signals.push(PredictionError {
            signal,
            model: rms(&|s| s.2),
            line: earlier.map(|l| rms(&|s| l.at(s.0))),
            constant: last.map(|v| rms(&|_| v)),
            own_line: rms(&|s| own.at(s.0)),
        });
    }
    (!signals.is_empty()).then(|| HeldOut {
        log: experiment.name.clone(),
        stretch,
        signals,
        whole: differences(experiment, prediction),
    })
}

/// Straight line.
#[derive(Clone, Copy)]
struct Line {
    time: f64,
    value: f64,
    slope: f64,
}

impl Line {
    fn at(&self, time: f64) -> f64 {
        self.value + self.slope * (time - self.time)
    }
}

/// Regression line; none for fewer than three points.
fn line(points: impl Iterator<Item = (f64, f64)>) -> Option<Line> {
    let points: Vec<(f64, f64)> = points.collect();
    if points.len() < 3 {
        return None;
    }
    let count = points.len() as f64;
    let time = points.iter().map(|p| p.0).sum::<f64>() / count;
    let value = points.iter().map(|p| p.1).sum::<f64>() / count;
    let square: f64 = points.iter().map(|p| (p.0 - time).powi(2)).sum();
    let along: f64 = points.iter().map(|p| (p.0 - time) * (p.1 - value)).sum();
    Some(Line { time, value, slope: along / square })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_line_is_fitted_exactly() {
        let points = (0..50).map(|k| (0.1 * f64::from(k), 3.0 - 0.7 * 0.1 * f64::from(k)));
        let found = line(points).unwrap();
        assert!((found.slope + 0.7).abs() < 1e-12 && (found.at(10.0) + 4.0).abs() < 1e-12);
        assert!(line([(0.0, 1.0), (1.0, 2.0)].into_iter()).is_none());
    }
}
