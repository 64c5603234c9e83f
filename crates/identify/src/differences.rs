//! Statistics of the differences between model and log.

use crate::experiment::{COMPARED, CRANE, Experiment};
use crate::explained::{Explained, explained};
use crate::limits::LIMITS;
use crate::prediction::Prediction;
use crate::ringing::{Ringing, ringing};
use crate::whiteness::{Whiteness, whiteness};
use hydroboom_measurement::Signal;

/// Statistics of the difference log − model of one signal, over the samples in which the log has a value. Without a
/// unit of its own, a field is in the signal's SI unit: m, Pa or rev/s.
#[derive(Clone, Debug)]
pub struct Difference {
    /// Compared signal.
    pub signal: Signal,
    /// Number of compared samples \[-\].
    pub count: usize,
    /// Root mean square of the difference \[SI unit of the signal\].
    pub rms: f64,
    /// Difference of largest magnitude, with its sign \[SI unit of the signal\].
    pub peak: f64,
    /// Mean difference \[SI unit of the signal\]; positive if the log is above the model.
    pub bias: f64,
    /// Pearson correlation coefficient of log and model \[-\], −1 to 1; none if one of them is constant.
    pub correlation: Option<f64>,
    /// Fit 100 (1 − ‖log − model‖ / ‖log − mean of log‖) \[%\]; none if the log is constant.
    pub fit: Option<f64>,
    /// Delay of the log relative to the model \[s\], within ±0.1 s, from the best agreement of their slopes; positive
    /// if the log is late, none without motion.
    pub delay: Option<f64>,
    /// RMS difference after removal of the delay \[SI unit of the signal\]: much smaller than `rms` if a delay is the
    /// cause.
    pub rms_without_delay: Option<f64>,
    /// Delay over the first and the second half \[s\], which shows a clock drift.
    pub delay_halves: Option<[f64; 2]>,
    /// Relative rate error of the log's clock that explains the growth of the delay \[s/s\].
    pub drift: Option<f64>,
    /// RMS difference after removal of delay and clock drift \[SI unit of the signal\]: much smaller if a clock drift
    /// is the cause.
    pub rms_without_drift: Option<f64>,
    /// Frequency and damping of the log's decaying oscillation; none without a prominent spectral peak.
    pub ringing: Option<Ringing>,
    /// Frequency and damping of the model's decaying oscillation; none without a prominent spectral peak.
    pub model_ringing: Option<Ringing>,
    /// Share of the difference's autocorrelations, up to a lag of one second, that exceed the 95 % bound of white
    /// noise \[-\]: 0.05 for white residuals.
    pub coloured: f64,
    /// Whether the difference is white by the portmanteau test of Ljung and Box at 5 %, over the same lags.
    pub is_white: bool,
    /// Decomposition of the difference into offset, drift, scale and delay; none if there are too few samples.
    pub parts: Option<Explained>,
    /// Range of the log, maximum minus minimum \[SI unit of the signal\].
    pub span: f64,
    /// Largest magnitude in the log \[SI unit of the signal\].
    pub largest: f64,
    /// Standard deviation of the sensor noise, estimated from the log's samples \[SI unit of the signal\].
    pub noise: f64,
    /// The sampling interval, if it is too long to judge the model's oscillation; none if it is short enough.
    pub unresolved: Option<Unresolved>,
}

/// Sampling interval that is too long for the model's oscillation: fewer than four samples per period. It is the
/// interval of the signal, or of the model's input, which is unknown between samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unresolved {
    /// Sampling interval \[s\].
    pub interval: f64,
    /// Frequency of the model's oscillation \[Hz\].
    pub frequency: f64,
}

impl Difference {
    /// Whether a clock drift, that is a linearly growing delay, explains most of the difference: the RMS without it is
    /// below the share [`Limits::most`](crate::Limits::most) of the RMS with and without a constant delay.
    pub fn is_of_clock(&self) -> bool {
        let drifts = self.rms_without_drift.zip(self.rms_without_delay);
        drifts.is_some_and(|(drift, delay)| drift < LIMITS.most * self.rms.min(delay))
    }

