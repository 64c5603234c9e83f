//! Covariance of the scores: heteroskedasticity and autocorrelation consistent (HAC).
//!
//! Residuals are neither white nor independent between channels. With the residuals `e` and the Jacobian `J` of the
//! prediction, both over the standard deviations, and Huber's score function `ψ`, the covariance of the score
//! `Σ_i J_iᵀ ψ(e_i)` is `Σ_i Σ_j J_iᵀ R(i − j) J_j`. `R` is the covariance of the scores over lags and between all
//! channels (Morelli and Klein, Accuracy of aerodynamic model parameters estimated from flight test data, J. Guid.
//! Control Dyn. 20(1), 1997, 74-80).
//!
//! The sample covariance over all lags does not estimate `R`, because residuals are orthogonal to the
//! Jacobian: for a constant column it gives at most a third of the variance. `R` is therefore
//! heteroskedasticity and autocorrelation consistent (HAC): the sample covariance times Bartlett's window
//! (Newey and West, A simple, positive semi-definite, heteroskedasticity and autocorrelation consistent
//! covariance matrix, Econometrica 55, 1987, 703-708). The window width of each log is the automatic one from
//! first-order autoregressive processes (Andrews, Heteroskedasticity and autocorrelation consistent
//! covariance matrix estimation, Econometrica 59, 1991, 817-858, eqs. 6.2, 6.4).
//!
//! The remaining bias of window and orthogonality is corrected by critical values for the window's share of
//! the log, which exceed 1.96 (Kiefer and Vogelsang, A new asymptotic theory for
//! heteroskedasticity-autocorrelation robust tests, Econometric Theory 21, 2005, 1130-1164). The result is
//! multiplied by n/(n − p) for p parameters and n samples.
//!
//! In simulations the ratio of estimated to true variance is 0.85 to 1.15 for white noise and autoregressive
//! processes. It is up to 2.4 for noise that oscillates, whose intervals are too wide. Lags are times:
//! samples on the two sides of a gap are no neighbours.

use super::fourier_transform::{Spectrum, Transforms};
use super::residual::{Deviations, Sensitivities, huber_score, residuals};
use crate::experiment::{COMPARED, Experiment};
use crate::prediction::Prediction;
use nalgebra::{DMatrix, DVector};

/// Factor n/(n − p) that corrects a covariance of residuals for the number of fitted parameters.
pub(super) fn small_sample_factor(samples: usize, fitted: usize) -> f64 {
    samples as f64 / samples.saturating_sub(fitted).max(1) as f64
}

/// Residuals of a log.
pub(super) struct LogResiduals {
    channels: Vec<ChannelResiduals>,
}

/// Residuals of a channel over their standard deviations; zero for missing samples.
struct ChannelResiduals {
    /// Number of measured samples.
    count: usize,
    /// Huber's score ψ of each residual.
    scores: Vec<f64>,
    /// Its derivative ψ': one, or zero beyond the tuning constant.
    weights: Vec<f64>,
    /// Jacobian of the prediction: a row for each sample, a column for each parameter.
    jacobian: DMatrix<f64>,
}

impl ChannelResiduals {
    /// From the scaled residuals, none for missing samples, and the scaled Jacobian.
    fn new(errors: &[Option<f64>], jacobian: DMatrix<f64>) -> Self {
        let each = || errors.iter().map(|e| e.map_or((0.0, 0.0), huber_score));
        Self {
            count: errors.iter().flatten().count(),
            scores: each().map(|(score, _)| score).collect(),
            weights: each().map(|(_, weight)| weight).collect(),
            jacobian,
        }
    }
}

/// Autocorrelation at a lag of one sample; none if all values are zero.
fn autocorrelation(values: &[f64]) -> Option<f64> {
    let square = values.iter().map(|v| v * v).sum::<f64>();
    let product = values.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>();
    (square > 0.0).then(|| product / square)
}

/// Width of Bartlett's window for several channels together, in samples: `1.1447 (α n)^(1/3)`, at most their
/// length, with Andrews's `α(1)` of first-order autoregressive processes.
fn window_width(channels: &[&ChannelResiduals]) -> f64 {
    let sums = channels.iter().filter_map(|channel| {
        let rho = autocorrelation(&channel.scores)?;
        let power = channel.scores.iter().map(|v| v * v).sum::<f64>() / channel.count as f64;
        // variance σ² of the innovations of a process of this power: σ⁴/(1 − ρ)⁴
        let under = (power * (1.0 + rho) / (1.0 - rho)).powi(2);
        let over = 4.0 * (rho / (1.0 - rho * rho)).powi(2) * under;
        Some((over, under))
    });
    let (over, under) = sums.fold((0.0, 0.0), |(a, b), (over, under)| (a + over, b + under));
    let count = channels.iter().map(|channel| channel.count).max().unwrap_or(0) as f64;
    match under > 0.0 {
        true => (1.1447 * (over / under * count).cbrt()).clamp(1.0, count),
        false => 1.0,
    }
}

