//! Covariance of the estimates.
//!
//! Residuals are neither white nor independent between channels, because they are mostly model error. The
//! inverse of the information matrix, which assumes white noise, is then much too small. The covariance is
//! the sandwich of an M-estimator (Huber, The behavior of maximum likelihood estimates under nonstandard
//! conditions, Proc. 5th Berkeley Symp. 1, 1967, 221-233; White, Maximum likelihood estimation of
//! misspecified models, Econometrica 50, 1982, 1-25)
//!
//! ```text
//! D [Σ_i Σ_j J_iᵀ R(i − j) J_j] D,   D = (Σ_i J_iᵀ ψ'(e_i) J_i)⁻¹
//! ```
//!
//! with the residuals `e` and the Jacobian `J` of the prediction, both over the standard deviations, and
//! Huber's score function `ψ`. `R` is the covariance of the scores over lags and between all channels
//! (Morelli and Klein, Accuracy of aerodynamic model parameters estimated from flight test data, J. Guid.
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
//!
//! Fixed keys are not exact either. The covariance is that of the problem in which they are free as well,
//! with their priors. One Gauss-Newton step of that problem estimates the change of the free parameters if
//! they were freed. Its square, the bias of fixing them, is added to the variance (compare consider
//! parameters: Tapley, Schutz and Born, *Statistical Orbit Determination*, 2004, chapter 6).
//!
//! The square of the integration bias is added too. The scheme is of second order, so halving the step shows
//! three quarters of the integration error (Richardson, The approximate arithmetical solution by finite
//! differences of physical problems involving differential equations, Phil. Trans. R. Soc. A 210, 1911,
//! 307-357). `D JᵀW` times that error is the bias of the parameters.

use super::Task;
use super::layout::Layout;
use super::least_squares::Prior;
use super::residual::{Deviations, Sensitivities, huber_score, residuals};
use crate::error::IdentifyError;
use crate::experiment::{COMPARED, Experiment};
use crate::free::Free;
use crate::prediction::Prediction;
use nalgebra::{DMatrix, DVector};
use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use std::sync::Arc;

/// Information matrix and score of all logs at the minimum, for the free parameters and then the fixed keys.
#[derive(Clone, Debug)]
pub(super) struct Information {
    /// Jᵀ W J, without the prior.
    information_matrix: DMatrix<f64>,
    /// Covariance of the score Jᵀ W (log − model).
    score_covariance: DMatrix<f64>,
    /// Negative gradient of half the cost, prior included.
    gradient: DVector<f64>,
    /// Jᵀ W (model without integration error − model).
    integration_gradient: DVector<f64>,
    /// Number of free parameters.
    free_count: usize,
}

/// Fixed keys with an effect on a log.
pub(super) struct FixedKeys {
    /// The keys.
    pub(super) keys: Vec<Free>,
    /// Their prior standard deviations of ln θ.
    pub(super) deviation: Vec<f64>,
}

impl FixedKeys {
    /// Fixed keys of a task.
    pub(super) fn of(task: &Task<'_>) -> Self {
        let all = Free::usual(task.model).into_iter().chain(Free::replaceable(task.model));
        let keys: Vec<Free> = all.filter(|key| !task.free.contains(key)).collect();
        let deviation = keys.iter().map(|key| key.fixed_prior_deviation(task.model)).collect();
        Self { keys, deviation }
    }
}

/// Error of a second-order scheme over the change by halving its step \[-\].
const RICHARDSON: f64 = 4.0 / 3.0;

