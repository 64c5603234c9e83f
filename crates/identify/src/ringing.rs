//! Frequency and damping ratio of a decaying oscillation, by amplitude spectrum and nonlinear least squares.

use crate::limits::LIMITS;
use nalgebra::{Matrix4, Vector4};
use realfft::RealFftPlanner;

/// Frequency, damping ratio and amplitude of a decaying oscillation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ringing {
    /// Frequency \[Hz\].
    pub frequency: f64,
    /// Damping ratio \[-\]; none if no free decay of at least three periods exists.
    pub damping: Option<f64>,
    /// Initial amplitude of the fitted oscillation in the signal's unit; zero if none was fitted.
    pub amplitude: f64,
}

impl Ringing {
    /// Whether its frequency is reliable: the damping ratio is identified and at most
    /// [`Limits::readable_damping`](crate::Limits::readable_damping).
    pub fn has_reliable_frequency(&self) -> bool {
        self.damping.is_some_and(|damping| damping <= LIMITS.readable_damping)
    }
}

/// Frequency range of the search \[Hz\].
const BAND: (f64, f64) = (0.7, 20.0);
/// Damping ratio above which a transient does not count as an oscillation.
const MOST_DAMPING: f64 = 0.3;
/// Smallest ratio of a peak to the median of the spectrum.
const PROMINENT: f64 = 6.0;
/// Smallest number of periods in a free decay.
const PERIODS: f64 = 3.0;

/// Frequency and damping ratio of a signal's oscillation between 0.7 and 20 Hz. The signal is sampled every `interval`
/// \[s\]; `is_free` marks the samples without excitation and has the length of `values`. None without a prominent
/// peak, for fewer than 64 samples, or if a value is not finite.
///
/// The frequency is the largest peak of the amplitude spectrum of the signal's second difference over 0.2 s, which
/// removes slow motion. A Hann window is used, and bins are interpolated by a parabola. Damping and a refined
/// frequency come from `y = a + b t + e^{−σt} (c cos ωt + d sin ωt)`, fitted to the longest free decay.
///
/// ```
/// use hydroboom_identify::ringing;
/// let decay = |t: f64| 70.0 + 5.0 * (-0.8 * t).exp() * (std::f64::consts::TAU * 3.0 * t).cos();
/// let values: Vec<f64> = (0..1200).map(|k| decay(0.005 * f64::from(k))).collect();
/// let found = ringing(&values, 0.005, &vec![true; values.len()]);
/// assert!(found.is_some_and(|oscillation| (oscillation.frequency - 3.0).abs() < 0.03));
/// ```
pub fn ringing(values: &[f64], interval: f64, is_free: &[bool]) -> Option<Ringing> {
    if values.len() < 64 || values.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let coarse = peak(values, interval)?;
    let stretch = longest(is_free, values.len());
    let length = (stretch.1 - stretch.0) as f64 * interval;
    if length < PERIODS / coarse {
        return Some(Ringing { frequency: coarse, damping: None, amplitude: 0.0 });
    }
    // after some ten periods only noise would be fitted
    let most = (12.0 / coarse / interval) as usize;
    let part = &values[stretch.0..stretch.1.min(stretch.0 + most)];
    // the frequency in the free decay may differ from that of the whole signal
    let begin = peak(part, interval).filter(|f| (f / coarse - 1.0).abs() < 0.4).unwrap_or(coarse);
    let fitted = decay(part, interval, begin).filter(|r| {
        let is_near = (r.frequency / coarse - 1.0).abs() < 0.25;
        is_near && r.damping.is_some_and(|zeta| zeta < MOST_DAMPING)
    });
    Some(fitted.unwrap_or(Ringing { frequency: coarse, damping: None, amplitude: 0.0 }))
}

/// Longest sequence of samples without excitation.
fn longest(is_free: &[bool], count: usize) -> (usize, usize) {
    let (mut best, mut from) = ((0, 0), 0);
    for k in 0..=count {
        if k == count || !is_free.get(k).copied().unwrap_or(false) {
            if k - from > best.1 - best.0 {
                best = (from, k);
            }
            from = k + 1;
        }
    }
    best
}

