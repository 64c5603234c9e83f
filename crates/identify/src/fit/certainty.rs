//! How sure the logs make it.
//!
//! What is left between log and model is neither white nor independent from channel to channel: it is mostly what the model cannot show. The
//! inverse of the curvature, which supposes white noise, is then far too small. The covariance is the sandwich of an M-estimator (Huber, The behavior of
//! maximum likelihood estimates under nonstandard conditions, Proc. 5th Berkeley Symp. 1, 1967, 221-233; White, Econometrica 50, 1982, 1-25)
//!
//! ```text
//! D [Σ_i Σ_j J_iᵀ R(i − j) J_j] D,   D = (Σ_i J_iᵀ ψ'(e_i) J_i)⁻¹
//! ```
//!
//! with `e` what is left and `J` its slopes, both in deviations, `ψ` Huber's score, and `R` the covariance of the scores over lags and between all channels
//! (Morelli and Klein, Accuracy of aerodynamic model parameters estimated from flight test data, J. Guid. Control Dyn. 20(1), 1997, 74-80).
//!
//! The sample covariance over all lags is no estimate of `R`: what a fit leaves is orthogonal to its slopes, and of a constant slope a third of the variance or
//! less would be found. `R` is heteroskedasticity and autocorrelation consistent (HAC): the sample covariance weighed by Bartlett's window (Newey and West,
//! Econometrica 55, 1987, 703-708). Its width is the automatic one from autoregressions of first order, of each log (Andrews, Heteroskedasticity and
//! autocorrelation consistent covariance matrix estimation, Econometrica 59, 1991, 817-858, eqs. 6.2, 6.4). What window and orthogonality take away still is in the
//! critical values for the window's share of the log, which are wider than 1.96 (Kiefer and Vogelsang, A new asymptotic theory for
//! heteroskedasticity-autocorrelation robust tests, Econometric Theory 21, 2005, 1130-1164); and the whole is times n/(n − p) for p numbers fitted to n samples.
//!
//! By simulation, the variance found over the real one is 0.85 to 1.15 of white noise and of autoregressions, and up to 2.4 of noise that rings, which is found
//! too wide. A lag is one of time: where a channel has a gap, it has no pairs.
//!
//! Keys that stay where they are, are not exact either. The covariance is that of the problem in which they are free too, within what is known of them,
//! and one step of Gauss and Newton in that problem says what freeing them would change: what holding them may have cost is added to the variance as its square.
//!
//! So is what the model's own steps are wrong by. Its scheme is of second order: half the step shows three quarters of the error (Richardson, Phil. Trans. R.
//! Soc. A 210, 1911, 307-357), and `D JᵀW` times that is what it moves.

use super::Task;
use super::layout::Layout;
use super::residual::{Deviations, Slopes, residuals, score};
use super::search::Known;
use crate::error::IdentifyError;
use crate::experiment::{COMPARED, Experiment};
use crate::free::Free;
use crate::prediction::Prediction;
use nalgebra::{DMatrix, DVector};
use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use std::sync::Arc;

/// Information of the logs on ln θ: its curvature Jᵀ W J, and how what is left makes its slope scatter.
#[derive(Clone, Debug)]
pub(super) struct Information {
    curvature: DMatrix<f64>,
    scatter: DMatrix<f64>,
    /// Jᵀ W (log − model), less what draws back to what was known.
    slope: DVector<f64>,
    /// Jᵀ W (model of infinitely short steps − model).
    of_steps: DVector<f64>,
    /// How many numbers were moved: the first ones; keys that stay come after them.
    moved: usize,
}

/// Keys that a log tells something of, and which stay where they are.
pub(super) struct Considered {
    pub(super) keys: Vec<Free>,
    /// What they are known to: deviations of ln θ.
    pub(super) deviation: Vec<f64>,
}

impl Considered {
    pub(super) fn of(task: &Task<'_>) -> Self {
        let all = Free::usual(task.model).into_iter().chain(Free::replaceable(task.model));
        let keys: Vec<Free> = all.filter(|key| !task.free.contains(key)).collect();
        let deviation = keys.iter().map(|key| key.fixed_prior_deviation(task.model)).collect();
        Self { keys, deviation }
    }
}

