//! Output-error estimation of the model's keys from logs: maximum a posteriori by nonlinear least squares.
//!
//! ```text
//! cost(ln θ) = Σ ρ((log − model)/σ) + Σ ((ln θ − ln θ_0)/s)²
//! ```
//!
//! The first sum is over all samples of all signals of all logs, with Huber's loss ρ and the standard
//! deviation σ of sensor noise and model error. The second is the prior of each key, with its initial value
//! θ_0 and the prior standard deviation s of its provenance.
//!
//! The initial values of each log are free within the sensors' errors. If they were fixed, an error of a
//! tenth of a bar of a pump side would bias the keys. Delay and offset of each channel are free as well
//! ([`Nuisance`]).
//!
//! The cost is minimised by the Levenberg-Marquardt method with exact sensitivities. σ is estimated again
//! once, from the residuals of the first minimum. Sources (output error, maximum a posteriori): Ljung,
//! *System Identification*, 2nd ed. 1999, chapter 7; Söderström and Stoica, *System Identification*, 1989,
//! chapter 7.

mod covariance;
mod determination;
mod features;
mod fourier_transform;
mod information;
mod layout;
mod least_squares;
mod monitor;
mod nuisance;
mod profile;
mod residual;
mod samples;
mod score_covariance;
mod stages;

pub use determination::Determination;
pub use monitor::Progress;
pub use nuisance::{Allowed, Effect, Nuisance};
pub use profile::{LIMIT, Profile, profile};

use crate::error::IdentifyError;
use crate::experiment::{COMPARED, Experiment};
use crate::free::Free;
use crate::prediction::{Prediction, predict_from};
use crate::structural_limit::limit_of;
use covariance::Uncertainty;
use determination::FitConditions;
use hydroboom_description::Description;
use information::FixedKeys;
use layout::{Layout, PARAMETERS_PER_LOG};
use least_squares::{LeastSquares, Prior};
use monitor::Monitor;
use nalgebra::DVector;
use residual::{Deviations, Weighting, deviations, has_lack_of_fit, residuals};
use samples::SampleResiduals;
use stages::{match_oscillations, match_samples, solve};

/// Maximum a posteriori estimate of a key θ, with its uncertainty as standard deviations of ln θ: 0.1 is about 10 %.
#[derive(Clone, Debug, PartialEq)]
pub struct Tuned {
    /// Key of the crane file.
    pub key: Free,
    /// Initial value and estimate, in the key's SI unit.
    pub value: (f64, f64),
    /// Prior standard deviation of ln θ \[-\].
    pub prior: f64,
    /// Posterior standard deviation of ln θ, from logs and prior \[-\].
    pub deviation: f64,
    /// Standard deviation of ln θ from the logs without its prior, but with the priors of all other keys \[-\].
    /// Infinite if the logs do not determine it.
    pub from_logs: f64,
    /// Standard deviation as `from_logs`, if the fixed keys were exact \[-\].
    pub others_exact: f64,
    /// Whether the logs determine the key, and the reason if not.
    pub determination: Determination,
    /// Name of the key, or of the delay or offset of a channel, that is most correlated with this key, and the
    /// posterior correlation coefficient \[-\]; none if there is no other parameter.
    pub partner: Option<(String, f64)>,
}

/// Standard deviation of ln θ due to the linear interpolation of the motor speed between samples \[-\]: no
/// estimate is more accurate.
const INPUT_INTERPOLATION: f64 = 3e-5;

impl Tuned {
    /// Whether the logs determine the key: all conditions of [`Determination`] hold.
    pub fn is_determined(&self) -> bool {
        self.determination == Determination::Determined
    }

    /// Omitted effect that biases the key; none if the logs show no lack of fit or no such effect is known.
    pub fn biased(&self) -> Option<&'static str> {
        match self.determination {
            Determination::Biased(reason) => Some(reason),
            _ => None,
        }
    }

    /// Bounds θ e^(∓1.96 s) of the 95 % interval in the key's SI unit, for a model without omitted effects. s² is the
    /// squared posterior deviation plus (3e-5)², from the interpolation of the motor speed between samples.
    pub fn interval(&self) -> (f64, f64) {
        let factor = (1.96 * self.deviation.hypot(INPUT_INTERPOLATION)).exp();
        (self.value.1 / factor, self.value.1 * factor)
    }
}

/// Estimate of a nuisance parameter: the delay or the offset of one channel of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Name of the log to which the channel belongs.
    pub log: String,
    /// Estimated delay or offset, by signal and kind.
    pub nuisance: Nuisance,
    /// Estimate, in the unit of [`Allowed::unit`]: ms, mm or bar.
    pub value: f64,
    /// Posterior standard deviation in the unit of [`Allowed::unit`].
    pub deviation: f64,
    /// Key that is most correlated with the delay or offset, and the posterior correlation coefficient \[-\]; none
    /// without a free key.
    pub partner: Option<(String, f64)>,
}

