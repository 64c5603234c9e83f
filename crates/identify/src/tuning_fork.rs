//! Phase-independent features of a log: slow motion, frequencies and dampings of its oscillations.
//!
//! If log and model oscillate at different frequencies, they lose phase after a few periods. A fit sample
//! by sample would then increase the model's damping instead of correcting its frequency. The fit therefore
//! starts with these features. They are each signal averaged over one period of the log's oscillation, and
//! the frequency and damping of the oscillation. The fit over all samples starts at the result, where both
//! are in phase.

use crate::differences::free;
use crate::experiment::{COMPARED, CRANE, Experiment, Sample};
use crate::prediction::Prediction;
use crate::ringing::{Ringing, ringing};
use std::ops::Range;

/// Phase difference over a log, in turns, above which log and model are out of phase.
const LOST_TURNS: f64 = 0.2;
/// Relative tolerance of a frequency, and of a damping ratio.
const EXACT: (f64, f64) = (0.005, 0.2);
/// Residual of a model without oscillation, in multiples of the tolerance.
const SILENT: f64 = 40.0;
/// Relative frequency difference up to which an oscillation belongs to the boom.
const SAME: f64 = 0.15;
/// Samples of the slow motion per period of the oscillation.
const PER_PERIOD: usize = 4;
/// Change of ln θ for the numerical derivative of an oscillation's frequency and damping.
const NUDGE: f64 = 0.003;

/// Phase-independent features of a log.
#[derive(Clone, Debug)]
pub(crate) struct TuningFork {
    interval: f64,
    /// Samples used: the longest sequence without missing ones.
    span: Range<usize>,
    is_free: Vec<bool>,
    signals: Vec<Pitched>,
}

/// Features of one signal.
#[derive(Clone, Debug)]
struct Pitched {
    /// Index among the compared signals.
    place: usize,
    /// Samples in one period of the boom's oscillation.
    period: usize,
    /// Slow motion of the log.
    slow: Vec<f64>,
    /// Standard deviation that scales the slow motion.
    deviation: f64,
    /// Oscillation of the log, if any.
    ringing: Option<Ringing>,
}