/// The error of a scheme of second order over what half its step changes.
const RICHARDSON: f64 = 4.0 / 3.0;

impl Layout<'_> {
    /// What the logs say at a place, of keys that are held too: slopes along those need no fine steps, they only widen.
    pub(super) fn information(
        &self,
        at: &[f64],
        deviations: &[Deviations],
        kept: &mut [Option<Slopes>],
        known: &Known,
        held: &[Free],
    ) -> Result<Information, IdentifyError> {
        let (moved, size) = (self.size(), self.size() + held.len());
        let logs: Vec<usize> = (0..self.experiments.len()).collect();
        let mut all = self.all_slopes(at, &logs, kept)?;
        let mut curvature = DMatrix::zeros(size, size);
        let mut scatter = DMatrix::zeros(size, size);
        let mut slope = DVector::zeros(size);
        let mut of_steps = DVector::zeros(size);
        let in_steps = |of: fn(&Experiment) -> Experiment| -> Vec<Experiment> {
            self.experiments.iter().map(of).collect()
        };
        let finer = in_steps(Experiment::fine);
        let finer = Layout { experiments: &finer, ..*self }.predictions(at)?;
        let rough = in_steps(Experiment::rough);
        let rough = Layout { experiments: &rough, ..*self };
        let mut count = 0;
        let logs = self.experiments.iter().zip(deviations).zip(&mut all).zip(&finer).enumerate();
        for (log, (((experiment, deviation), (prediction, slopes)), finer)) in logs {
            let of_held = rough.slopes_along(at, log, held)?;
            slopes.extend(of_held.into_iter().map(|(k, slope)| (moved + k, slope)));
            let left = Left::new(experiment, deviation, prediction, slopes);
            count += left.count();
            let (own, its_scatter, its_slope) = (left.curvature(), left.scatter(), left.slope());
            let moved_by_steps = left.along(deviation, prediction, finer);
            for (i, (row, _)) in slopes.iter().enumerate() {
                slope[*row] += its_slope[i];
                of_steps[*row] += RICHARDSON * moved_by_steps[i];
                for (j, (column, _)) in slopes.iter().enumerate() {
                    curvature[(*row, *column)] += own[(i, j)];
                    scatter[(*row, *column)] += its_scatter[(i, j)];
                }
            }
        }
        scatter *= small_sample(count, moved);
        for (k, ((z, mean), s)) in at.iter().zip(&known.mean).zip(&known.deviation).enumerate() {
            slope[k] -= (z - mean) / (s * s);
        }
        Ok(Information { curvature, scatter, slope, of_steps, moved })
    }
}

/// What a covariance that was taken of what is left is too small by, where so many numbers were fitted to so many samples.
fn small_sample(samples: usize, fitted: usize) -> f64 {
    samples as f64 / samples.saturating_sub(fitted).max(1) as f64
}

/// What is left of a log, channel by channel.
struct Left {
    channels: Vec<ChannelLeft>,
}

/// What is left of a channel, in deviations; zero where nothing was measured.
struct ChannelLeft {
    /// Samples that were measured.
    count: usize,
    /// Scores of what is left.
    scores: Vec<f64>,
    /// Slopes of the scores by what is left: one, and zero far out.
    weights: Vec<f64>,
    /// Slopes along what is moved.
    slopes: DMatrix<f64>,
}

impl ChannelLeft {
    /// From what is left, none where nothing was measured, and its slopes.
    fn new(errors: &[Option<f64>], slopes: DMatrix<f64>) -> Self {
        let each = || errors.iter().map(|e| e.map_or((0.0, 0.0), score));
        Self {
            count: errors.iter().flatten().count(),
            scores: each().map(|(score, _)| score).collect(),
            weights: each().map(|(_, weight)| weight).collect(),
            slopes,
        }
    }
}