impl Channel {
    /// Lower and upper bound of the 95 % interval, in the unit of [`Allowed::unit`]: estimate ∓ 1.96 standard
    /// deviations.
    pub fn interval(&self) -> (f64, f64) {
        (self.value - 1.96 * self.deviation, self.value + 1.96 * self.deviation)
    }

    /// Whether the estimate is at a bound of [`Allowed::range`]. The part beyond the bound then biases the keys.
    pub fn is_at_limit(&self) -> bool {
        determination::is_at_limit(self.value, self.nuisance.allowed().range)
    }

    /// Whether zero is outside its 95 % interval: the delay or offset is significant at 5 %.
    pub fn is_off(&self) -> bool {
        self.value.abs() > 1.96 * self.deviation
    }
}

/// RMS residuals of one log's signals before and after the fit.
#[derive(Clone, Debug, PartialEq)]
pub struct Improvement {
    /// Name of the log.
    pub log: String,
    /// RMS residual before and after, in the signal's SI unit and in the order of [`COMPARED`]; none if not measured.
    pub rms: [Option<(f64, f64)>; COMPARED.len()],
}

impl Improvement {
    /// RMS residuals of a log for the predictions before and after a fit; each has one row for each sample.
    pub fn new(experiment: &Experiment, before: &Prediction, after: &Prediction) -> Self {
        let rms = |prediction: &Prediction, signal: usize| {
            let errors = residuals(experiment, prediction, signal);
            let count = errors.len();
            (count > 0)
                .then(|| (errors.iter().map(|e| e.1 * e.1).sum::<f64>() / count as f64).sqrt())
        };
        let both = |s: usize| Some((rms(before, s)?, rms(after, s)?));
        Self { log: experiment.name.clone(), rms: std::array::from_fn(both) }
    }
}

/// Result of a fit: estimates, their covariance as correlations, and the residuals.
#[derive(Clone, Debug)]
pub struct Fit {
    /// Crane with the estimates of the free keys.
    pub description: Description,
    /// Estimates of the free keys, in the order of the task.
    pub tuned: Vec<Tuned>,
    /// Estimates of the free delays and offsets of each log's channels.
    pub channels: Vec<Channel>,
    /// Posterior correlation matrix of the free keys \[-\], symmetric with a unit diagonal, in the order of `tuned`.
    pub correlation: Vec<Vec<f64>>,
    /// Posterior correlation coefficients \[-\]: a row for each free key, a column for each of the
    /// [`channels`](Self::channels).
    pub channel_correlation: Vec<Vec<f64>>,
    /// RMS residuals before and after the fit, one entry a log.
    pub improvements: Vec<Improvement>,
    /// Predictions before and after the fit, one for each log.
    pub predictions: (Vec<Prediction>, Vec<Prediction>),
    /// Number of cost evaluations, each of which simulates every log.
    pub evaluations: usize,
    /// Whether the last stage of the minimisation has converged.
    pub has_converged: bool,
    /// Minimum of the cost, from which profiles start.
    minimum: Minimum,
}

impl Fit {
    /// Delays and offsets of the machine's sensors in their units, which apply to its other logs too. Each is
    /// the mean over the fitted logs, weighted by inverse variances (Cochran, The combination of estimates
    /// from different experiments, Biometrics 10, 1954, 101-129).
    ///
    /// The keys were estimated together with them, and their prior shrinks them to zero. Insignificant ones
    /// are kept: without them, keys correlated with them would no longer fit. Such a selection is a pre-test
    /// estimator, which is discontinuous in the data (Judge and Bock, *The Statistical Implications of
    /// Pre-Test and Stein-Rule Estimators in Econometrics*, 1978).
    pub fn sensors(&self) -> Vec<(Nuisance, f64)> {
        nuisance::weighted_means(&self.channels)
    }

    /// Prediction of the fitted model for another log of the same machine, with its
    /// [`sensors`](Self::sensors).
    ///
    /// # Errors
    ///
    /// As [`predict`](crate::predict).
    pub fn on_another_log(&self, experiment: &Experiment) -> Result<Prediction, IdentifyError> {
        let [mut delays, mut offsets] = [[0.0; COMPARED.len()]; 2];
        for (nuisance, value) in self.sensors() {
            let to = match nuisance.effect {
                Effect::Delay => &mut delays,
                Effect::Offset => &mut offsets,
            };
            if let Some(index) = COMPARED.iter().position(|signal| *signal == nuisance.signal) {
                to[index] = value * nuisance.allowed().size;
            }
        }
        let channel = experiment.initial_channels();
        let initial_offsets =
            std::array::from_fn(|k| channel[k].map_or(0.0, |index| -offsets[index]));
        let mut prediction = predict_from(&self.description, experiment, &initial_offsets)?;
        nuisance::all_delayed(&mut prediction, &delays, experiment.interval());
        for row in &mut prediction {
            row.iter_mut().zip(offsets).for_each(|(value, offset)| *value += offset);
        }
        Ok(prediction)
    }
}