/// Critical value of a two-sided test at 5 % over 1.96, for a width of Bartlett's window that is `share` of
/// the log (Kiefer and Vogelsang, 2005, table 1).
fn critical_value_ratio(share: f64) -> f64 {
    (1.96 + share * (2.9694 + share * (0.4160 - share * 0.5324))) / 1.96
}

impl LogResiduals {
    /// Residuals and Jacobian of a log, over the standard deviations of its signals.
    pub(super) fn new(
        experiment: &Experiment,
        deviation: &Deviations,
        prediction: &Prediction,
        sensitivities: &Sensitivities,
    ) -> Self {
        let length = experiment.samples.len();
        let of = |(signal, sigma): (usize, &f64)| {
            let mut errors = vec![None; length];
            let mut jacobian = DMatrix::zeros(length, sensitivities.len());
            for (sample, e) in residuals(experiment, prediction, signal) {
                errors[sample] = Some(e / sigma);
                for (j, (_, slope)) in sensitivities.iter().enumerate() {
                    jacobian[(sample, j)] = slope[sample][signal] / sigma;
                }
            }
            ChannelResiduals::new(&errors, jacobian)
        };
        Self { channels: deviation.iter().enumerate().take(COMPARED.len()).map(of).collect() }
    }

    /// Number of measured samples of all channels.
    pub(super) fn count(&self) -> usize {
        self.channels.iter().map(|channel| channel.count).sum()
    }

    /// Number of parameters.
    fn size(&self) -> usize {
        self.channels.first().map_or(0, |channel| channel.jacobian.ncols())
    }

    /// `Σ_i J_iᵀ ψ'(e_i) J_i`.
    pub(super) fn information_matrix(&self) -> DMatrix<f64> {
        let size = self.size();
        self.channels.iter().fold(DMatrix::zeros(size, size), |sum, channel| {
            let mut weighted = channel.jacobian.clone();
            for (mut row, weight) in weighted.row_iter_mut().zip(&channel.weights) {
                row *= *weight;
            }
            sum + channel.jacobian.tr_mul(&weighted)
        })
    }

    /// `Σ_i J_iᵀ ψ(e_i)`.
    pub(super) fn gradient(&self) -> DVector<f64> {
        self.channels.iter().fold(DVector::zeros(self.size()), |sum, channel| {
            sum + channel.jacobian.tr_mul(&DVector::from_column_slice(&channel.scores))
        })
    }

    /// `Σ_i J_iᵀ ψ'(e_i) (b_i − a_i)` of two predictions a and b.
    pub(super) fn projected_difference(
        &self,
        deviation: &Deviations,
        a: &Prediction,
        b: &Prediction,
    ) -> DVector<f64> {
        let channels = self.channels.iter().zip(deviation).enumerate();
        channels.fold(DVector::zeros(self.size()), |sum, (signal, (channel, sigma))| {
            let samples = a.iter().zip(b).zip(&channel.weights);
            let apart = samples.map(|((a, b), w)| w * (b[signal] - a[signal]) / sigma);
            sum + channel.jacobian.tr_mul(&DVector::from_iterator(channel.weights.len(), apart))
        })
    }

    /// `Σ_i Σ_j J_iᵀ R(i − j) J_j`: the windowed covariance filters each column of the Jacobian.
    pub(super) fn score_covariance(&self) -> DMatrix<f64> {
        let length = self.channels.first().map_or(0, |channel| channel.scores.len());
        let size = self.size();
        let transforms = Transforms::new(length);
        let channels = self.channels.iter();
        let channels: Vec<&ChannelResiduals> =
            channels.filter(|channel| autocorrelation(&channel.scores).is_some()).collect();
        let spectra = transforms.cross_spectra(&channels);
        let mut sum = DMatrix::zeros(size, size);
        for column in 0..size {
            let of = |channel: &&ChannelResiduals| {
                transforms.spectrum(channel.jacobian.column(column).iter())
            };
            let slopes: Vec<Option<Spectrum>> = channels.iter().map(of).collect();
            if slopes.iter().all(Option::is_none) {
                continue;
            }
            for (channel, row) in channels.iter().zip(&spectra) {
                let mut filtered = transforms.zeros();
                for (between, slope) in row.iter().zip(&slopes) {
                    let Some(slope) = slope else { continue };
                    for ((sum, s), j) in filtered.iter_mut().zip(between).zip(slope) {
                        *sum += s * j;
                    }
                }
                let course = DVector::from_vec(transforms.inverse_transform(filtered));
                let mut to = sum.column_mut(column);
                to += channel.jacobian.tr_mul(&course.rows(0, length));
            }
        }
        // symmetric except for rounding
        0.5 * (&sum + sum.transpose())
    }
}