/// Autocorrelation from one sample to the next; none of what is zero throughout.
fn autocorrelation(values: &[f64]) -> Option<f64> {
    let square = values.iter().map(|v| v * v).sum::<f64>();
    let product = values.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>();
    (square > 0.0).then(|| product / square)
}

/// Width of Bartlett's window for some channels together, in samples, no more than they have: `1.1447 (α n)^(1/3)`, with Andrews's `α(1)` of autoregressions of
/// first order.
fn window_width(channels: &[&ChannelLeft]) -> f64 {
    let sums = channels.iter().filter_map(|channel| {
        let share = autocorrelation(&channel.scores)?;
        let power = channel.scores.iter().map(|v| v * v).sum::<f64>() / channel.count as f64;
        // σ⁴ of the innovations of an autoregression of this power, over (1 − share)⁴
        let under = (power * (1.0 + share) / (1.0 - share)).powi(2);
        let over = 4.0 * (share / (1.0 - share * share)).powi(2) * under;
        Some((over, under))
    });
    let (over, under) = sums.fold((0.0, 0.0), |(a, b), (over, under)| (a + over, b + under));
    let count = channels.iter().map(|channel| channel.count).max().unwrap_or(0) as f64;
    match under > 0.0 {
        true => (1.1447 * (over / under * count).cbrt()).clamp(1.0, count),
        false => 1.0,
    }
}

/// What a deviation is too small by where Bartlett's window is as wide as this share of the log: the critical value of a two-sided test at 5 % over 1.96 (Kiefer
/// and Vogelsang, 2005, table 1).
fn fixed_share(share: f64) -> f64 {
    (1.96 + share * (2.9694 + share * (0.4160 - share * 0.5324))) / 1.96
}

impl Left {
    fn new(
        experiment: &Experiment,
        deviation: &Deviations,
        prediction: &Prediction,
        slopes: &Slopes,
    ) -> Self {
        let length = experiment.samples.len();
        let of = |(signal, sigma): (usize, &f64)| {
            let mut errors = vec![None; length];
            let mut along = DMatrix::zeros(length, slopes.len());
            for (sample, e) in residuals(experiment, prediction, signal) {
                errors[sample] = Some(e / sigma);
                for (j, (_, slope)) in slopes.iter().enumerate() {
                    along[(sample, j)] = slope[sample][signal] / sigma;
                }
            }
            ChannelLeft::new(&errors, along)
        };
        Self { channels: deviation.iter().enumerate().take(COMPARED.len()).map(of).collect() }
    }

    /// Samples that were measured, of all channels.
    fn count(&self) -> usize {
        self.channels.iter().map(|channel| channel.count).sum()
    }

    /// How many numbers are moved.
    fn size(&self) -> usize {
        self.channels.first().map_or(0, |channel| channel.slopes.ncols())
    }

    /// `Σ_i J_iᵀ ψ'(e_i) J_i`.
    fn curvature(&self) -> DMatrix<f64> {
        let size = self.size();
        self.channels.iter().fold(DMatrix::zeros(size, size), |sum, channel| {
            let mut weighted = channel.slopes.clone();
            for (mut row, weight) in weighted.row_iter_mut().zip(&channel.weights) {
                row *= *weight;
            }
            sum + channel.slopes.tr_mul(&weighted)
        })
    }

    /// `Σ_i J_iᵀ ψ(e_i)`.
    fn slope(&self) -> DVector<f64> {
        self.channels.iter().fold(DVector::zeros(self.size()), |sum, channel| {
            sum + channel.slopes.tr_mul(&DVector::from_column_slice(&channel.scores))
        })
    }

    /// `Σ_i J_iᵀ ψ'(e_i) (b_i − a_i)` of two predictions a and b.
    fn along(&self, deviation: &Deviations, a: &Prediction, b: &Prediction) -> DVector<f64> {
        let channels = self.channels.iter().zip(deviation).enumerate();
        channels.fold(DVector::zeros(self.size()), |sum, (signal, (channel, sigma))| {
            let samples = a.iter().zip(b).zip(&channel.weights);
            let apart = samples.map(|((a, b), w)| w * (b[signal] - a[signal]) / sigma);
            sum + channel.slopes.tr_mul(&DVector::from_iterator(channel.weights.len(), apart))
        })
    }