/// Minimum of the cost.
#[derive(Clone, Debug)]
struct Minimum {
    /// Parameter vector.
    parameters: Vec<f64>,
    /// Standard deviations of the residuals there.
    deviations: Vec<Deviations>,
    /// Uncertainty of the parameters.
    uncertainty: Uncertainty,
}

/// Estimation problem: model, logs, free and fixed parameters.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// Initial model, whose values are the prior means.
    pub model: &'a Description,
    /// Logs, prepared as experiments of this model.
    pub experiments: &'a [Experiment],
    /// Keys to be estimated.
    pub free: &'a [Free],
    /// Delays and offsets of channels that are fixed at zero; all others are free.
    pub fixed: &'a [Nuisance],
    /// Parameter vector of an earlier fit of the same task, from its [`Progress`]; none to start from the model.
    pub resume: Option<&'a [f64]>,
    /// Generations of a global search (CMA-ES) over the prior's range before the local one. Zero is usually
    /// enough, unless the initial model is far from the logs.
    pub generations: usize,
}

impl<'a> Task<'a> {
    fn layout(&self) -> Layout<'a> {
        Layout {
            model: self.model,
            experiments: self.experiments,
            free: self.free,
            fixed: self.fixed,
        }
    }

    /// Prior of the keys, and of each log's initial values and channels.
    fn prior(&self) -> Prior {
        let mut mean: Vec<f64> = self.free.iter().map(|key| key.value(self.model).ln()).collect();
        let mut deviation: Vec<f64> =
            self.free.iter().map(|key| key.prior_deviation(self.model)).collect();
        let of_logs = PARAMETERS_PER_LOG * self.experiments.len();
        mean.extend(std::iter::repeat_n(0.0, of_logs));
        deviation.extend(std::iter::repeat_n(1.0, of_logs));
        Prior { mean, deviation }
    }

    /// The logs with long integration steps, accurate enough to find the minimum.
    fn coarse(&self) -> Vec<Experiment> {
        self.experiments.iter().map(Experiment::coarse).collect()
    }
}

/// Output-error estimate of the free keys θ of a model from logs, maximum a posteriori, by the Levenberg-Marquardt
/// method.
///
/// It minimises Σ ρ((log − model)/σ) + Σ ((ln θ − ln θ_0)/s)² with Huber's loss ρ. σ is the standard deviation of
/// sensor noise and model error, and s the prior standard deviation of ln θ. `go_on` is called after each cost
/// evaluation, and stops the fit if it returns false. Source: Ljung, *System Identification*, 2nd ed. 1999, chapter 7.
///
/// # Errors
///
/// As [`predict`](crate::predict) if the initial model cannot be simulated. [`IdentifyError::Resume`] if `resume` has
/// another length than the parameter vector, [`IdentifyError::Stopped`] if the fit was stopped.
pub fn fit(task: &Task<'_>, go_on: &dyn Fn(&Progress<'_>) -> bool) -> Result<Fit, IdentifyError> {
    let prior = task.prior();
    let layout = task.layout();
    let before = layout.predictions(&prior.mean)?;
    let monitor = Monitor::new(go_on);
    let mut parameters = DVector::from_column_slice(task.resume.unwrap_or(&prior.mean));
    if parameters.len() != prior.mean.len() {
        return Err(IdentifyError::Resume { moved: prior.mean.len(), saved: parameters.len() });
    }
    parameters = match_oscillations(task, layout, &prior, parameters, &monitor)?;
    parameters = match_samples(task, layout, &prior, parameters, &monitor)?;
    // third stage: residuals weighted by their power and correlation after the second
    let predictions = layout.predictions(parameters.as_slice())?;
    let correlated = deviations(task.experiments, &predictions, Weighting::Correlated);
    let function = SampleResiduals::new(layout.experiments, &correlated);
    let (found, has_converged) =
        solve(LeastSquares::new(layout, function, &prior, parameters, &monitor))?;
    parameters = found.parameters;
    let mut cached = found.function.cached.into_inner();
    let after = layout.predictions(parameters.as_slice())?;
    let sigma = deviations(task.experiments, &after, Weighting::Correlated);
    let fixed_keys = FixedKeys::of(task);
    let information =
        layout.information(parameters.as_slice(), &sigma, &mut cached, &prior, &fixed_keys.keys)?;
    let uncertainty =
        Uncertainty::new(information, prior.deviation.iter().chain(&fixed_keys.deviation).copied());
    let improvements = task.experiments.iter().zip(before.iter().zip(&after));
    let improvements = improvements.map(|(e, (before, after))| Improvement::new(e, before, after));
    let evaluations = monitor.borrow().runs();
    let channels = channel_results(&layout, parameters.as_slice(), &uncertainty);
    let mut pairs = task.experiments.iter().zip(&after);
    let lack_of_fit = pairs.any(|(experiment, prediction)| has_lack_of_fit(experiment, prediction));
    Ok(Fit {
        description: layout.description(parameters.as_slice()),
        tuned: key_results(
            &layout,
            &prior,
            parameters.as_slice(),
            &uncertainty,
            &fixed_keys,
            &FitConditions::new(task.experiments, &after, &channels, has_converged),
            lack_of_fit,
        ),
        channels,
        correlation: uncertainty.correlation(task.free.len()),
        channel_correlation: channel_correlations(&layout, &uncertainty),
        improvements: improvements.collect(),
        predictions: (before, after),
        evaluations,
        has_converged,
        minimum: Minimum {
            parameters: parameters.as_slice().to_vec(),
            deviations: sigma,
            uncertainty,
        },
    })
}