impl TuningFork {
    /// Features of a log. None without an oscillation, and if log and model stay in phase unless `always`
    /// is set.
    pub(crate) fn new(
        experiment: &Experiment,
        prediction: &Prediction,
        always: bool,
    ) -> Option<Self> {
        let interval = experiment.interval();
        let span = whole_span(experiment);
        let is_free = free(experiment, interval)[span.clone()].to_vec();
        let samples = &experiment.samples[span.clone()];
        let whole: Vec<(usize, Vec<f64>)> = (0..CRANE)
            .filter_map(|place| {
                let values: Vec<f64> = samples.iter().filter_map(|s| s.values[place]).collect();
                (!values.is_empty() && values.len() == samples.len()).then_some((place, values))
            })
            .collect();
        let heard: Vec<Option<Ringing>> = whole
            .iter()
            .map(|(_, values)| ringing(values, interval, &is_free).filter(|r| r.damping.is_some()))
            .collect();
        // the boom's oscillation is the one of largest ratio to sensor noise; other frequencies are ignored
        let loudness = |k: &usize| {
            heard[*k]
                .map_or(0.0, |r| r.amplitude / experiment.noise[whole[*k].0].max(f64::MIN_POSITIVE))
        };
        let loudest = (0..heard.len()).max_by(|a, b| loudness(a).total_cmp(&loudness(b)));
        let boom = loudest.and_then(|k| heard[k]);
        let is_boom =
            |r: &Ringing| boom.is_some_and(|b| (r.frequency / b.frequency).ln().abs() < SAME);
        let heard: Vec<Option<Ringing>> =
            heard.iter().map(|r| r.as_ref().filter(|r| is_boom(r)).copied()).collect();
        let is_lost = whole.iter().zip(&heard).any(|((place, _), log)| {
            let model = ringing(&column(prediction, *place, &span), interval, &is_free);
            log.is_some_and(|log| {
                let off = model.map_or(log.frequency, |m| (m.frequency - log.frequency).abs());
                off * experiment.duration() > LOST_TURNS
            })
        });
        let frequency = boom.map(|r| r.frequency).or(always.then_some(1.0))?;
        if !(is_lost || always) {
            return None;
        }
        let period = (1.0 / frequency / interval).round().max(1.0) as usize;
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

    /// Log minus model of all features, scaled by their tolerances.
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

    /// Frequency and damping of the log minus the model's.
    fn ringing(&self, log: Ringing, model: &[f64]) -> [f64; 2] {
        let Some(heard) = ringing(model, self.interval, &self.is_free) else {
            return [SILENT; 2];
        };
        let ratio = |log: f64, model: f64| (log.max(1e-3) / model.max(1e-3)).ln();
        let damping = match (log.damping, heard.damping) {
            (Some(a), Some(b)) => ratio(a, b) / EXACT.1,
            // the damping is too strong to be identified
            _ => 0.0,
        };
        [ratio(log.frequency, heard.frequency) / EXACT.0, damping]
    }

    /// Derivative of the residuals along a derivative of the prediction.
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

/// One signal of a prediction over a range of samples.
fn column(prediction: &Prediction, place: usize, span: &Range<usize>) -> Vec<f64> {
    prediction[span.clone()].iter().map(|row| row[place]).collect()
}

/// Longest sequence of samples in which every measured signal is there.
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

/// Moving averages over a period, a few per period.
fn course(values: &[f64], period: usize) -> Vec<f64> {
    let period = period.clamp(1, values.len().max(1));
    let every = (period / PER_PERIOD).max(1);
    values.windows(period).step_by(every).map(|w| w.iter().sum::<f64>() / period as f64).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Drive;
    use crate::prediction::STARTS;
    use hydroboom_measurement::Signal;
    use hydroboom_model::Input;

    /// Log of four seconds in which p_A oscillates by 3 bar at one frequency \[Hz\] and p_B by 0.3 bar at
    /// another.
    fn log(boom: f64, line: f64) -> Experiment {
        let swing = |size: f64, frequency: f64, time: f64| {
            let omega = std::f64::consts::TAU * frequency;
            size * (-0.02 * omega * time).exp() * (omega * time).sin()
        };
        let values = |time: f64| {
            let pressures = [70e5 + swing(3e5, boom, time), 10e5 + swing(0.3e5, line, time)];
            [Some(0.2), None, Some(pressures[0]), Some(pressures[1]), None, None, None]
        };
        let time = |k: u32| f64::from(k) * 5e-3;
        let samples = (0..800).map(|k| Sample { time: time(k), values: values(time(k)) }).collect();
        Experiment {
            name: "made".into(),
            begin: 0.0,
            drive: Drive::Pump(vec![Input { pump_speed: 0.0, holding_valve: 1.0 }; 4000]),
            driving: Signal::MotorSpeed,
            asked: None,
            period: 1e-3,
            every: 5,
            merged: 1,
            steps: 2,
            samples,
            filters: [0.0; COMPARED.len()],
            beginning: [None; STARTS],
            apart: ([5e-3; COMPARED.len()], 5e-3),
            noise: [1e-3; COMPARED.len()],
            remarks: Vec::new(),
        }
    }

    fn shown(experiment: &Experiment) -> Prediction {
        experiment.samples.iter().map(|s| s.values.map(Option::unwrap_or_default)).collect()
    }

    #[test]
    fn what_rings_beside_the_boom_is_not_tuned_to() {
        let experiment = log(2.2, 5.2);
        let model = shown(&log(2.0, 2.0));
        let fork = TuningFork::new(&experiment, &model, false).unwrap();
        let heard: Vec<usize> =
            fork.signals.iter().filter(|s| s.ringing.is_some()).map(|s| s.place).collect();
        assert_eq!(heard, [2], "only p_A rings as the boom does");
        // the frequency differs by a tenth from the model and not from the log itself
        let square = |p: &Prediction| fork.residuals(p).iter().map(|r| r * r).sum::<f64>();
        let off = ((2.2_f64 / 2.0).ln() / EXACT.0).powi(2);
        assert!(square(&model) > 0.9 * off, "{} for {off}", square(&model));
        assert!(square(&shown(&experiment)) < 1e-6 * off);
    }
}