    /// `Σ_i Σ_j J_iᵀ R(i − j) J_j`: each column of slopes through the windowed covariance as through a filter.
    fn scatter(&self) -> DMatrix<f64> {
        let length = self.channels.first().map_or(0, |channel| channel.scores.len());
        let size = self.size();
        let transforms = Transforms::new(length);
        let channels = self.channels.iter();
        let channels: Vec<&ChannelLeft> =
            channels.filter(|channel| autocorrelation(&channel.scores).is_some()).collect();
        let spectra = transforms.cross_spectra(&channels);
        let mut sum = DMatrix::zeros(size, size);
        for column in 0..size {
            let of =
                |channel: &&ChannelLeft| transforms.spectrum(channel.slopes.column(column).iter());
            let slopes: Vec<Option<Spectrum>> = channels.iter().map(of).collect();
            if slopes.iter().all(Option::is_none) {
                continue;
            }
            for (channel, row) in channels.iter().zip(&spectra) {
                let mut filtered = transforms.nothing();
                for (between, slope) in row.iter().zip(&slopes) {
                    let Some(slope) = slope else { continue };
                    for ((sum, s), j) in filtered.iter_mut().zip(between).zip(slope) {
                        *sum += s * j;
                    }
                }
                let course = DVector::from_vec(transforms.course(filtered));
                let mut to = sum.column_mut(column);
                to += channel.slopes.tr_mul(&course.rows(0, length));
            }
        }
        // the same either way, but for rounding
        0.5 * (&sum + sum.transpose())
    }
}

/// Half of the spectrum of a real course, zeros behind it.
type Spectrum = Vec<Complex<f64>>;

/// Transforms of courses that are padded to no less than twice their length.
struct Transforms {
    forward: Arc<dyn RealToComplex<f64>>,
    back: Arc<dyn ComplexToReal<f64>>,
}

impl Transforms {
    fn new(length: usize) -> Self {
        let padded = (2 * length).next_power_of_two().max(2);
        let mut planner = RealFftPlanner::<f64>::new();
        Self { forward: planner.plan_fft_forward(padded), back: planner.plan_fft_inverse(padded) }
    }

    fn nothing(&self) -> Spectrum {
        self.forward.make_output_vec()
    }

    /// Spectrum of a course; none of one that is zero throughout.
    fn spectrum<'a>(&self, course: impl Iterator<Item = &'a f64>) -> Option<Spectrum> {
        let mut padded = self.forward.make_input_vec();
        padded.iter_mut().zip(course).for_each(|(to, from)| *to = *from);
        padded.iter().any(|v| *v != 0.0).then(|| self.of_padded(&mut padded))
    }

    fn of_padded(&self, padded: &mut [f64]) -> Spectrum {
        let mut found = self.nothing();
        // lengths are those of the transform
        let _ = self.forward.process(padded, &mut found);
        found
    }

    /// The course of a spectrum.
    fn course(&self, mut spectrum: Spectrum) -> Vec<f64> {
        let mut course = self.back.make_output_vec();
        let scale = 1.0 / course.len() as f64;
        // those of a real course; rounding leaves a little
        for end in [0, spectrum.len() - 1] {
            spectrum[end].im = 0.0;
        }
        let _ = self.back.process(&mut spectrum, &mut course);
        course.iter_mut().for_each(|v| *v *= scale);
        course
    }

    /// Spectra of the scores' covariance between all pairs of channels: a row for each.
    fn cross_spectra(&self, channels: &[&ChannelLeft]) -> Vec<Vec<Spectrum>> {
        let width = window_width(channels);
        let most = channels.iter().map(|channel| channel.count).max().unwrap_or(0).max(1);
        let factor = fixed_share(width / most as f64).powi(2);
        let of = |channel: &&ChannelLeft| {
            let spectrum = self.spectrum(channel.scores.iter());
            let mut spectrum = spectrum.unwrap_or_else(|| self.nothing());
            let share = 1.0 / (channel.count as f64).sqrt();
            spectrum.iter_mut().for_each(|v| *v *= share);
            spectrum
        };
        let spectra: Vec<Spectrum> = channels.iter().map(of).collect();
        let between = |a: usize, b: usize| {
            let product = spectra[a].iter().zip(&spectra[b]).map(|(a, b)| a * b.conj());
            let mut covariance = self.course(product.collect());
            let padded = covariance.len();
            for (lag, value) in covariance.iter_mut().enumerate() {
                let window = 1.0 - lag.min(padded - lag) as f64 / width;
                *value *= factor * window.max(0.0);
            }
            self.of_padded(&mut covariance)
        };
        (0..channels.len()).map(|a| (0..channels.len()).map(|b| between(a, b)).collect()).collect()
    }
}