    /// Whether a constant delay explains most of the difference: the RMS without it is below the share
    /// [`Limits::most`](crate::Limits::most). The delay also exceeds
    /// [`Limits::shortest_delay`](crate::Limits::shortest_delay), which steps and sampling explain.
    ///
    /// A position that is delayed equally in both directions indicates a delayed sensor; a lag belongs to the crane.
    pub fn is_late(&self) -> bool {
        let moved = self.delay.zip(self.rms_without_delay);
        !self.is_of_clock()
            && moved.is_some_and(|(delay, without)| {
                delay.abs() > LIMITS.shortest_delay && without < LIMITS.most * self.rms
            })
    }
}

/// Differences of all measured signals of one log, one entry a signal.
pub type Differences = Vec<Difference>;

/// Largest delay of the search \[s\].
const LONGEST_DELAY: f64 = 0.1;
/// Samples per period that an oscillation needs.
const PER_PERIOD: f64 = 4.0;

/// Statistics of the differences log − model, one entry for each signal of the crane with more than 20 measured
/// samples. The motor speed is excluded. `prediction` must have one row for each sample of the experiment, as from
/// [`predict`](crate::predict).
pub fn differences(experiment: &Experiment, prediction: &Prediction) -> Differences {
    let interval = experiment.interval();
    let is_free = free(experiment, interval);
    let (sampling, driven) = experiment.sampling_intervals;
    let mut found: Vec<(f64, Difference)> = COMPARED[..CRANE]
        .iter()
        .enumerate()
        .filter_map(|(k, signal)| {
            let pairs = experiment.samples.iter().zip(prediction);
            let both: Vec<(usize, f64, f64)> = pairs
                .enumerate()
                .filter_map(|(i, (sample, model))| Some((i, sample.values[k]?, model[k])))
                .collect();
            let noise = experiment.noise[k];
            // samples that were interpolated between different pairs of readings have independent noise
            let independent = (2.0 * sampling[k] / interval).ceil().max(1.0) as usize;
            let found = || difference(*signal, &both, (interval, independent), &is_free, noise);
            (both.len() > 20).then(|| (sampling[k].max(driven), found()))
        })
        .collect();
    let model = oscillation_of(found.iter().filter_map(|(_, d)| d.model_ringing));
    for (interval, difference) in &mut found {
        let is_resolved = |frequency: f64| *interval * frequency <= 1.0 / PER_PERIOD;
        difference.ringing = difference.ringing.filter(|r| is_resolved(r.frequency));
        if let Some(frequency) = model.filter(|frequency| !is_resolved(*frequency)) {
            difference.unresolved = Some(Unresolved { interval: *interval, frequency });
            difference.ringing = None;
        }
    }
    found.into_iter().map(|(_, difference)| difference).collect()
}

/// Highest frequency of the oscillations of several signals \[Hz\], preferably of those with an identified
/// damping.
fn oscillation_of(ringing: impl Iterator<Item = Ringing>) -> Option<f64> {
    let (damped, others): (Vec<Ringing>, Vec<Ringing>) = ringing.partition(|r| r.damping.is_some());
    let of = if damped.is_empty() { others } else { damped };
    of.into_iter().map(|r| r.frequency).reduce(f64::max)
}

/// Whether the system oscillates freely, without excitation, at each sample.
pub(crate) fn free(experiment: &Experiment, interval: f64) -> Vec<bool> {
    let driving: Vec<f64> = (0..experiment.samples.len()).map(|k| experiment.driving(k)).collect();
    let lag = (0.1 / interval).round().max(1.0) as usize;
    let slope = |k: usize| {
        let (a, b) = (k.saturating_sub(lag), (k + lag).min(driving.len() - 1));
        (driving[b] - driving[a]) / ((b - a).max(1) as f64 * interval)
    };
    (0..driving.len()).map(|k| slope(k).abs() < 1.0).collect()
}

