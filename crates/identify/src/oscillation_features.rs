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
const LARGEST_PHASE_ERROR: f64 = 0.2;
/// Relative tolerance of a frequency, and of a damping ratio.
const TOLERANCE: (f64, f64) = (0.005, 0.2);
/// Residual of a model without oscillation, in multiples of the tolerance.
const ABSENT_RESIDUAL: f64 = 40.0;
/// Relative frequency difference up to which an oscillation belongs to the boom.
const SAME_OSCILLATION: f64 = 0.15;
/// Samples of the slow motion per period of the oscillation.
const PER_PERIOD: usize = 4;
/// Change of ln θ for the numerical derivative of an oscillation's frequency and damping.
const DIFFERENCE_STEP: f64 = 0.003;

/// Phase-independent features of a log.
#[derive(Clone, Debug)]
pub(crate) struct OscillationFeatures {
    interval: f64,
    /// Samples used: the longest sequence without missing ones.
    span: Range<usize>,
    is_free: Vec<bool>,
    signals: Vec<SignalFeatures>,
}

/// Features of one signal.
#[derive(Clone, Debug)]
struct SignalFeatures {
    /// Index among the compared signals.
    index: usize,
    /// Samples in one period of the boom's oscillation.
    period: usize,
    /// Slow motion of the log.
    slow: Vec<f64>,
    /// Standard deviation that scales the slow motion.
    deviation: f64,
    /// Oscillation of the log, if any.
    ringing: Option<Ringing>,
}

impl OscillationFeatures {
    /// Features of a log. None without an oscillation, and if log and model stay in phase unless `always`
    /// is set.
    pub(crate) fn new(
        experiment: &Experiment,
        prediction: &Prediction,
        always: bool,
    ) -> Option<Self> {
        let interval = experiment.interval();
        let span = complete_span(experiment);
        let is_free = free(experiment, interval)[span.clone()].to_vec();
        let samples = &experiment.samples[span.clone()];
        let complete: Vec<(usize, Vec<f64>)> = (0..CRANE)
            .filter_map(|index| {
                let values: Vec<f64> = samples.iter().filter_map(|s| s.values[index]).collect();
                (!values.is_empty() && values.len() == samples.len()).then_some((index, values))
            })
            .collect();
        let oscillations: Vec<Option<Ringing>> = complete
            .iter()
            .map(|(_, values)| ringing(values, interval, &is_free).filter(|r| r.damping.is_some()))
            .collect();
        // the boom's oscillation is the one of largest ratio to sensor noise; other frequencies are ignored
        let amplitude_over_noise = |k: &usize| {
            oscillations[*k].map_or(0.0, |r| {
                r.amplitude / experiment.noise[complete[*k].0].max(f64::MIN_POSITIVE)
            })
        };
        let dominant = (0..oscillations.len())
            .max_by(|a, b| amplitude_over_noise(a).total_cmp(&amplitude_over_noise(b)));
        let boom = dominant.and_then(|k| oscillations[k]);
        let is_boom = |r: &Ringing| {
            boom.is_some_and(|b| (r.frequency / b.frequency).ln().abs() < SAME_OSCILLATION)
        };
        let oscillations: Vec<Option<Ringing>> =
            oscillations.iter().map(|r| r.as_ref().filter(|r| is_boom(r)).copied()).collect();
        let is_out_of_phase = complete.iter().zip(&oscillations).any(|((index, _), log)| {
            let model = ringing(&column(prediction, *index, &span), interval, &is_free);
            log.is_some_and(|log| {
                let off = model.map_or(log.frequency, |m| (m.frequency - log.frequency).abs());
                off * experiment.duration() > LARGEST_PHASE_ERROR
            })
        });
        let frequency = boom.map(|r| r.frequency).or(always.then_some(1.0))?;
        if !(is_out_of_phase || always) {
            return None;
        }
        let period = (1.0 / frequency / interval).round().max(1.0) as usize;
        let signals: Vec<SignalFeatures> = complete
            .iter()
            .zip(oscillations)
            .map(|((index, values), ringing)| {
                let slow = moving_average(values, period);
                let model = moving_average(&column(prediction, *index, &span), period);
                let square = slow.iter().zip(&model).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
                let deviation = (square / slow.len().max(1) as f64).sqrt();
                let smallest_deviation = if *index == 0 { 2e-4 } else { 0.2e5 };
                SignalFeatures {
                    index: *index,
                    period,
                    slow,
                    deviation: deviation.max(smallest_deviation),
                    ringing,
                }
            })
            .collect();
        Some(Self { interval, signals, is_free, span })
    }

