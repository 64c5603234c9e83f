//! Likelihood of a log under a delayed signal, and under more measurement noise.

use super::{NOISE, SETTLED, SignalFinding, is_consistent};
use crate::log_estimation::filter_run::{ALL, REST, Source, run};
use hydroboom_control::estimation::state_estimator::StateEstimator;
use hydroboom_measurement::Signal;

/// Trial delays \[s\].
const DELAYS: [f64; 5] = [0.01, 0.02, 0.04, 0.08, 0.15];
/// Gain of twice the log-likelihood per measured value from which a delay is reported. It grows with the
/// square of the delay and is about 0.01 for 20 ms along the motion at 120 mm/s.
const LOG_LIKELIHOOD_GAIN: f64 = 0.01;
/// Factors by which the measurement noise is varied, coarse to fine.
const NOISE_FACTORS: [f64; 2] = [4.0, 1.5];
/// Smallest step in the search for a delay \[s\].
const DELAY_RESOLUTION: f64 = 1e-3;
/// Length of the part of a log in which delays are searched \[s\].
const LONGEST_DELAY_SEARCH: f64 = 30.0;

/// Delay of position or load pressure relative to the other signals, found by the likelihood of the log.
pub(crate) struct Delay {
    /// Gain of twice the log-likelihood per measured value.
    pub(crate) gain: f64,
    signal: &'static str,
    /// Delay \[s\].
    late: f64,
}

/// Delay under which the log is more likely by more than [`LOG_LIKELIHOOD_GAIN`] and consistent. The
/// likelihood of an inconsistent model has no meaning.
pub(crate) fn delay(estimator: &StateEstimator<f64>, source: &Source<'_>) -> Option<Delay> {
    let part = moving(source)?;
    // the refinement changes a delay by up to half of itself
    let margin = 1.5 * DELAYS[DELAYS.len() - 1];
    let scored = [part.begin + margin, part.end() - margin];
    let delayed = |k: usize, late: f64| {
        let mut delays = [0.0; 2];
        delays[k] = late;
        run(estimator, &part, delays, scored, false)
    };
    let cost = |k: usize, late: f64| delayed(k, late).mean_cost();
    let now = cost(0, 0.0);
    let numbers = if source.has_pressure() { 0..2 } else { 0..1 };
    let mut best: Option<(f64, usize, f64)> = None;
    for k in numbers {
        for late in DELAYS.into_iter().flat_map(|d| [d, -d]) {
            let found = cost(k, late);
            if found < best.map_or(now - LOG_LIKELIHOOD_GAIN, |(least, ..)| least) {
                best = Some((found, k, late));
            }
        }
    }
    let (mut least, k, mut late) = best?;
    // refinement around the best trial delay with halved steps
    let mut step = 0.25 * late.abs();
    while step > DELAY_RESOLUTION {
        for near in [late - step, late + step] {
            let found = cost(k, near);
            if found < least {
                (least, late) = (found, near);
            }
        }
        step *= 0.5;
    }
    // a delay at the end of the search range probably has another cause
    let is_inside = late.abs() < DELAYS[DELAYS.len() - 1];
    if !is_inside || is_consistent(&delayed(k, late)) != Some(true) {
        return None;
    }
    let signal = if k == 0 { Signal::Stroke.symbol() } else { "p_A, p_B" };
    Some(Delay { gain: now - least, signal, late })
}

impl Delay {
    pub(super) fn finding(&self) -> SignalFinding {
        let way = if self.late > 0.0 { "late" } else { "early" };
        SignalFinding {
            signal: self.signal,
            kind: "delay",
            text: format!(
                "{} {way} by about {:.0} ms against the other signals: correct it with delay_ms in the mapping",
                self.signal,
                self.late.abs() * 1e3
            ),
        }
    }
}

/// Measurement noise of position \[m\] and load pressure \[Pa\] of largest likelihood, each at least the
/// filter's, with the gain of twice the log-likelihood per measured value.
pub(crate) fn likeliest_noise(
    estimator: &StateEstimator<f64>,
    source: &Source<'_>,
) -> ([f64; 2], f64) {
    let least = estimator.filter.measurement_noise;
    let part = moving(source).unwrap_or(*source);
    let cost = |noise: [f64; 2]| {
        let mut other = *estimator;
        other.filter.measurement_noise = noise;
        run(&other, &part, [0.0; 2], ALL, false).mean_cost()
    };
    let now = cost(least);
    let (mut noise, mut lowest) = (least, now);
    for factor in NOISE_FACTORS {
        loop {
            let tried = [[factor, 1.0], [1.0, factor], [1.0 / factor, 1.0], [1.0, 1.0 / factor]];
            let best = tried
                .map(|f| [0, 1].map(|k| (noise[k] * f[k]).max(least[k])))
                .map(|noise| (cost(noise), noise))
                .into_iter()
                .min_by(|a, b| a.0.total_cmp(&b.0));
            match best {
                Some((found, better)) if found < lowest - 1e-3 => {
                    (noise, lowest) = (better, found);
                }
                _ => break,
            }
        }
    }
    (noise, now - lowest)
}

/// Findings of noise above the expected one.
pub(crate) fn noise_findings(expected: [f64; 2], found: [f64; 2]) -> Vec<SignalFinding> {
    let units = [("position", 1e3, "mm"), ("load pressure", 1e-5, "bar")];
    let pairs = units.into_iter().zip(expected.into_iter().zip(found));
    pairs
        .filter(|(_, (expected, found))| *found > 1.5 * expected)
        .map(|((signal, size, unit), (expected, found))| SignalFinding {
            signal,
            kind: NOISE,
            text: format!(
                "noise of the {signal}: {:.2} {unit} RMS make the log likeliest, {:.2} {unit} were expected; the larger value is used",
                found * size,
                expected * size
            ),
        })
        .collect()
}

/// Part of a log in which delays are searched, from two seconds before the first motion; none without
/// motion.
pub(super) fn moving<'a>(source: &Source<'a>) -> Option<Source<'a>> {
    let (time, values) = (source.position.time(), source.position.values());
    let first = *values.get(time.partition_point(|t| *t < source.begin))?;
    let moved = time.iter().zip(values).find(|(t, x)| {
        (source.begin..=source.end()).contains(*t) && (*x - first).abs() > 10.0 * REST * SETTLED
    });
    let begin = (moved?.0 - 2.0).max(source.begin);
    let period = source.period;
    let left = ((source.end() - begin).min(LONGEST_DELAY_SEARCH) / period).floor();
    Some(Source { begin, periods: left.max(0.0) as usize, ..*source })
}