fn difference(
    signal: Signal,
    both: &[(usize, f64, f64)],
    (interval, independent): (f64, usize),
    is_free: &[bool],
    noise: f64,
) -> Difference {
    let count = both.len() as f64;
    let errors: Vec<f64> = both.iter().map(|(_, log, model)| log - model).collect();
    let bias = errors.iter().sum::<f64>() / count;
    let rms = (errors.iter().map(|e| e * e).sum::<f64>() / count).sqrt();
    let peak = errors
        .iter()
        .copied()
        .fold(0.0, |peak: f64, e| if e.abs() > peak.abs() { e } else { peak });
    let mean = |of: fn(&(usize, f64, f64)) -> f64| both.iter().map(of).sum::<f64>() / count;
    let (of_log, of_model) = (mean(|b| b.1), mean(|b| b.2));
    let moment = |of: &dyn Fn(&(usize, f64, f64)) -> f64| both.iter().map(of).sum::<f64>() / count;
    let spread_log = moment(&|b| (b.1 - of_log).powi(2)).sqrt();
    let spread_model = moment(&|b| (b.2 - of_model).powi(2)).sqrt();
    let together = moment(&|b| (b.1 - of_log) * (b.2 - of_model));
    let moves = spread_log > 1e-9 * of_log.abs().max(1e-12);
    let correlation = (moves && spread_model > 0.0).then(|| together / (spread_log * spread_model));
    let log: Vec<f64> = both.iter().map(|b| b.1).collect();
    let model: Vec<f64> = both.iter().map(|b| b.2).collect();
    let is_whole = both.windows(2).all(|w| w[1].0 == w[0].0 + 1);
    let oscillation = |values: &[f64]| {
        let offset = both.first().map_or(0, |b| b.0);
        is_whole.then(|| ringing(values, interval, is_free.get(offset..).unwrap_or(&[]))).flatten()
    };
    let (log_in_time, model_in_time) = in_time(both);
    let late = delay(&log_in_time, &model_in_time, interval);
    let half = log_in_time.len() / 2;
    let halves = delay(&log_in_time[..half], &model_in_time[..half], interval)
        .zip(delay(&log_in_time[half..], &model_in_time[half..], interval))
        .map(|(first, second)| [first, second]);
    let drift = halves.map(|[first, second]| (second - first) / (half as f64 * interval));
    let moved = |shift: &dyn Fn(usize) -> f64| rms_moved(&log_in_time, &model_in_time, shift);
    // the delay of the first half applies at its middle
    let rms_without_drift = halves.zip(drift).map(|([first, _], drift)| {
        let from = first - 0.5 * half as f64 * interval * drift;
        moved(&|k| from / interval + drift * k as f64)
    });
    let left = log_in_time.iter().zip(&model_in_time).step_by(independent);
    let left: Vec<Option<f64>> = left.map(|(log, model)| Some((*log)? - (*model)?)).collect();
    let Whiteness { coloured, is_white } = whiteness(&left, interval * independent as f64);
    Difference {
        signal,
        count: both.len(),
        rms,
        peak,
        bias,
        correlation,
        fit: moves.then(|| 100.0 * (1.0 - rms / spread_log)),
        delay: late,
        rms_without_delay: late.map(|late| moved(&|_| late / interval)),
        rms_without_drift,
        delay_halves: halves,
        drift,
        ringing: oscillation(&log),
        model_ringing: oscillation(&model),
        coloured,
        is_white,
        parts: explained(&log_in_time, &model_in_time, interval),
        span: log.iter().copied().fold(f64::NEG_INFINITY, f64::max)
            - log.iter().copied().fold(f64::INFINITY, f64::min),
        largest: log.iter().fold(0.0, |most, v| v.abs().max(most)),
        noise,
        unresolved: None,
    }
}