impl Layout<'_> {
    /// Information of all logs at a parameter vector. Sensitivities to fixed keys are computed with long
    /// integration steps, because they only widen the intervals.
    ///
    /// # Errors
    ///
    /// [`IdentifyError`] if a simulation fails.
    pub(super) fn information(
        &self,
        parameters: &[f64],
        deviations: &[Deviations],
        cached: &mut [Option<Sensitivities>],
        prior: &Prior,
        fixed_keys: &[Free],
    ) -> Result<Information, IdentifyError> {
        let (free_count, size) = (self.size(), self.size() + fixed_keys.len());
        let logs: Vec<usize> = (0..self.experiments.len()).collect();
        let mut all = self.all_sensitivities(parameters, &logs, cached)?;
        let mut information_matrix = DMatrix::zeros(size, size);
        let mut score_covariance = DMatrix::zeros(size, size);
        let mut gradient = DVector::zeros(size);
        let mut integration_gradient = DVector::zeros(size);
        let with_steps = |of: fn(&Experiment) -> Experiment| -> Vec<Experiment> {
            self.experiments.iter().map(of).collect()
        };
        let finer = with_steps(Experiment::fine);
        let finer = Layout { experiments: &finer, ..*self }.predictions(parameters)?;
        let rough = with_steps(Experiment::rough);
        let rough = Layout { experiments: &rough, ..*self };
        let mut count = 0;
        let logs = self.experiments.iter().zip(deviations).zip(&mut all).zip(&finer).enumerate();
        for (log, (((experiment, deviation), (prediction, sensitivities)), finer)) in logs {
            let of_keys = rough.key_sensitivities(parameters, log, fixed_keys)?;
            sensitivities.extend(of_keys.into_iter().map(|(k, slope)| (free_count + k, slope)));
            let log_residuals = LogResiduals::new(experiment, deviation, prediction, sensitivities);
            count += log_residuals.count();
            let (own_information, own_score_covariance, own_gradient) = (
                log_residuals.information_matrix(),
                log_residuals.score_covariance(),
                log_residuals.gradient(),
            );
            let own_integration_gradient =
                log_residuals.projected_difference(deviation, prediction, finer);
            for (i, (row, _)) in sensitivities.iter().enumerate() {
                gradient[*row] += own_gradient[i];
                integration_gradient[*row] += RICHARDSON * own_integration_gradient[i];
                for (j, (column, _)) in sensitivities.iter().enumerate() {
                    information_matrix[(*row, *column)] += own_information[(i, j)];
                    score_covariance[(*row, *column)] += own_score_covariance[(i, j)];
                }
            }
        }
        score_covariance *= small_sample_factor(count, free_count);
        for (k, ((z, mean), s)) in
            parameters.iter().zip(&prior.mean).zip(&prior.deviation).enumerate()
        {
            gradient[k] -= (z - mean) / (s * s);
        }
        Ok(Information {
            information_matrix,
            score_covariance,
            gradient,
            integration_gradient,
            free_count,
        })
    }
}

/// Factor n/(n − p) that corrects a covariance of residuals for the number of fitted parameters.
fn small_sample_factor(samples: usize, fitted: usize) -> f64 {
    samples as f64 / samples.saturating_sub(fitted).max(1) as f64
}