    /// Log minus model of all features, scaled by their tolerances.
    pub(crate) fn residuals(&self, prediction: &Prediction) -> Vec<f64> {
        let mut all = Vec::new();
        for signal in &self.signals {
            let model = column(prediction, signal.index, &self.span);
            let slow = moving_average(&model, signal.period);
            all.extend(signal.slow.iter().zip(&slow).map(|(a, b)| (a - b) / signal.deviation));
            if let Some(log) = signal.ringing {
                all.extend(self.ringing(log, &model));
            }
        }
        all
    }

    /// Frequency and damping of the log minus the model's.
    fn ringing(&self, log: Ringing, model: &[f64]) -> [f64; 2] {
        let Some(simulated) = ringing(model, self.interval, &self.is_free) else {
            return [ABSENT_RESIDUAL; 2];
        };
        let ratio = |log: f64, model: f64| (log.max(1e-3) / model.max(1e-3)).ln();
        let damping = match (log.damping, simulated.damping) {
            (Some(a), Some(b)) => ratio(a, b) / TOLERANCE.1,
            // the damping is too strong to be identified
            _ => 0.0,
        };
        [ratio(log.frequency, simulated.frequency) / TOLERANCE.0, damping]
    }

    /// Derivative of the residuals along a derivative of the prediction.
    pub(crate) fn derivative(&self, prediction: &Prediction, slope: &Prediction) -> Vec<f64> {
        let mut all = Vec::new();
        for signal in &self.signals {
            let along = column(slope, signal.index, &self.span);
            all.extend(moving_average(&along, signal.period).iter().map(|s| -s / signal.deviation));
            if let Some(log) = signal.ringing {
                let model = column(prediction, signal.index, &self.span);
                let moved = |by: f64| {
                    let there: Vec<f64> =
                        model.iter().zip(&along).map(|(m, s)| m + by * s).collect();
                    self.ringing(log, &there)
                };
                let (more, less) = (moved(DIFFERENCE_STEP), moved(-DIFFERENCE_STEP));
                all.extend((0..2).map(|k| (more[k] - less[k]) / (2.0 * DIFFERENCE_STEP)));
            }
        }
        all
    }
}

/// One signal of a prediction over a range of samples.
fn column(prediction: &Prediction, index: usize, span: &Range<usize>) -> Vec<f64> {
    prediction[span.clone()].iter().map(|row| row[index]).collect()
}

/// Longest sequence of samples in which every measured signal is there.
fn complete_span(experiment: &Experiment) -> Range<usize> {
    let samples = &experiment.samples;
    let is_measured: [bool; COMPARED.len()] =
        std::array::from_fn(|index| samples.iter().any(|s| s.values[index].is_some()));
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
fn moving_average(values: &[f64], period: usize) -> Vec<f64> {
    let period = period.clamp(1, values.len().max(1));
    let every = (period / PER_PERIOD).max(1);
    values.windows(period).step_by(every).map(|w| w.iter().sum::<f64>() / period as f64).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Drive;
    use crate::prediction::INITIAL_VALUES;
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
            motor_command: None,
            period: 1e-3,
            every: 5,
            merged: 1,
            steps: 2,
            samples,
            filters: [0.0; COMPARED.len()],
            initial_values: [None; INITIAL_VALUES],
            sampling_intervals: ([5e-3; COMPARED.len()], 5e-3),
            noise: [1e-3; COMPARED.len()],
            remarks: Vec::new(),
            stop: std::sync::Arc::default(),
        }
    }

    fn shown(experiment: &Experiment) -> Prediction {
        experiment.samples.iter().map(|s| s.values.map(Option::unwrap_or_default)).collect()
    }

    #[test]
    fn an_oscillation_at_another_frequency_than_the_booms_is_no_feature() {
        let experiment = log(2.2, 5.2);
        let model = shown(&log(2.0, 2.0));
        let features = OscillationFeatures::new(&experiment, &model, false).unwrap();
        let oscillations: Vec<usize> =
            features.signals.iter().filter(|s| s.ringing.is_some()).map(|s| s.index).collect();
        assert_eq!(oscillations, [2], "only p_A rings as the boom does");
        // the frequency differs by a tenth from the model and not from the log itself
        let square = |p: &Prediction| features.residuals(p).iter().map(|r| r * r).sum::<f64>();
        let off = ((2.2_f64 / 2.0).ln() / TOLERANCE.0).powi(2);
        assert!(square(&model) > 0.9 * off, "{} for {off}", square(&model));
        assert!(square(&shown(&experiment)) < 1e-6 * off);
    }
}