/// Results of each key.
fn key_results(
    layout: &Layout<'_>,
    prior: &Prior,
    parameters: &[f64],
    uncertainty: &Uncertainty,
    fixed_keys: &FixedKeys,
    conditions: &FitConditions,
    lack_of_fit: bool,
) -> Vec<Tuned> {
    let nuisances = (0..layout.experiments.len()).flat_map(|log| layout.nuisances(log));
    let keys = layout.free.iter().map(|key| key.path()).enumerate();
    let fixed_keys = fixed_keys.keys.iter().enumerate();
    let all: Vec<(usize, String)> = keys
        .chain(nuisances.map(|(index, nuisance)| (index, nuisance.path())))
        .chain(fixed_keys.map(|(k, key)| (layout.size() + k, format!("{}, not free", key.path()))))
        .collect();
    let of = |(k, key): (usize, &Free)| {
        let (own, deviation) = (prior.deviation[k], uncertainty.deviation(k));
        let from_logs = uncertainty.by_logs_alone(k);
        let found = Tuned {
            key: *key,
            value: (prior.mean[k].exp(), parameters[k].exp()),
            prior: own,
            deviation,
            from_logs: from_logs.deviation,
            others_exact: from_logs.others_exact,
            determination: Determination::Determined,
            partner: most_correlated(k, &all, uncertainty),
        };
        let limit = limit_of(*key, &layout.model.numbers);
        let determination = conditions.of(&found, limit.filter(|_| lack_of_fit));
        Tuned { determination, ..found }
    };
    layout.free.iter().enumerate().map(of).collect()
}

/// Results of each channel.
fn channel_results(
    layout: &Layout<'_>,
    parameters: &[f64],
    uncertainty: &Uncertainty,
) -> Vec<Channel> {
    let keys: Vec<(usize, String)> = layout.free.iter().map(|key| key.path()).enumerate().collect();
    let of = |log: usize| {
        let keys = &keys;
        layout.nuisances(log).map(move |(index, nuisance)| {
            let deviation = nuisance.allowed().deviation;
            Channel {
                log: layout.experiments[log].name.clone(),
                nuisance,
                value: parameters[index] * deviation,
                deviation: uncertainty.deviation(index) * deviation,
                partner: most_correlated(index, keys, uncertainty),
            }
        })
    };
    (0..layout.experiments.len()).flat_map(of).collect()
}

/// Correlations of each key with each log's delays and offsets, in the order of [`channel_results`].
fn channel_correlations(layout: &Layout<'_>, uncertainty: &Uncertainty) -> Vec<Vec<f64>> {
    let logs = 0..layout.experiments.len();
    let places: Vec<usize> =
        logs.flat_map(|log| layout.nuisances(log)).map(|(index, _)| index).collect();
    let of_key = |key| places.iter().map(|index| uncertainty.correlation_of(key, *index)).collect();
    (0..layout.free.len()).map(of_key).collect()
}

/// Parameter of largest correlation with that of an index, and the correlation.
fn most_correlated(
    index: usize,
    all: &[(usize, String)],
    uncertainty: &Uncertainty,
) -> Option<(String, f64)> {
    let others = all.iter().filter(|(other, _)| *other != index);
    let others =
        others.map(|(other, name)| (name.clone(), uncertainty.correlation_of(index, *other)));
    others.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
}