/// Frequency of the largest peak \[Hz\].
fn peak(values: &[f64], interval: f64) -> Option<f64> {
    let lag = (0.1 / interval).round().max(1.0) as usize;
    if values.len() < 4 * lag + 16 {
        return None;
    }
    let difference: Vec<f64> = (lag..values.len() - lag)
        .map(|k| values[k + lag] - 2.0 * values[k] + values[k - lag])
        .collect();
    let count = difference.len();
    let length = (4 * count).next_power_of_two();
    let mut input = vec![0.0; length];
    for (k, value) in difference.iter().enumerate() {
        let hann = 0.5 - 0.5 * (std::f64::consts::TAU * k as f64 / count as f64).cos();
        input[k] = value * hann;
    }
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(length);
    let mut output = transform.make_output_vec();
    transform.process(&mut input, &mut output).ok()?;
    let frequency = |bin: f64| bin / (length as f64 * interval);
    // the second difference has the gain 4 sin²(π f lag), which is divided out
    let size: Vec<f64> = output
        .iter()
        .enumerate()
        .map(|(k, c)| {
            let f = frequency(k as f64);
            let answer = 4.0 * (std::f64::consts::PI * f * lag as f64 * interval).sin().powi(2);
            let is_in_band = (BAND.0..=BAND.1).contains(&f) && answer > 0.2;
            if is_in_band { c.norm() / answer } else { 0.0 }
        })
        .collect();
    let top = (1..size.len() - 1).max_by(|a, b| size[*a].total_cmp(&size[*b]))?;
    let mut inside: Vec<f64> = size.iter().copied().filter(|s| *s > 0.0).collect();
    if inside.is_empty() {
        return None;
    }
    let middle = inside.len() / 2;
    let median = *inside.get_mut(..)?.select_nth_unstable_by(middle, f64::total_cmp).1;
    if size[top] < PROMINENT * median {
        return None;
    }
    if size[top] <= 0.0 || size[top - 1] <= 0.0 || size[top + 1] <= 0.0 {
        return None;
    }
    let (a, b, c) = (size[top - 1].ln(), size[top].ln(), size[top + 1].ln());
    let shift = 0.5 * (a - c) / (a - 2.0 * b + c);
    Some(frequency(top as f64 + shift.clamp(-0.5, 0.5)))
}

/// Decaying oscillation of best fit, from an initial frequency \[Hz\].
fn decay(values: &[f64], interval: f64, frequency: f64) -> Option<Ringing> {
    let mut omega = std::f64::consts::TAU * frequency;
    let mut sigma = 0.05 * omega;
    let cost =
        |omega: f64, sigma: f64| linear(values, interval, omega, sigma).map(|(_, rest)| rest);
    let mut least = cost(omega, sigma)?;
    // pattern search with decreasing steps: two unknowns, no derivatives, no divergence
    let (mut of_omega, mut of_sigma) = (0.05 * omega, 0.04 * omega);
    while of_omega > 1e-6 * omega {
        let mut is_better = false;
        for (domega, dsigma) in
            [(of_omega, 0.0), (-of_omega, 0.0), (0.0, of_sigma), (0.0, -of_sigma)]
        {
            let (o, s) = (omega + domega, sigma + dsigma);
            if !(o > 0.5 * std::f64::consts::TAU * frequency && s > -0.02 * o && s < 0.7 * o) {
                continue;
            }
            if let Some(rest) = cost(o, s).filter(|rest| *rest < least) {
                (omega, sigma, least, is_better) = (o, s, rest, true);
            }
        }
        if !is_better {
            (of_omega, of_sigma) = (0.5 * of_omega, 0.5 * of_sigma);
        }
    }
    let (weights, rest) = linear(values, interval, omega, sigma)?;
    let amplitude = weights[2].hypot(weights[3]);
    let left = (rest / values.len() as f64).sqrt();
    // the amplitude must exceed the residual
    let turned = omega.hypot(sigma);
    (amplitude > 1.5 * left).then_some(Ringing {
        frequency: omega / std::f64::consts::TAU,
        damping: Some(sigma / turned),
        amplitude,
    })
}