/// How sure it is what was moved.
#[derive(Clone, Debug)]
pub(super) struct Certainty {
    information: Information,
    /// What was known of all, keys that stay after what was moved: 1/s² of each.
    known: Vec<f64>,
    /// With what was known.
    whole: Covariance,
}

/// How what was moved scatters.
#[derive(Clone, Debug)]
struct Covariance {
    /// (A + P)⁻¹ (S + P) (A + P)⁻¹: what the logs scatter and what was known, through the curvature of both.
    real: DMatrix<f64>,
    /// The same of what was moved alone, keys that stay exact.
    exact: DMatrix<f64>,
    /// (A + P)⁻¹ of what was moved: the same if what is left were white noise, too.
    white: DMatrix<f64>,
    /// What freeing keys that stay would change.
    step: DVector<f64>,
    /// What shorter steps of the model would change; zero of keys that stay.
    of_steps: DVector<f64>,
}

/// What the logs alone say of one key, the others as well known as they were.
#[derive(Clone, Copy, Debug)]
pub(super) struct Alone {
    /// Deviation of ln θ; infinite where they say nothing.
    pub(super) deviation: f64,
    /// The same with keys that stay exact.
    pub(super) exact: f64,
    /// The same if what is left were white noise, too.
    pub(super) white: f64,
}

impl Information {
    /// None where neither logs nor what was known fix all that was moved.
    fn covariance(&self, known: &[f64]) -> Option<Covariance> {
        let prior = DMatrix::from_diagonal(&DVector::from_column_slice(known));
        let whole = &self.curvature + &prior;
        let size = (self.moved, self.moved);
        let white = whole.view((0, 0), size).into_owned().cholesky()?.inverse();
        let scatter = &self.scatter + &prior;
        let exact = &white * scatter.view((0, 0), size) * &white;
        let inverse = whole.cholesky()?.inverse();
        let real = &inverse * scatter * &inverse;
        let of_steps = &white * self.of_steps.rows(0, self.moved);
        let of_steps = of_steps.resize_vertically(known.len(), 0.0);
        Some(Covariance { real, exact, white, step: inverse * &self.slope, of_steps })
    }
}

impl Certainty {
    /// From the logs' information, and the deviations of what was known, keys that stay after what was moved.
    pub(super) fn new(information: Information, known: impl Iterator<Item = f64>) -> Self {
        let known: Vec<f64> = known.map(|s| 1.0 / (s * s)).collect();
        // where no covariance can be computed nothing is known, and not everything
        let open = |size: usize| DMatrix::from_diagonal_element(size, size, f64::INFINITY);
        let nothing = || Covariance {
            real: open(known.len()),
            exact: open(information.moved),
            white: open(information.moved),
            step: DVector::zeros(known.len()),
            of_steps: DVector::zeros(known.len()),
        };
        let mut whole = information.covariance(&known).unwrap_or_else(nothing);
        // a straight step says no more than that all that was known is open
        for (step, known) in whole.step.iter_mut().zip(&known) {
            let most = 1.0 / known.sqrt();
            *step = if step.is_nan() { most } else { step.max(-most).min(most) };
        }
        Self { information, known, whole }
    }

