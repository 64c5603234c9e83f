//! Measurement noise of a channel, estimated from its own samples.
//!
//! Differences of neighbouring samples contain the noise and little of a smooth signal (von Neumann,
//! Distribution of the ratio of the mean square successive difference to the variance, Ann. Math. Stat. 12,
//! 1941, 367-395; Rice, Bandwidth choice for nonparametric regression, Ann. Stat. 12, 1984, 1215-1230).
//!
//! Here they are divided differences of third order at the samples' own times, which vanish for a parabola.
//! They are scaled to keep the variance of white noise (Gasser, Sroka and Jennen-Steinmetz, Residual
//! variance and residual pattern in nonlinear regression, Biometrika 73, 1986, 625-633). The median of
//! their magnitudes makes the estimate robust to kinks and outliers.
//!
//! Where samples repeat, a channel shows the steps of its converter. A reading in steps of `q` has a
//! quantisation noise of `q/√12` (Bennett, Spectra of quantized signals, Bell Syst. Tech. J. 27, 1948,
//! 446-472), also where the steps are so coarse that most third differences are zero: the noise is no less.
//! `q` is the smallest difference between distinct values.

use hydroboom_measurement::Track;

/// Number of samples in a difference.
const POINTS: usize = 4;
/// Distance of neighbouring samples in median intervals above which there is a gap.
const GAP: f64 = 2.5;
/// Median of the magnitude of a standard normal variable.
const MEDIAN: f64 = 0.674_489_75;

/// Mean number of occurrences of a value from which a channel shows its resolution: a smooth signal has no
/// value twice.
const REPEATS: usize = 2;

/// Standard deviation of a signal's noise in its unit, from its samples in a time range \[s\], at least that
/// of the channel's resolution; zero for fewer than four samples.
///
/// Noise that the sensor's own filter smooths over several samples is not distinguished from the signal.
pub(crate) fn noise(track: &Track, from: f64, to: f64) -> f64 {
    let (time, values) = (track.time(), track.values());
    let (first, last) = (time.partition_point(|t| *t < from), time.partition_point(|t| *t <= to));
    let (time, values) = match first < last {
        true => (&time[first..last], &values[first..last]),
        false => return 0.0,
    };
    let most = GAP * track.interval();
    let whole = |t: &[f64]| t.windows(2).all(|pair| pair[1] - pair[0] <= most);
    let windows = time.windows(POINTS).zip(values.windows(POINTS));
    let mut sizes: Vec<f64> =
        windows.filter(|(t, _)| whole(t)).map(|(t, v)| pseudo_residual(t, v).abs()).collect();
    if sizes.is_empty() {
        return 0.0;
    }
    let middle = sizes.len() / 2;
    let scatter = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1 / MEDIAN;
    scatter.max(resolution(values) / f64::sqrt(12.0))
}

/// Smallest difference between distinct values; zero where values hardly repeat, and where there is but one.
fn resolution(values: &[f64]) -> f64 {
    let mut distinct = values.to_vec();
    distinct.sort_unstable_by(f64::total_cmp);
    distinct.dedup();
    if values.len() < REPEATS * distinct.len() {
        return 0.0;
    }
    let steps = distinct.windows(2).map(|pair| pair[1] - pair[0]);
    steps.reduce(f64::min).unwrap_or(0.0)
}

/// Divided difference of some samples, scaled to the variance of one of them.
fn pseudo_residual(time: &[f64], values: &[f64]) -> f64 {
    let weight = |i: usize| -> f64 {
        let others = (0..time.len()).filter(|j| *j != i);
        others.map(|j| (time[POINTS - 1] - time[0]) / (time[i] - time[j])).product()
    };
    let (sum, square) = values.iter().enumerate().fold((0.0, 0.0), |(sum, square), (i, v)| {
        let w = weight(i);
        (sum + w * v, square + w * w)
    });
    sum / f64::sqrt(square)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Normally distributed numbers.
    fn normal() -> impl FnMut() -> f64 {
        let mut state = 0x9e37_79b9_7f4a_7c15_u64;
        move || {
            let mut uniform = || {
                state ^= state << 13;
                state ^= state >> 7;
                state ^= state << 17;
                (state >> 11) as f64 / (1_u64 << 53) as f64
            };
            (0..12).map(|_| uniform()).sum::<f64>() - 6.0
        }
    }

    #[test]
    fn noise_is_estimated_from_uneven_samples_and_over_a_gap() {
        let mut normal = normal();
        let mut time = Vec::new();
        for k in 0..8000 {
            // sampling jitter of a tenth of the interval, and a gap of two seconds
            let t = 0.01 * f64::from(k) + 0.001 * normal().clamp(-3.0, 3.0);
            if !(30.0..32.0).contains(&t) {
                time.push(t);
            }
        }
        let course = |t: f64| if t < 31.0 { 40.0 + 3.0 * t } else { 900.0 + (2.0 * t).sin() };
        let values: Vec<f64> = time.iter().map(|t| course(*t) + 0.2 * normal()).collect();
        let found = noise(&Track::new(&time, &values), 0.0, 80.0);
        assert!((found / 0.2 - 1.0).abs() < 0.05, "{found}");
    }

    #[test]
    fn neither_a_parabola_nor_an_outlier_counts_as_noise() {
        let time: Vec<f64> = (0..100).map(|k| 0.1 * f64::from(k)).collect();
        let mut values: Vec<f64> = time.iter().map(|t| 1.0 + 2.0 * t - 0.3 * t * t).collect();
        values[50] += 1e3;
        assert!(noise(&Track::new(&time, &values), 0.0, 10.0) < 1e-12);
        assert_eq!(noise(&Track::new(&time, &values), 20.0, 30.0), 0.0);
    }

    /// A slow signal in steps of a converter, with most third differences equal to zero, and its error
    /// against the exact signal.
    #[test]
    fn a_coarse_converter_has_the_noise_of_its_steps() {
        let step = 0.25;
        let time: Vec<f64> = (0..4000).map(|k| 5e-3 * f64::from(k)).collect();
        let course = |t: &f64| 40.0 + 1.7 * t + 3.0 * t.sin();
        let values: Vec<f64> = time.iter().map(|t| step * (course(t) / step).round()).collect();
        let square = time.iter().zip(&values).map(|(t, v)| (v - course(t)).powi(2)).sum::<f64>();
        let error = (square / time.len() as f64).sqrt();
        let found = noise(&Track::new(&time, &values), 0.0, 20.0);
        assert!((found / error - 1.0).abs() < 0.05, "{found} for {error}");
        // the same signal without quantisation has none
        let values: Vec<f64> = time.iter().map(course).collect();
        assert!(noise(&Track::new(&time, &values), 0.0, 20.0) < 1e-3 * error);
        // and a constant reading shows no resolution
        assert!(noise(&Track::new(&time, &vec![40.0; time.len()]), 0.0, 20.0) < 1e-12);
    }
}