/// Log and model on a uniform time grid from the first to the last measured sample; none where nothing was
/// measured.
fn in_time(both: &[(usize, f64, f64)]) -> (Vec<Option<f64>>, Vec<Option<f64>>) {
    let (first, last) = (both.first().map_or(0, |b| b.0), both.last().map_or(0, |b| b.0));
    let (mut log, mut model) = (vec![None; last + 1 - first], vec![None; last + 1 - first]);
    for (sample, of_log, of_model) in both {
        (log[sample - first], model[sample - first]) = (Some(*of_log), Some(*of_model));
    }
    (log, model)
}

/// Delay of the log relative to the model \[s\]: the shift of smallest difference of the slopes,
/// interpolated by a parabola. None without motion, or if the slopes are uncorrelated.
fn delay(log: &[Option<f64>], model: &[Option<f64>], interval: f64) -> Option<f64> {
    // slopes over 50 ms reduce the effect of noise
    let lag = (0.025 / interval).round().max(1.0) as usize;
    let slopes = |v: &[Option<f64>]| -> Vec<Option<f64>> {
        v.windows(2 * lag + 1).map(|w| Some(w[2 * lag]? - w[0]?)).collect()
    };
    let (log, model) = (slopes(log), slopes(model));
    let most = (LONGEST_DELAY / interval) as i64;
    if (log.len() as i64) < 4 * most {
        return None;
    }
    let middle = most..model.len() as i64 - most;
    // with gaps the number of pairs depends on the shift: the mean is minimised
    let mean = |of: &mut dyn Iterator<Item = f64>| {
        let (sum, count) = of.fold((0.0, 0_u32), |(sum, count), square| (sum + square, count + 1));
        (count > 0).then(|| sum / f64::from(count))
    };
    let mean_square = |shift: i64| {
        let pair = |k: i64| Some((model[k as usize]? - log[(k + shift) as usize]?).powi(2));
        mean(&mut middle.clone().filter_map(pair))
    };
    let mean_square: Vec<f64> = (-most..=most).map(mean_square).collect::<Option<_>>()?;
    let least =
        (0..mean_square.len()).min_by(|a, b| mean_square[*a].total_cmp(&mean_square[*b]))?;
    let alone = mean(&mut middle.filter_map(|k| Some(model[k as usize]?.powi(2))))?;
    if least == 0 || least == mean_square.len() - 1 || mean_square[least] >= 0.5 * alone {
        return None;
    }
    let (a, b, c) = (mean_square[least - 1], mean_square[least], mean_square[least + 1]);
    let shift = 0.5 * (a - c) / (a - 2.0 * b + c);
    Some((least as f64 - most as f64 + shift) * interval)
}