    /// Deviation of one of those that were moved: how it scatters, and what holding keys and the model's steps may have moved it by.
    pub(super) fn deviation(&self, place: usize) -> f64 {
        let Covariance { step, of_steps, .. } = &self.whole;
        self.scatter_of(place).hypot(step[place]).hypot(of_steps[place])
    }

    /// How one of those that were moved scatters.
    fn scatter_of(&self, place: usize) -> f64 {
        deviation_of(self.whole.real[(place, place)])
    }

    /// Correlations of the first ones.
    pub(super) fn correlation(&self, count: usize) -> Vec<Vec<f64>> {
        (0..count).map(|i| (0..count).map(|j| self.correlation_of(i, j)).collect()).collect()
    }

    /// Correlation of two: of how they scatter, without what both are off by.
    pub(super) fn correlation_of(&self, i: usize, j: usize) -> f64 {
        if i == j {
            return 1.0;
        }
        self.whole.real[(i, j)] / (self.scatter_of(i) * self.scatter_of(j)).max(1e-300)
    }

    /// What the logs alone say of one of those that were moved.
    pub(super) fn alone(&self, place: usize) -> Alone {
        let mut known = self.known.clone();
        // as good as nothing: a matrix that is singular for this key alone has an inverse still
        known[place] *= 1e-9;
        let of = |of: &DMatrix<f64>| deviation_of(of[(place, place)]);
        let found = self.information.covariance(&known).map(|c| Alone {
            deviation: of(&c.real).hypot(self.whole.step[place]).hypot(c.of_steps[place]),
            exact: of(&c.exact),
            white: of(&c.white),
        });
        // less than a thousandth of what was known is nothing
        let least = 1e3 / self.known[place].sqrt();
        let found = found.filter(|alone| alone.white < least);
        let nothing = f64::INFINITY;
        found.unwrap_or(Alone { deviation: nothing, exact: nothing, white: nothing })
    }

    /// How all the others go along when one is moved by one.
    pub(super) fn along(&self, place: usize) -> Vec<f64> {
        let own = self.whole.white[(place, place)].max(1e-300);
        self.whole.white.column(place).iter().map(|c| c / own).collect()
    }
}