/// Residuals of a log.
struct LogResiduals {
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
    fn new(
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
    fn count(&self) -> usize {
        self.channels.iter().map(|channel| channel.count).sum()
    }

    /// Number of parameters.
    fn size(&self) -> usize {
        self.channels.first().map_or(0, |channel| channel.jacobian.ncols())
    }

    /// `Σ_i J_iᵀ ψ'(e_i) J_i`.
    fn information_matrix(&self) -> DMatrix<f64> {
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
    fn gradient(&self) -> DVector<f64> {
        self.channels.iter().fold(DVector::zeros(self.size()), |sum, channel| {
            sum + channel.jacobian.tr_mul(&DVector::from_column_slice(&channel.scores))
        })
    }

    /// `Σ_i J_iᵀ ψ'(e_i) (b_i − a_i)` of two predictions a and b.
    fn projected_difference(
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
    fn score_covariance(&self) -> DMatrix<f64> {
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

/// Half of the spectrum of a real, zero-padded sequence.
type Spectrum = Vec<Complex<f64>>;

/// Fourier transforms of sequences padded with zeros to at least twice their length.
struct Transforms {
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
}

impl Transforms {
    fn new(length: usize) -> Self {
        let padded = (2 * length).next_power_of_two().max(2);
        let mut planner = RealFftPlanner::<f64>::new();
        Self {
            forward: planner.plan_fft_forward(padded),
            inverse: planner.plan_fft_inverse(padded),
        }
    }

    /// Spectrum of zeros.
    fn zeros(&self) -> Spectrum {
        self.forward.make_output_vec()
    }

    /// Spectrum of a sequence; none if all its values are zero.
    fn spectrum<'a>(&self, course: impl Iterator<Item = &'a f64>) -> Option<Spectrum> {
        let mut padded = self.forward.make_input_vec();
        padded.iter_mut().zip(course).for_each(|(to, from)| *to = *from);
        padded.iter().any(|v| *v != 0.0).then(|| self.forward_transform(&mut padded))
    }

    /// Spectrum of a padded sequence.
    fn forward_transform(&self, padded: &mut [f64]) -> Spectrum {
        let mut found = self.zeros();
        // cannot fail: the lengths are those of the transform
        let _ = self.forward.process(padded, &mut found);
        found
    }

    /// Padded sequence of a spectrum.
    fn inverse_transform(&self, mut spectrum: Spectrum) -> Vec<f64> {
        let mut course = self.inverse.make_output_vec();
        let scale = 1.0 / course.len() as f64;
        // the ends of the spectrum of a real sequence are real except for rounding
        for end in [0, spectrum.len() - 1] {
            spectrum[end].im = 0.0;
        }
        let _ = self.inverse.process(&mut spectrum, &mut course);
        course.iter_mut().for_each(|v| *v *= scale);
        course
    }

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

/// Uncertainty of the free parameters.
#[derive(Clone, Debug)]
pub(super) struct Uncertainty {
    /// Information of the logs.
    information: Information,
    /// Inverse prior variance 1/s² of each free parameter, then of each fixed key.
    prior_precision: Vec<f64>,
    /// Covariance with all priors.
    posterior: Covariance,
}

/// Covariance of the parameters, with the information matrix A, the score covariance S and the prior
/// precision P.
#[derive(Clone, Debug)]
struct Covariance {
    /// (A + P)⁻¹ (S + P) (A + P)⁻¹ of free parameters and fixed keys.
    sandwich: DMatrix<f64>,
    /// The same for the free parameters, with exact fixed keys.
    others_exact: DMatrix<f64>,
    /// (A + P)⁻¹ of the free parameters: the same for white residuals.
    white: DMatrix<f64>,
    /// Gauss-Newton step of the problem in which the fixed keys are free.
    newton_step: DVector<f64>,
    /// Change of the free parameters without integration error; zero for fixed keys.
    integration_bias: DVector<f64>,
}

/// Standard deviations of ln θ of a key from the logs without its prior, but with the priors of all others.
/// Infinite if the logs do not determine it.
#[derive(Clone, Copy, Debug)]
pub(super) struct FromLogs {
    /// With the uncertainty of the fixed keys.
    pub(super) deviation: f64,
    /// With exact fixed keys.
    pub(super) others_exact: f64,
    /// With exact fixed keys and white residuals.
    pub(super) white: f64,
}

impl Information {
    /// Covariance for a prior precision; none if the problem is singular.
    fn covariance(&self, prior_precision: &[f64]) -> Option<Covariance> {
        let prior = DMatrix::from_diagonal(&DVector::from_column_slice(prior_precision));
        let precision = &self.information_matrix + &prior;
        let size = (self.free_count, self.free_count);
        let white = precision.view((0, 0), size).into_owned().cholesky()?.inverse();
        let score_covariance = &self.score_covariance + &prior;
        let others_exact = &white * score_covariance.view((0, 0), size) * &white;
        let inverse = precision.cholesky()?.inverse();
        let sandwich = &inverse * score_covariance * &inverse;
        let integration_bias = &white * self.integration_gradient.rows(0, self.free_count);
        let integration_bias = integration_bias.resize_vertically(prior_precision.len(), 0.0);
        Some(Covariance {
            sandwich,
            others_exact,
            white,
            newton_step: inverse * &self.gradient,
            integration_bias,
        })
    }
}

impl Uncertainty {
    /// Uncertainty from the information of the logs and the prior standard deviations of the free parameters,
    /// then of the fixed keys.
    pub(super) fn new(information: Information, prior: impl Iterator<Item = f64>) -> Self {
        let prior_precision: Vec<f64> = prior.map(|s| 1.0 / (s * s)).collect();
        // without a covariance the uncertainty is infinite, not zero
        let open = |size: usize| DMatrix::from_diagonal_element(size, size, f64::INFINITY);
        let unknown = || Covariance {
            sandwich: open(prior_precision.len()),
            others_exact: open(information.free_count),
            white: open(information.free_count),
            newton_step: DVector::zeros(prior_precision.len()),
            integration_bias: DVector::zeros(prior_precision.len()),
        };
        let mut posterior = information.covariance(&prior_precision).unwrap_or_else(unknown);
        // a linear step is valid within the prior standard deviation at most
        for (step, precision) in posterior.newton_step.iter_mut().zip(&prior_precision) {
            let most = 1.0 / precision.sqrt();
            *step = if step.is_nan() { most } else { step.max(-most).min(most) };
        }
        Self { information, prior_precision, posterior }
    }

    /// Standard deviation of a free parameter, with the biases by fixed keys and integration.
    pub(super) fn deviation(&self, index: usize) -> f64 {
        let Covariance { newton_step, integration_bias, .. } = &self.posterior;
        self.sandwich_deviation(index).hypot(newton_step[index]).hypot(integration_bias[index])
    }

    /// Standard deviation of a free parameter without biases.
    fn sandwich_deviation(&self, index: usize) -> f64 {
        standard_deviation(self.posterior.sandwich[(index, index)])
    }

    /// Correlation matrix of the first `count` parameters.
    pub(super) fn correlation(&self, count: usize) -> Vec<Vec<f64>> {
        (0..count).map(|i| (0..count).map(|j| self.correlation_of(i, j)).collect()).collect()
    }

    /// Correlation of two parameters, without their biases.
    pub(super) fn correlation_of(&self, i: usize, j: usize) -> f64 {
        if i == j {
            return 1.0;
        }
        self.posterior.sandwich[(i, j)]
            / (self.sandwich_deviation(i) * self.sandwich_deviation(j)).max(1e-300)
    }

    /// Standard deviations of a free parameter without its own prior.
    pub(super) fn by_logs_alone(&self, index: usize) -> FromLogs {
        let mut prior_precision = self.prior_precision.clone();
        // nearly no prior, so that the matrix stays invertible if the logs do not determine the parameter
        prior_precision[index] *= 1e-9;
        let of = |of: &DMatrix<f64>| standard_deviation(of[(index, index)]);
        let found = self.information.covariance(&prior_precision).map(|c| FromLogs {
            deviation: of(&c.sandwich)
                .hypot(self.posterior.newton_step[index])
                .hypot(c.integration_bias[index]),
            others_exact: of(&c.others_exact),
            white: of(&c.white),
        });
        // beyond a thousand prior standard deviations the logs do not determine it
        let least = 1e3 / self.prior_precision[index].sqrt();
        let found = found.filter(|from_logs| from_logs.white < least);
        let infinite = f64::INFINITY;
        found.unwrap_or(FromLogs { deviation: infinite, others_exact: infinite, white: infinite })
    }

    /// Change of all free parameters for a unit change of one: their conditional mean given that one.
    pub(super) fn conditional_shift(&self, index: usize) -> Vec<f64> {
        let own = self.posterior.white[(index, index)].max(1e-300);
        self.posterior.white.column(index).iter().map(|c| c / own).collect()
    }
}

/// Root of a variance: zero if it is negative by rounding, infinite if it is not a number.
fn standard_deviation(variance: f64) -> f64 {
    if variance.is_nan() { f64::INFINITY } else { variance.max(0.0).sqrt() }
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
    fn white_noise_has_the_variance_of_the_information_matrix_and_correlated_noise_a_larger_one() {
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

    /// A log determines its key to a thousandth, but integration moves it by a hundredth: the interval
    /// includes the hundredth.
    #[test]
    fn the_integration_bias_widens_the_interval() {
        let information = Information {
            information_matrix: DMatrix::from_element(1, 1, 1e6),
            score_covariance: DMatrix::from_element(1, 1, 1e6),
            gradient: DVector::zeros(1),
            integration_gradient: DVector::from_element(1, 1e4),
            free_count: 1,
        };
        let uncertainty = Uncertainty::new(information, [0.1].into_iter());
        for deviation in [uncertainty.deviation(0), uncertainty.by_logs_alone(0).deviation] {
            assert!((deviation - 1e-3_f64.hypot(1e-2)).abs() < 2e-4, "{deviation}");
        }
    }

    #[test]
    fn without_a_covariance_the_uncertainty_is_infinite() {
        let information = Information {
            information_matrix: DMatrix::from_element(1, 1, f64::NAN),
            score_covariance: DMatrix::zeros(1, 1),
            gradient: DVector::zeros(1),
            integration_gradient: DVector::zeros(1),
            free_count: 1,
        };
        let uncertainty = Uncertainty::new(information, [0.1].into_iter());
        assert_eq!(uncertainty.deviation(0), f64::INFINITY);
        assert_eq!(uncertainty.by_logs_alone(0).deviation, f64::INFINITY);
        assert_eq!(uncertainty.correlation(1), [[1.0]]);
    }
}
