//! What of a log does not depend on the phase of its oscillations: slow courses, frequencies and dampings.
//!
//! Where log and model ring at different frequencies they are out of phase after a few periods, and a search that
//! compares them sample by sample would rather damp the model away than make it ring as the log does. So the pitch
//! comes first: each signal averaged over one period of its log's oscillation, and of the oscillation its frequency and
//! damping. What that comes to is in phase, and the search over all samples begins there.

use crate::differences::free;
use crate::experiment::{COMPARED, Experiment, Sample};
use crate::prediction::Prediction;
use crate::ringing::{Ringing, ringing};
use std::ops::Range;

/// Log and model that lose more than this share of a turn over a log are out of phase.
const LOST_TURNS: f64 = 0.2;
/// A frequency is to agree within this share, and a damping ratio.
const EXACT: (f64, f64) = (0.005, 0.2);
/// What a model that does not ring counts as: this far off, in the same units.
const SILENT: f64 = 40.0;
/// Every so many samples a slow course is looked at in one of its oscillation's periods.
const PER_PERIOD: usize = 4;
/// Share of ln θ by which a prediction is moved along its slope, to see how its oscillation changes.
const NUDGE: f64 = 0.003;

/// The pitch of a log.
#[derive(Clone, Debug)]
pub(crate) struct TuningFork {
    interval: f64,
    /// The samples it is of: the longest run in which nothing is missing.
    span: Range<usize>,
    is_free: Vec<bool>,
    signals: Vec<Pitched>,
}

/// A signal of it.
#[derive(Clone, Debug)]
struct Pitched {
    /// Its place among the compared ones.
    place: usize,
    /// Samples of one period of the log's largest oscillation.
    period: usize,
    /// The log's slow course.
    slow: Vec<f64>,
    /// What the slow course is held against.
    deviation: f64,
    /// How the log rings, if it does.
    ringing: Option<Ringing>,
}

impl TuningFork {
    /// The pitch of a log; none where it does not ring, and where log and model stay in phase unless it is wanted
    /// `always`.
    pub(crate) fn new(
        experiment: &Experiment,
        prediction: &Prediction,
        always: bool,
    ) -> Option<Self> {
        let interval = experiment.interval();
        let span = whole_span(experiment);
        let is_free = free(experiment, interval)[span.clone()].to_vec();
        let samples = &experiment.samples[span.clone()];
        let whole: Vec<(usize, Vec<f64>)> = (0..COMPARED.len())
            .filter_map(|place| {
                let values: Vec<f64> = samples.iter().filter_map(|s| s.values[place]).collect();
                (!values.is_empty() && values.len() == samples.len()).then_some((place, values))
            })
            .collect();
        let heard: Vec<Option<Ringing>> = whole
            .iter()
            .map(|(_, values)| ringing(values, interval, &is_free).filter(|r| r.damping.is_some()))
            .collect();
        let is_lost = whole.iter().zip(&heard).any(|((place, _), log)| {
            let model = ringing(&column(prediction, *place, &span), interval, &is_free);
            log.is_some_and(|log| {
                let off = model.map_or(log.frequency, |m| (m.frequency - log.frequency).abs());
                off * experiment.duration() > LOST_TURNS
            })
        });
        // the slowest oscillation is the boom's, and its period holds whole ones of the faster
        let slowest = heard.iter().flatten().map(|r| r.frequency).reduce(f64::min);
        let slowest = slowest.or(always.then_some(1.0))?;
        if !(is_lost || always) {
            return None;
        }
        let period = (1.0 / slowest / interval).round().max(1.0) as usize;
        let signals: Vec<Pitched> = whole
            .iter()
            .zip(heard)
            .map(|((place, values), ringing)| {
                let slow = course(values, period);
                let model = course(&column(prediction, *place, &span), period);
                let square = slow.iter().zip(&model).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
                let deviation = (square / slow.len().max(1) as f64).sqrt();
                let finest = if *place == 0 { 2e-4 } else { 0.2e5 };
                Pitched { place: *place, period, slow, deviation: deviation.max(finest), ringing }
            })
            .collect();
        Some(Self { interval, signals, is_free, span })
    }

    /// Log less model of all that counts, each against what it is to agree within.
    pub(crate) fn residuals(&self, prediction: &Prediction) -> Vec<f64> {
        let mut all = Vec::new();
        for signal in &self.signals {
            let model = column(prediction, signal.place, &self.span);
            let slow = course(&model, signal.period);
            all.extend(signal.slow.iter().zip(&slow).map(|(a, b)| (a - b) / signal.deviation));
            if let Some(log) = signal.ringing {
                all.extend(self.ringing(log, &model));
            }
        }
        all
    }

    /// Frequency and damping of the log less the model's.
    fn ringing(&self, log: Ringing, model: &[f64]) -> [f64; 2] {
        let Some(heard) = ringing(model, self.interval, &self.is_free) else {
            return [SILENT; 2];
        };
        let ratio = |log: f64, model: f64| (log.max(1e-3) / model.max(1e-3)).ln();
        let damping = match (log.damping, heard.damping) {
            (Some(a), Some(b)) => ratio(a, b) / EXACT.1,
            // too strongly damped to be told
            _ => 0.0,
        };
        [ratio(log.frequency, heard.frequency) / EXACT.0, damping]
    }

    /// How the residuals change along a slope of the prediction.
    pub(crate) fn slopes(&self, prediction: &Prediction, slope: &Prediction) -> Vec<f64> {
        let mut all = Vec::new();
        for signal in &self.signals {
            let along = column(slope, signal.place, &self.span);
            all.extend(course(&along, signal.period).iter().map(|s| -s / signal.deviation));
            if let Some(log) = signal.ringing {
                let model = column(prediction, signal.place, &self.span);
                let moved = |by: f64| {
                    let there: Vec<f64> =
                        model.iter().zip(&along).map(|(m, s)| m + by * s).collect();
                    self.ringing(log, &there)
                };
                let (more, less) = (moved(NUDGE), moved(-NUDGE));
                all.extend((0..2).map(|k| (more[k] - less[k]) / (2.0 * NUDGE)));
            }
        }
        all
    }
}

/// One signal of a prediction, over a span.
fn column(prediction: &Prediction, place: usize, span: &Range<usize>) -> Vec<f64> {
    prediction[span.clone()].iter().map(|row| row[place]).collect()
}

/// The longest run of samples in which no signal is missing that is measured at all.
fn whole_span(experiment: &Experiment) -> Range<usize> {
    let samples = &experiment.samples;
    let is_measured: [bool; COMPARED.len()] =
        std::array::from_fn(|place| samples.iter().any(|s| s.values[place].is_some()));
    let is_whole = |s: &Sample| {
        is_measured
            .iter()
            .zip(&s.values)
            .all(|(is_measured, value)| !is_measured || value.is_some())
    };
    let (mut best, mut from) = (0..0, 0);
    for k in 0..=samples.len() {
        if k == samples.len() || !is_whole(&samples[k]) {
            if k - from > best.len() {
                best = from..k;
            }
            from = k + 1;
        }
    }
    best
}

/// Averages over a period, a few in each.
fn course(values: &[f64], period: usize) -> Vec<f64> {
    let period = period.clamp(1, values.len().max(1));
    let every = (period / PER_PERIOD).max(1);
    values.windows(period).step_by(every).map(|w| w.iter().sum::<f64>() / period as f64).collect()
}