impl Transforms {
    /// Cross spectra of the scores of all pairs of channels, smoothed by the window: a row for each channel.
    fn cross_spectra(&self, channels: &[&ChannelResiduals]) -> Vec<Vec<Spectrum>> {
        let width = window_width(channels);
        let most = channels.iter().map(|channel| channel.count).max().unwrap_or(0).max(1);
        let factor = critical_value_ratio(width / most as f64).powi(2);
        let of = |channel: &&ChannelResiduals| {
            let spectrum = self.spectrum(channel.scores.iter());
            let mut spectrum = spectrum.unwrap_or_else(|| self.zeros());
            let share = 1.0 / (channel.count as f64).sqrt();
            spectrum.iter_mut().for_each(|v| *v *= share);
            spectrum
        };
        let spectra: Vec<Spectrum> = channels.iter().map(of).collect();
        let between = |a: usize, b: usize| {
            let product = spectra[a].iter().zip(&spectra[b]).map(|(a, b)| a * b.conj());
            let mut covariance = self.inverse_transform(product.collect());
            let padded = covariance.len();
            for (lag, value) in covariance.iter_mut().enumerate() {
                let window = 1.0 - lag.min(padded - lag) as f64 / width;
                *value *= factor * window.max(0.0);
            }
            self.forward_transform(&mut covariance)
        };
        (0..channels.len()).map(|a| (0..channels.len()).map(|b| between(a, b)).collect()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// First-order autoregressive process of unit variance with the coefficient `share`; white noise if it is
    /// zero.
    fn noise(count: usize, share: f64, seed: u64) -> Vec<f64> {
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        let mut last = 0.0;
        let mut next = || {
            // sum of twelve uniform numbers, nearly normal
            let mut uniform = || {
                state ^= state << 13;
                state ^= state >> 7;
                state ^= state << 17;
                (state >> 11) as f64 / (1_u64 << 53) as f64
            };
            let white = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
            last = share * last + white * (1.0 - share * share).sqrt();
            last
        };
        (0..count).map(|_| next()).collect()
    }

    /// Residuals without missing samples.
    fn measured(errors: Vec<f64>) -> Vec<Option<f64>> {
        errors.into_iter().map(Some).collect()
    }

    /// Variance of the mean of several channels, the parameter of a constant Jacobian, over that of white
    /// noise.
    fn of_mean(channels: Vec<Vec<Option<f64>>>) -> f64 {
        let all: Vec<f64> = channels.iter().flatten().flatten().copied().collect();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let of = |errors: Vec<Option<f64>>| {
            let errors: Vec<Option<f64>> = errors.iter().map(|e| e.map(|e| e - mean)).collect();
            let slopes = errors.iter().map(|e| if e.is_some() { 1.0 } else { 0.0 });
            let slopes = DMatrix::from_iterator(errors.len(), 1, slopes);
            ChannelResiduals::new(&errors, slopes)
        };
        let residuals = LogResiduals { channels: channels.into_iter().map(of).collect() };
        residuals.score_covariance()[(0, 0)] / residuals.information_matrix()[(0, 0)]
    }

    fn average(of: impl Fn(u64) -> f64) -> f64 {
        (1..=40).map(of).sum::<f64>() / 40.0
    }

    #[test]
    fn white_noise_gives_the_information_matrix_and_correlated_noise_more() {
        let white = average(|seed| of_mean(vec![measured(noise(4000, 0.0, seed))]));
        assert!((white - 1.0).abs() < 0.15, "{white}");
        // the variance of the mean of an autoregressive process is (1 + a)/(1 - a) times that of white noise
        let coloured = average(|seed| of_mean(vec![measured(noise(4000, 0.9, seed))]));
        assert!((coloured / 19.0 - 1.0).abs() < 0.2, "{coloured}");
    }

    #[test]
    fn two_channels_with_the_same_noise_have_the_information_of_one() {
        let alike = average(|seed| of_mean(vec![measured(noise(4000, 0.0, seed)); 2]));
        assert!((alike - 2.0).abs() < 0.3, "{alike}");
        let two = |seed| [seed, 900 + seed].map(|seed| measured(noise(4000, 0.0, seed))).into();
        let apart = average(|seed| of_mean(two(seed)));
        assert!((apart - 1.0).abs() < 0.15, "{apart}");
    }

    /// Second-order autoregressive process.
    fn autoregression(count: usize, [a, b]: [f64; 2], seed: u64) -> Vec<f64> {
        let settling = 1000;
        let mut last = [0.0; 2];
        let next = |white: f64| {
            last = [a * last[0] + b * last[1] + white, last[0]];
            last[0]
        };
        noise(count + settling, 0.0, seed).into_iter().map(next).skip(settling).collect()
    }

    /// The result by Fourier transforms equals the sum over lags, which is computed directly here.
    #[test]
    fn the_score_covariance_is_the_windowed_sum_over_lags() {
        let count = 30;
        let slope = |seed| {
            let columns = [seed, seed + 1].map(|seed| DVector::from_vec(noise(count, 0.5, seed)));
            DMatrix::from_columns(&columns)
        };
        let of = |(seed, share)| {
            ChannelResiduals::new(&measured(noise(count, share, seed)), slope(seed + 10))
        };
        let residuals = LogResiduals { channels: [(3, 0.7), (4, 0.2)].map(of).into() };
        let width = window_width(&residuals.channels.iter().collect::<Vec<_>>());
        assert!(width > 2.0, "{width}");
        let mut expected = DMatrix::zeros(2, 2);
        for a in &residuals.channels {
            for b in &residuals.channels {
                for (i, j) in (0..count).flat_map(|i| (0..count).map(move |j| (i, j))) {
                    // covariance of a at i and b at j from all pairs of the same lag
                    let lag = i as i64 - j as i64;
                    let pairs = (0..count as i64).filter_map(|k| {
                        let at = usize::try_from(k + lag).ok()?;
                        Some(a.scores.get(at)? * b.scores[k as usize])
                    });
                    let window = (1.0 - lag.abs() as f64 / width).max(0.0);
                    let between = window * pairs.sum::<f64>() / count as f64;
                    expected += a.jacobian.row(i).transpose() * b.jacobian.row(j) * between;
                }
            }
        }
        expected *= critical_value_ratio(width / count as f64).powi(2);
        let found = residuals.score_covariance();
        assert!((&found - &expected).norm() < 1e-9 * expected.norm(), "{found} for {expected}");
    }

    /// A constant, a slope and a sinusoid are fitted to white noise, to correlated noise, and to noise that
    /// oscillates with a damping ratio of 0.05. The ratio of the estimated variance, averaged over 40 draws,
    /// to the variance of the estimates over 200 draws is near one. For oscillating noise it may reach 2.5.
    #[test]
    fn residuals_of_a_fit_give_the_variance_of_its_estimates() {
        let (count, seeds) = (1500, 200);
        let slopes = DMatrix::from_fn(count, 3, |k, j| match j {
            0 => 1.0,
            1 => 2.0 * k as f64 / count as f64 - 1.0,
            _ => (2.0 * PI * k as f64 / 150.0).sin(),
        });
        let inverse = slopes.tr_mul(&slopes).try_inverse().unwrap();
        let turn = 2.0 * PI / 40.0;
        let fade = f64::exp(-0.05 * turn);
        let ringing = [2.0 * fade * turn.cos(), -fade * fade];
        for (coefficients, most) in [([0.0, 0.0], 1.25), ([0.9, 0.0], 1.25), (ringing, 2.5)] {
            let mut real = [0.0; 3];
            let mut found = [0.0; 3];
            for seed in 1..=seeds {
                let errors =
                    DVector::from_vec(autoregression(count, coefficients, 0x51_7c_c1 * seed));
                let fitted = &inverse * slopes.tr_mul(&errors);
                let residuals = &errors - &slopes * &fitted;
                // all residuals are below Huber's tuning constant
                let far = residuals.amax();
                let residuals = measured(residuals.iter().map(|e| e / far).collect());
                let residuals = LogResiduals {
                    channels: vec![ChannelResiduals::new(&residuals, slopes.clone())],
                };
                let (sum, square) = (small_sample_factor(count, 3), fitted.map(|v| v * v));
                // an average needs fewer draws than a variance
                let variance = match seed <= 40 {
                    true => {
                        sum * far
                            * far
                            * (&inverse * residuals.score_covariance() * &inverse).diagonal()
                            / 40.0
                    }
                    false => DVector::zeros(3),
                };
                for j in 0..3 {
                    real[j] += square[j] / seeds as f64;
                    found[j] += variance[j];
                }
            }
            for (found, real) in found.iter().zip(real) {
                let ratio = found / real;
                assert!((0.75..most).contains(&ratio), "{ratio} of {coefficients:?}");
            }
        }
    }

    /// Andrews (1991), eqs. 6.2 and 6.4, for a first-order autoregressive process and two channels. For a
    /// window as wide as the whole log the critical value is 4.77 (Kiefer, Vogelsang and Bunzel, Simple
    /// robust testing of regression hypotheses, Econometrica 68, 2000, 695-714, table I).
    #[test]
    fn the_window_is_as_wide_as_published() {
        let count = 40_000;
        let of = |seed, size: f64| {
            let errors = autoregression(count, [0.5, 0.0], seed).into_iter().map(|e| size * e);
            ChannelResiduals::new(&measured(errors.collect()), DMatrix::zeros(count, 1))
        };
        let alpha: f64 = 4.0 * 0.25 / (0.5_f64.powi(2) * 1.5_f64.powi(2));
        let expected = 1.1447 * (alpha * count as f64).cbrt();
        let found = window_width(&[&of(3, 0.1), &of(4, 0.5)]);
        assert!((found / expected - 1.0).abs() < 0.05, "{found} for {expected}");
        assert!((critical_value_ratio(1.0) * 1.96 / 4.771 - 1.0).abs() < 0.01);
        assert_eq!(critical_value_ratio(0.0), 1.0);
    }

    /// A channel measured for a quarter of the time gives the same variance as these samples without a gap.
    #[test]
    fn a_gap_in_one_channel_changes_the_variance_as_fewer_samples_do() {
        let (count, there) = (4000, 1000);
        let of = |seed: u64, share: f64| {
            let short = noise(there, share, seed);
            let mut gap = vec![None; count];
            gap[..there / 2].copy_from_slice(&measured(short[..there / 2].to_vec()));
            gap[count - there / 2..].copy_from_slice(&measured(short[there / 2..].to_vec()));
            let slope = |column: usize, errors: &[Option<f64>]| {
                DMatrix::from_fn(count, 2, |k, j| match (j == column, errors[k]) {
                    (true, Some(_)) => 1.0,
                    _ => 0.0,
                })
            };
            let full = measured(noise(count, 0.0, 700 + seed));
            let channels = vec![
                ChannelResiduals::new(&full, slope(0, &full)),
                ChannelResiduals::new(&gap, slope(1, &gap)),
            ];
            let residuals = LogResiduals { channels };
            (
                residuals.score_covariance()[(1, 1)] / residuals.information_matrix()[(1, 1)],
                of_mean(vec![measured(short)]),
            )
        };
        for share in [0.0, 0.8] {
            let gap = average(|seed| of(seed, share).0);
            let alone = average(|seed| of(seed, share).1);
            assert!((gap / alone - 1.0).abs() < 0.1, "{gap} for {alone}");
        }
    }

    /// One sample in twenty is ten times as large. The variance of Huber's estimate of a slope is `E ψ² / (E
    /// ψ')²` over the number of samples.
    #[test]
    fn outliers_have_the_variance_of_hubers_estimate() {
        let count = 4000;
        let found = average(|seed| {
            let mut errors = noise(count, 0.0, seed);
            errors.iter_mut().step_by(20).for_each(|e| *e *= 10.0);
            let slopes = DMatrix::from_vec(count, 1, noise(count, 0.0, 300 + seed));
            let residuals =
                LogResiduals { channels: vec![ChannelResiduals::new(&measured(errors), slopes)] };
            count as f64 * residuals.score_covariance()[(0, 0)]
                / residuals.information_matrix()[(0, 0)].powi(2)
        });
        // probability that a normal variable of a standard deviation is within 3, and the mean square of its
        // score
        let of = |size: f64| {
            let step = 1e-3;
            let density =
                |e: f64| (-0.5 * (e / size).powi(2)).exp() / (size * std::f64::consts::TAU.sqrt());
            let inside =
                (-3000..3000).map(|k| (f64::from(k) + 0.5) * step).map(|e| (e, density(e) * step));
            let (share, square) = inside.fold((0.0, 0.0), |(s, q), (e, p)| (s + p, q + e * e * p));
            (share, square + 9.0 * (1.0 - share))
        };
        let (usual, far) = (of(1.0), of(10.0));
        let square = 0.95 * usual.1 + 0.05 * far.1;
        let slope: f64 = 0.95 * usual.0 + 0.05 * far.0;
        let expected = square / slope.powi(2);
        assert!((found / expected - 1.0).abs() < 0.1, "{found} for {expected}");
    }
}