/// Root of a variance: one below zero by rounding is zero, and one that is no number says nothing.
fn deviation_of(variance: f64) -> f64 {
    if variance.is_nan() { f64::INFINITY } else { variance.max(0.0).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// White noise, or each sample a share of the last one.
    fn noise(count: usize, share: f64, seed: u64) -> Vec<f64> {
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        let mut last = 0.0;
        let mut next = || {
            // the sum of twelve uniform numbers is normal enough
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

    /// What is left, all of it measured.
    fn measured(errors: Vec<f64>) -> Vec<Option<f64>> {
        errors.into_iter().map(Some).collect()
    }

    /// Some channels, and a slope that is one throughout: what is found is a mean. Its variance over that of white noise, of what is left about it.
    fn of_mean(channels: Vec<Vec<Option<f64>>>) -> f64 {
        let all: Vec<f64> = channels.iter().flatten().flatten().copied().collect();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let of = |errors: Vec<Option<f64>>| {
            let errors: Vec<Option<f64>> = errors.iter().map(|e| e.map(|e| e - mean)).collect();
            let slopes = errors.iter().map(|e| if e.is_some() { 1.0 } else { 0.0 });
            let slopes = DMatrix::from_iterator(errors.len(), 1, slopes);
            ChannelLeft::new(&errors, slopes)
        };
        let left = Left { channels: channels.into_iter().map(of).collect() };
        left.scatter()[(0, 0)] / left.curvature()[(0, 0)]
    }

    fn average(of: impl Fn(u64) -> f64) -> f64 {
        (1..=40).map(of).sum::<f64>() / 40.0
    }

    #[test]
    fn white_noise_scatters_as_the_curvature_says_and_correlated_noise_more() {
        let white = average(|seed| of_mean(vec![measured(noise(4000, 0.0, seed))]));
        assert!((white - 1.0).abs() < 0.15, "{white}");
        // the variance of the mean of an autoregressive course is (1 + a)/(1 - a) times that of a white one
        let coloured = average(|seed| of_mean(vec![measured(noise(4000, 0.9, seed))]));
        assert!((coloured / 19.0 - 1.0).abs() < 0.2, "{coloured}");
    }

    #[test]
    fn two_channels_that_are_off_together_tell_as_much_as_one() {
        let alike = average(|seed| of_mean(vec![measured(noise(4000, 0.0, seed)); 2]));
        assert!((alike - 2.0).abs() < 0.3, "{alike}");
        let two = |seed| [seed, 900 + seed].map(|seed| measured(noise(4000, 0.0, seed))).into();
        let apart = average(|seed| of_mean(two(seed)));
        assert!((apart - 1.0).abs() < 0.15, "{apart}");
    }

    /// An autoregression of second order.
    fn autoregression(count: usize, [a, b]: [f64; 2], seed: u64) -> Vec<f64> {
        let settling = 1000;
        let mut last = [0.0; 2];
        let next = |white: f64| {
            last = [a * last[0] + b * last[1] + white, last[0]];
            last[0]
        };
        noise(count + settling, 0.0, seed).into_iter().map(next).skip(settling).collect()
    }

    /// The way over frequencies is the sum over lags that is written above, done directly here.
    #[test]
    fn the_scatter_is_the_windowed_sum_over_lags() {
        let count = 30;
        let slope = |seed| {
            let columns = [seed, seed + 1].map(|seed| DVector::from_vec(noise(count, 0.5, seed)));
            DMatrix::from_columns(&columns)
        };
        let of = |(seed, share)| {
            ChannelLeft::new(&measured(noise(count, share, seed)), slope(seed + 10))
        };
        let left = Left { channels: [(3, 0.7), (4, 0.2)].map(of).into() };
        let width = window_width(&left.channels.iter().collect::<Vec<_>>());
        assert!(width > 2.0, "{width}");
        let mut expected = DMatrix::zeros(2, 2);
        for a in &left.channels {
            for b in &left.channels {
                for (i, j) in (0..count).flat_map(|i| (0..count).map(move |j| (i, j))) {
                    // the covariance of a at i and b at j, by all pairs that are as far apart
                    let lag = i as i64 - j as i64;
                    let pairs = (0..count as i64).filter_map(|k| {
                        let at = usize::try_from(k + lag).ok()?;
                        Some(a.scores.get(at)? * b.scores[k as usize])
                    });
                    let window = (1.0 - lag.abs() as f64 / width).max(0.0);
                    let between = window * pairs.sum::<f64>() / count as f64;
                    expected += a.slopes.row(i).transpose() * b.slopes.row(j) * between;
                }
            }
        }
        expected *= fixed_share(width / count as f64).powi(2);
        let found = left.scatter();
        assert!((&found - &expected).norm() < 1e-9 * expected.norm(), "{found} for {expected}");
    }

    /// What a fit of a constant, a slope and a sinusoid leaves of white and of correlated noise, and of noise that rings with a twentieth of critical damping: the
    /// variance that is found, on the average of forty, over how the three scatter, in 200 draws. Of what rings it may be up to two and a half times.
    #[test]
    fn residuals_of_a_fit_tell_how_what_was_fitted_scatters() {
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
                let left = &errors - &slopes * &fitted;
                // none of them is far out
                let far = left.amax();
                let left = measured(left.iter().map(|e| e / far).collect());
                let left = Left { channels: vec![ChannelLeft::new(&left, slopes.clone())] };
                let (sum, square) = (small_sample(count, 3), fitted.map(|v| v * v));
                // forty are enough for the average, and more for what scatters
                let variance = match seed <= 40 {
                    true => {
                        sum * far * far * (&inverse * left.scatter() * &inverse).diagonal() / 40.0
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

    /// Andrews (1991), eqs. 6.2 and 6.4, of an autoregression of first order and two channels; and a window as wide as the whole log, which makes the critical
    /// value 4.77 (Kiefer, Vogelsang and Bunzel, Econometrica 68, 2000, 695-714, table I).
    #[test]
    fn the_window_is_as_wide_as_published() {
        let count = 40_000;
        let of = |seed, size: f64| {
            let errors = autoregression(count, [0.5, 0.0], seed).into_iter().map(|e| size * e);
            ChannelLeft::new(&measured(errors.collect()), DMatrix::zeros(count, 1))
        };
        let alpha: f64 = 4.0 * 0.25 / (0.5_f64.powi(2) * 1.5_f64.powi(2));
        let expected = 1.1447 * (alpha * count as f64).cbrt();
        let found = window_width(&[&of(3, 0.1), &of(4, 0.5)]);
        assert!((found / expected - 1.0).abs() < 0.05, "{found} for {expected}");
        assert!((fixed_share(1.0) * 1.96 / 4.771 - 1.0).abs() < 0.01);
        assert_eq!(fixed_share(0.0), 1.0);
    }

    /// A channel that was measured for a quarter of the time tells what it would tell if it were all there is.
    #[test]
    fn a_gap_in_one_channel_is_as_if_its_samples_were_never_there() {
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
                ChannelLeft::new(&full, slope(0, &full)),
                ChannelLeft::new(&gap, slope(1, &gap)),
            ];
            let left = Left { channels };
            (left.scatter()[(1, 1)] / left.curvature()[(1, 1)], of_mean(vec![measured(short)]))
        };
        for share in [0.0, 0.8] {
            let gap = average(|seed| of(seed, share).0);
            let alone = average(|seed| of(seed, share).1);
            assert!((gap / alone - 1.0).abs() < 0.1, "{gap} for {alone}");
        }
    }

    /// Of a slope through numbers of which one in twenty is ten times as far out, Huber's estimate varies by `E ψ² / (E ψ')²` over the count.
    #[test]
    fn what_is_far_out_counts_as_the_search_weighs_it() {
        let count = 4000;
        let found = average(|seed| {
            let mut errors = noise(count, 0.0, seed);
            errors.iter_mut().step_by(20).for_each(|e| *e *= 10.0);
            let slopes = DMatrix::from_vec(count, 1, noise(count, 0.0, 300 + seed));
            let left = Left { channels: vec![ChannelLeft::new(&measured(errors), slopes)] };
            count as f64 * left.scatter()[(0, 0)] / left.curvature()[(0, 0)].powi(2)
        });
        // share of a normal variable of some size within 3, and the mean square of its score
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

    /// A log that tells its key to a thousandth, of a model whose steps move it by a hundredth: the interval has the hundredth.
    #[test]
    fn what_the_models_steps_move_is_in_the_interval() {
        let information = Information {
            curvature: DMatrix::from_element(1, 1, 1e6),
            scatter: DMatrix::from_element(1, 1, 1e6),
            slope: DVector::zeros(1),
            of_steps: DVector::from_element(1, 1e4),
            moved: 1,
        };
        let certainty = Certainty::new(information, [0.1].into_iter());
        for deviation in [certainty.deviation(0), certainty.alone(0).deviation] {
            assert!((deviation - 1e-3_f64.hypot(1e-2)).abs() < 2e-4, "{deviation}");
        }
    }

    #[test]
    fn nothing_is_certain_where_there_is_no_covariance() {
        let information = Information {
            curvature: DMatrix::from_element(1, 1, f64::NAN),
            scatter: DMatrix::zeros(1, 1),
            slope: DVector::zeros(1),
            of_steps: DVector::zeros(1),
            moved: 1,
        };
        let certainty = Certainty::new(information, [0.1].into_iter());
        assert_eq!(certainty.deviation(0), f64::INFINITY);
        assert_eq!(certainty.alone(0).deviation, f64::INFINITY);
        assert_eq!(certainty.correlation(1), [[1.0]]);
    }
}