/// RMS of log minus model after shifting the log to earlier times, by `shift` samples at each sample.
fn rms_moved(log: &[Option<f64>], model: &[Option<f64>], shift: impl Fn(usize) -> f64) -> f64 {
    let squares = model.iter().enumerate().filter_map(|(k, model)| {
        let shift = shift(k);
        let whole = shift.floor();
        let share = shift - whole;
        let at = usize::try_from(k as i64 + whole as i64).ok()?;
        let (a, b) = ((*log.get(at)?)?, (*log.get(at + 1)?)?);
        Some((a + share * (b - a) - (*model)?).powi(2))
    });
    let (sum, count) = squares.fold((0.0, 0_u32), |(sum, count), s| (sum + s, count + 1));
    (sum / f64::from(count.max(1))).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn course(k: i32, late: f64) -> f64 {
        let t = f64::from(k) * 0.005 - late;
        (1.3 * t).sin() + 0.4 * (9.0 * t).sin()
    }

    fn scatter(k: i32) -> f64 {
        let x = (f64::from(k) * 12.9898).sin() * 43_758.547;
        2.0 * (x - x.floor()) - 1.0
    }

    fn compared(log: impl Fn(i32) -> f64, model: impl Fn(i32) -> f64) -> Difference {
        measured(|_| true, log, model)
    }

    /// The same with some samples missing.
    fn measured(
        is_there: impl Fn(i32) -> bool,
        log: impl Fn(i32) -> f64,
        model: impl Fn(i32) -> f64,
    ) -> Difference {
        let there = (0..3000).filter(|k| is_there(*k));
        let both: Vec<(usize, f64, f64)> = there.map(|k| (k as usize, log(k), model(k))).collect();
        difference(Signal::PressureA, &both, (0.005, 1), &[true; 3000], 0.0)
    }

    /// White noise of a log with half the sampling rate: interpolation correlates neighbouring samples, and
    /// samples between different pairs of readings are independent.
    #[test]
    fn interpolated_white_noise_is_white_at_independent_samples() {
        let read = |k: i32| match k % 2 {
            0 => scatter(k),
            _ => 0.5 * (scatter(k - 1) + scatter(k + 1)),
        };
        let both: Vec<(usize, f64, f64)> = (0..3000).map(|k| (k as usize, read(k), 0.0)).collect();
        let judged = |independent: usize| {
            difference(Signal::PressureA, &both, (0.005, independent), &[true; 3000], 0.0).is_white
        };
        assert!(!judged(1) && judged(4));
    }

    #[test]
    fn delay_and_drift_are_found_over_a_gap() {
        let is_there = |k: i32| !(700..2200).contains(&k);
        let late = measured(is_there, |k| course(k, 0.023), |k| course(k, 0.0));
        assert!((late.delay.unwrap() - 0.023).abs() < 1e-3, "{:?}", late.delay);
        assert!(late.rms_without_delay.unwrap() < 0.1 * late.rms);
        let drifting =
            measured(is_there, |k| course(k, 0.002 * f64::from(k) * 0.005), |k| course(k, 0.0));
        assert!((drifting.drift.unwrap() / 2e-3 - 1.0).abs() < 0.5, "{:?}", drifting.drift);
    }

    #[test]
    fn a_delay_an_offset_and_white_noise_are_distinguished() {
        let late = compared(|k| course(k, 0.023) + 0.01 * scatter(k), |k| course(k, 0.0));
        assert!((late.delay.unwrap() - 0.023).abs() < 1e-3, "{:?}", late.delay);
        let [first, second] = late.delay_halves.unwrap();
        assert!((first - second).abs() < 2e-3);
        assert!(late.rms_without_delay.unwrap() < 0.2 * late.rms);
        let shifted = compared(|k| course(k, 0.0) + 0.7, |k| course(k, 0.0));
        assert!(
            (shifted.bias - 0.7).abs() < 1e-12 && (shifted.correlation.unwrap() - 1.0).abs() < 1e-9
        );
        let noisy = compared(|k| course(k, 0.0) + 0.05 * scatter(k), |k| course(k, 0.0));
        assert!(noisy.coloured < 0.12, "{}", noisy.coloured);
        assert!(late.coloured > 0.5, "{}", late.coloured);
        assert!((noisy.rms - 0.05 / 3.0_f64.sqrt()).abs() < 0.002);
        assert!(noisy.fit.unwrap() > 95.0);
    }

    #[test]
    fn a_clock_drift_gives_different_delays_in_both_halves() {
        let drifting = compared(|k| course(k, 0.002 * f64::from(k) * 0.005), |k| course(k, 0.0));
        let [first, second] = drifting.delay_halves.unwrap();
        // 2 ms per second over 15 s: 7.5 ms in the middle of the first half, 22.5 ms in that of the second
        assert!((second - first - 0.015).abs() < 4e-3, "{first} s, then {second} s");
        assert!((drifting.drift.unwrap() / 2e-3 - 1.0).abs() < 0.25, "{:?}", drifting.drift);
        let left = drifting.rms_without_drift.unwrap();
        assert!(left < 0.2 * drifting.rms_without_delay.unwrap(), "{left}");
    }
}