/// Offset, slope, cosine and sine of best fit, and the residual sum of squares.
fn linear(values: &[f64], interval: f64, omega: f64, sigma: f64) -> Option<([f64; 4], f64)> {
    // rotation and decay per sample are constant
    let fades = (-sigma * interval).exp();
    let (sin, cos) = (omega * interval).sin_cos();
    let (turned, across) = (fades * cos, fades * sin);
    let rows = || {
        let mut now = (1.0, 0.0);
        values.iter().enumerate().map(move |(k, value)| {
            let (c, s) = now;
            now = (turned * c - across * s, turned * s + across * c);
            ([1.0, k as f64 * interval, c, s], *value)
        })
    };
    let (mut normal, mut right) = (Matrix4::<f64>::zeros(), Vector4::<f64>::zeros());
    for (r, value) in rows() {
        for i in 0..4 {
            right[i] += r[i] * value;
            for j in 0..4 {
                normal[(i, j)] += r[i] * r[j];
            }
        }
    }
    let weights = normal.cholesky()?.solve(&right);
    let weights = [weights[0], weights[1], weights[2], weights[3]];
    let rest = rows().map(|(r, value)| {
        let fitted: f64 = r.iter().zip(&weights).map(|(a, b)| a * b).sum();
        (value - fitted).powi(2)
    });
    Some((weights, rest.sum()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frequency_and_damping_of_a_decay_are_estimated_on_a_slope() {
        for (f, zeta) in [(2.24, 0.05), (3.2, 0.02), (1.1, 0.12)] {
            let interval = 0.005;
            let omega = std::f64::consts::TAU * f;
            let values: Vec<f64> = (0..1200)
                .map(|k| {
                    let t = f64::from(k) * interval;
                    let noise = 0.02 * (f64::from(k) * 12.9898).sin();
                    let damped = omega * (1.0_f64 - zeta * zeta).sqrt();
                    70.0 + 0.8 * t
                        + 5.0 * (-zeta * omega * t).exp() * (damped * t + 0.3).cos()
                        + noise
                })
                .collect();
            let found = ringing(&values, interval, &vec![true; values.len()]).unwrap();
            let damped = f * (1.0 - zeta * zeta).sqrt();
            assert!(
                (found.frequency / damped - 1.0).abs() < 3e-3,
                "{} for {damped}",
                found.frequency
            );
            assert!(
                (found.damping.unwrap() / zeta - 1.0).abs() < 0.03,
                "{:?} for {zeta}",
                found.damping
            );
            assert!((found.amplitude / 5.0 - 1.0).abs() < 0.05);
        }
    }

    /// With a transient that settles in a third of a second, as after a ramp, the frequency error exceeds
    /// its limit for strong damping. The frequency is not reported there.
    #[test]
    fn a_frequency_is_reliable_up_to_the_largest_damping() {
        let interval = 0.005;
        let mut worst = [0.0_f64; 2];
        for zeta in [0.01, 0.03, 0.06, 0.09, 0.2, 0.28] {
            let omega = std::f64::consts::TAU * 2.2;
            let damped = omega * (1.0_f64 - zeta * zeta).sqrt();
            for phase in [0.0, 1.0, 2.0, 3.0] {
                let values: Vec<f64> = (0..1200)
                    .map(|k| {
                        let t = f64::from(k) * interval;
                        let rings = 5.0 * (-zeta * omega * t).exp() * (damped * t + phase).cos();
                        70.0 + rings + 1.0 * (-t / 0.3).exp()
                    })
                    .collect();
                let found = ringing(&values, interval, &vec![true; values.len()]).unwrap();
                let off = (found.frequency * std::f64::consts::TAU / damped - 1.0).abs();
                let told = usize::from(found.has_reliable_frequency());
                worst[told] = worst[told].max(off);
            }
        }
        let [not_told, told] = worst;
        assert!(told < LIMITS.frequency && not_told > LIMITS.frequency, "{told}, {not_told}");
    }

    #[test]
    fn a_signal_without_oscillation_has_no_damping() {
        let slope: Vec<f64> = (0..1000).map(|k| 0.01 * f64::from(k)).collect();
        assert!(ringing(&slope, 0.005, &[true; 1000]).is_none_or(|r| r.damping.is_none()));
        assert!(ringing(&[1.0; 10], 0.005, &[true; 10]).is_none());
        assert!(ringing(&[1.0; 1000], 0.005, &[true; 1000]).is_none());
    }
}
