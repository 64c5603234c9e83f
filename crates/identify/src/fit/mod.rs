//! The model made right: keys moved until it shows what was measured.
//!
//! What is minimised is `Σ ((log − model)/σ)² + Σ ((ln θ − ln θ_0)/s)²`: differences of all signals of all logs, each
//! against what its sensor and the model's own shortcomings leave (σ), and each key against what is known of it (s, from its
//! provenance). Where each log starts from is free too, within what sensors err by: a pump side that starts a tenth of
//! a bar wrong would be explained by something else. Levenberg and Marquardt's method with exact slopes; σ is found anew once from what the first round leaves.

use crate::differences::noise;
use crate::error::IdentifyError;
use crate::experiment::{COMPARED, Experiment};
use crate::free::Free;
use crate::prediction::{Direction, Prediction, STARTS, predict_from, slopes_from};
use hydroboom_description::Description;
use hydroboom_description::schema::Numbers;
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DMatrix, DVector, Dyn, storage::Owned};
use rayon::prelude::*;
use std::cell::RefCell;

/// One key after tuning.
#[derive(Clone, Debug, PartialEq)]
pub struct Tuned {
    /// The key.
    pub key: Free,
    /// Its value before and after, in SI units.
    pub value: (f64, f64),
    /// What was known of it beforehand: deviation of ln θ.
    pub prior: f64,
    /// Deviation of ln θ now, what was known included.
    pub deviation: f64,
    /// Deviation of ln θ from the logs alone, with the other keys as well known as they were; infinite where the logs
    /// say nothing.
    pub from_logs: f64,
    /// Whether the logs say more of it than was known.
    pub is_determined: bool,
    /// The key that it is traded against most, and the correlation with it.
    pub partner: Option<(Free, f64)>,
}

impl Tuned {
    /// The interval, in SI units, that holds the true value in nineteen cases of twenty, if the model is the true one.
    pub fn interval(&self) -> (f64, f64) {
        let factor = (1.96 * self.deviation).exp();
        (self.value.1 / factor, self.value.1 * factor)
    }
}

/// RMS differences of a log's signals before and after, in SI units; none where a signal was not measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Improvement {
    /// The log.
    pub log: String,
    /// Before and after, in the order of [`COMPARED`].
    pub rms: [Option<(f64, f64)>; COMPARED.len()],
}

/// What tuning came to.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The description with its keys moved.
    pub description: Description,
    /// The keys.
    pub tuned: Vec<Tuned>,
    /// Correlations of the keys, what was known included.
    pub correlation: Vec<Vec<f64>>,
    /// The logs.
    pub improvements: Vec<Improvement>,
    /// How often the model was run.
    pub evaluations: usize,
    /// Whether the search ended because nothing more was to be gained.
    pub has_converged: bool,
}

/// Deviation of ln θ that a provenance stands for.
pub fn prior(provenance: &str) -> f64 {
    match provenance {
        "measured" => 0.02,
        // much of what papers and data sheets print was fitted by somebody, or holds for another specimen
        "printed" | "derived" | "data sheet" => 0.1,
        "calibrated" | "tuned" => 0.2,
        // an estimate may be wrong by half
        _ => 0.5,
    }
}

/// Smallest deviations that a difference is held against, for position \[m\] and pressures \[Pa\].
const FINEST: [f64; 2] = [5e-6, 1e3];
/// Differences beyond so many deviations count less (Huber).
const ROBUST: f64 = 3.0;
/// Autocorrelations of what is left are taken into account up to this lag \[s\].
const MEMORY: f64 = 1.0;

/// Moves keys of a model until it shows what the logs do. `progress` is told how often the model was run, and the sum
/// that is minimised.
///
/// # Errors
///
/// [`IdentifyError`] when the model cannot be run where it begins.
pub fn fit(
    model: &Description,
    experiments: &[Experiment],
    free: &[Free],
    progress: &dyn Fn(usize, f64),
) -> Result<Fit, IdentifyError> {
    let mut begin: Vec<f64> = free.iter().map(|key| key.value(model).ln()).collect();
    let origins: Vec<String> = model.entries().map(|(_, _, o)| o.provenance.clone()).collect();
    let mut priors: Vec<f64> = free.iter().map(|key| prior(&origins[key.place])).collect();
    let known = priors.clone();
    for _ in experiments {
        begin.extend([0.0; STARTS]);
        priors.extend([1.0; STARTS]);
    }
    let layout = Layout { model, experiments, free };
    let before = layout.predictions(&begin)?;
    let mut deviations = experiments.iter().map(sensors).collect::<Vec<_>>();
    for (k, experiment) in experiments.iter().enumerate() {
        widen(&mut deviations[k], experiment, &before[k]);
    }
    let count = RefCell::new(0);
    let mut at = DVector::from_column_slice(&begin);
    let mut has_converged = false;
    for _ in 0..2 {
        let problem = Problem {
            layout,
            begin: &begin,
            priors: &priors,
            deviations: &deviations,
            at: at.clone(),
            count: &count,
            progress,
        };
        let (solved, report) = LevenbergMarquardt::new()
            .with_ftol(1e-6)
            .with_xtol(1e-5)
            .with_patience(6)
            .minimize(problem);
        at = solved.at;
        has_converged = report.termination.was_successful();
        let after = layout.predictions(at.as_slice())?;
        for (k, experiment) in experiments.iter().enumerate() {
            deviations[k] = sensors(experiment);
            widen(&mut deviations[k], experiment, &after[k]);
        }
    }
    let description = layout.moved(at.as_slice());
    let after = layout.predictions(at.as_slice())?;
    let information = layout.information(at.as_slice(), &deviations)?;
    let prior_matrix = DMatrix::from_diagonal(&DVector::from_iterator(
        priors.len(),
        priors.iter().map(|s| 1.0 / (s * s)),
    ));
    let covariance = covariance(&information, &prior_matrix);
    let deviation: Vec<f64> = (0..free.len()).map(|k| covariance[(k, k)].max(0.0).sqrt()).collect();
    let correlation: Vec<Vec<f64>> = (0..free.len())
        .map(|i| {
            (0..free.len())
                .map(|j| covariance[(i, j)] / (deviation[i] * deviation[j]).max(1e-300))
                .collect()
        })
        .collect();
    let tuned = free
        .iter()
        .enumerate()
        .map(|(k, key)| {
            // what the logs add: the information of both less that of what was known
            let gained = 1.0 / deviation[k].powi(2) - 1.0 / known[k].powi(2);
            let from_logs = if gained > 0.0 { gained.sqrt().recip() } else { f64::INFINITY };
            let partner = (0..free.len())
                .filter(|j| *j != k)
                .max_by(|a, b| correlation[k][*a].abs().total_cmp(&correlation[k][*b].abs()));
            Tuned {
                key: *key,
                value: (begin[k].exp(), at[k].exp()),
                prior: known[k],
                deviation: deviation[k],
                from_logs,
                is_determined: from_logs < known[k],
                partner: partner.map(|j| (free[j], correlation[k][j])),
            }
        })
        .collect();
    let improvements = experiments
        .iter()
        .enumerate()
        .map(|(k, experiment)| {
            let rms = |prediction: &Prediction, signal: usize| {
                let errors = residuals(experiment, prediction, signal);
                let count = errors.len();
                (count > 0)
                    .then(|| (errors.iter().map(|e| e.1 * e.1).sum::<f64>() / count as f64).sqrt())
            };
            let both = |s: usize| Some((rms(&before[k], s)?, rms(&after[k], s)?));
            Improvement { log: experiment.name.clone(), rms: std::array::from_fn(both) }
        })
        .collect();
    let evaluations = *count.borrow();
    Ok(Fit { description, tuned, correlation, improvements, evaluations, has_converged })
}

/// What sensors err by at the start of a log, and so the units in which its starts are moved: stroke \[m\], pressures \[Pa\].
const START_SCALE: [f64; STARTS] = [1e-4, 0.5e5, 0.5e5, 0.5e5, 0.1e5];

/// What is moved: ln θ of the keys, then for each log its starts.
#[derive(Clone, Copy)]
struct Layout<'a> {
    model: &'a Description,
    experiments: &'a [Experiment],
    free: &'a [Free],
}

impl Layout<'_> {
    /// The model with its keys moved.
    fn moved(&self, at: &[f64]) -> Description {
        let mut numbers = self.model.numbers.to_array();
        for (key, ln) in self.free.iter().zip(at) {
            let (low, high) = key.bounds();
            numbers[key.place] = ln.exp().clamp(low, high);
        }
        let mut moved = self.model.clone();
        moved.numbers = Numbers::from_array(numbers);
        moved
    }

    /// Place of a log's first start.
    fn starts(&self, log: usize) -> usize {
        self.free.len() + STARTS * log
    }

    fn offsets(&self, at: &[f64], log: usize) -> [f64; STARTS] {
        let from = self.starts(log);
        std::array::from_fn(|k| at[from + k] * START_SCALE[k])
    }

    fn predictions(&self, at: &[f64]) -> Result<Vec<Prediction>, IdentifyError> {
        let model = self.moved(at);
        let logs = self.experiments.par_iter().enumerate();
        logs.map(|(k, experiment)| predict_from(&model, experiment, &self.offsets(at, k))).collect()
    }

    /// A log's prediction, and its slopes with the places of what they are along.
    fn slopes(&self, at: &[f64], log: usize) -> Result<(Prediction, Slopes), IdentifyError> {
        let mut directions: Vec<Direction> = self.free.iter().map(|k| Direction::Key(*k)).collect();
        directions.extend((0..STARTS).map(Direction::Start));
        let offsets = self.offsets(at, log);
        let (prediction, slopes) =
            slopes_from(&self.moved(at), &self.experiments[log], &offsets, &directions)?;
        let keys = self.free.len();
        let placed =
            slopes.into_iter().enumerate().map(|(k, mut slope)| match k.checked_sub(keys) {
                None => (k, slope),
                Some(start) => {
                    let scale = START_SCALE[start];
                    slope.iter_mut().for_each(|row| *row = row.map(|v| v * scale));
                    (self.starts(log) + start, slope)
                }
            });
        Ok((prediction, placed.collect()))
    }

    fn size(&self) -> usize {
        self.starts(self.experiments.len())
    }
}

/// Slopes, each with the place of what it is along.
type Slopes = Vec<(usize, Prediction)>;

/// Log less model of a signal, with the sample.
fn residuals(experiment: &Experiment, prediction: &Prediction, signal: usize) -> Vec<(usize, f64)> {
    let pairs = experiment.samples.iter().zip(prediction).enumerate();
    pairs.filter_map(|(i, (s, p))| Some((i, s.values[signal]? - p[signal]))).collect()
}

/// What the sensors of a log scatter.
fn sensors(experiment: &Experiment) -> [f64; COMPARED.len()] {
    std::array::from_fn(|signal| {
        let values: Vec<f64> = experiment.samples.iter().filter_map(|s| s.values[signal]).collect();
        noise(&values).max(FINEST[usize::from(signal > 0)])
    })
}

/// A difference is held against what is left of it, where that is more than its sensor scatters.
fn widen(deviations: &mut [f64; COMPARED.len()], experiment: &Experiment, prediction: &Prediction) {
    for (signal, deviation) in deviations.iter_mut().enumerate() {
        let errors = residuals(experiment, prediction, signal);
        if errors.is_empty() {
            continue;
        }
        let square = errors.iter().map(|e| e.1 * e.1).sum::<f64>() / errors.len() as f64;
        *deviation = deviation.max(square.sqrt());
    }
}

/// Information of the logs on ln θ: Jᵀ W J, and what its sum's scatter is, Jᵀ W R W J, with R the autocovariance of what is
/// left; both are equal where only white noise is left.
struct Information {
    curvature: DMatrix<f64>,
    scatter: DMatrix<f64>,
}

impl Layout<'_> {
    fn information(
        &self,
        at: &[f64],
        deviations: &[[f64; COMPARED.len()]],
    ) -> Result<Information, IdentifyError> {
        let size = self.size();
        let mut curvature = DMatrix::zeros(size, size);
        let mut scatter = DMatrix::zeros(size, size);
        for (log, (experiment, deviation)) in self.experiments.iter().zip(deviations).enumerate() {
            let (prediction, slopes) = self.slopes(at, log)?;
            let lags = (MEMORY / experiment.interval()) as usize;
            let own = slopes.len();
            let add = |whole: &mut DMatrix<f64>, part: &DMatrix<f64>| {
                for i in 0..own {
                    for j in 0..own {
                        whole[(slopes[i].0, slopes[j].0)] += part[(i, j)];
                    }
                }
            };
            for signal in 0..COMPARED.len() {
                let errors = residuals(experiment, &prediction, signal);
                if errors.is_empty() {
                    continue;
                }
                let weight = 1.0 / (deviation[signal] * deviation[signal]);
                // scores: what each sample says, as a row
                let jacobian =
                    DMatrix::from_fn(errors.len(), own, |k, j| slopes[j].1[errors[k].0][signal]);
                add(&mut curvature, &(jacobian.transpose() * &jacobian * weight));
                let scores = DMatrix::from_fn(errors.len(), own, |k, j| {
                    jacobian[(k, j)] * errors[k].1 * weight
                });
                let mut sum = scores.transpose() * &scores;
                for lag in 1..=lags.min(errors.len() / 4) {
                    // Bartlett's weights keep the sum positive
                    let share = 1.0 - lag as f64 / (lags + 1) as f64;
                    let rows = errors.len() - lag;
                    let product = scores.rows(0, rows).transpose() * scores.rows(lag, rows);
                    sum += (&product + product.transpose()) * share;
                }
                add(&mut scatter, &sum);
            }
        }
        Ok(Information { curvature, scatter })
    }
}

/// (A + P)⁻¹ (S + P) (A + P)⁻¹: what the logs scatter and what was known, through the curvature of both.
fn covariance(information: &Information, prior: &DMatrix<f64>) -> DMatrix<f64> {
    let whole = &information.curvature + prior;
    let size = whole.nrows();
    let inverse = whole.cholesky().map_or_else(|| DMatrix::zeros(size, size), |c| c.inverse());
    &inverse * (&information.scatter + prior) * &inverse
}

struct Problem<'a> {
    layout: Layout<'a>,
    begin: &'a [f64],
    priors: &'a [f64],
    deviations: &'a [[f64; COMPARED.len()]],
    at: DVector<f64>,
    count: &'a RefCell<usize>,
    progress: &'a dyn Fn(usize, f64),
}

impl Problem<'_> {
    /// Each difference against its deviation, those far out drawn in; then the keys against what was known.
    fn stacked(&self, predictions: &[Prediction]) -> Vec<f64> {
        let mut all = Vec::new();
        for ((experiment, prediction), deviation) in
            self.layout.experiments.iter().zip(predictions).zip(self.deviations)
        {
            for (signal, sigma) in deviation.iter().enumerate() {
                all.extend(
                    residuals(experiment, prediction, signal)
                        .iter()
                        .map(|(_, e)| huber(e / sigma).0),
                );
            }
        }
        all.extend(
            self.at.iter().zip(self.begin).zip(self.priors).map(|((z, z0), s)| (z - z0) / s),
        );
        all
    }
}

/// A difference whose square is Huber's loss, and its slope.
fn huber(e: f64) -> (f64, f64) {
    if e.abs() <= ROBUST {
        return (e, 1.0);
    }
    let root = (2.0 * ROBUST * e.abs() - ROBUST * ROBUST).sqrt();
    (root.copysign(e), ROBUST / root)
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Problem<'_> {
    type ParameterStorage = Owned<f64, Dyn>;
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;

    fn set_params(&mut self, x: &DVector<f64>) {
        self.at.copy_from(x);
        for (z, key) in self.at.iter_mut().zip(self.layout.free) {
            let (low, high) = key.bounds();
            *z = z.clamp(low.max(1e-300).ln(), high.ln());
        }
    }

    fn params(&self) -> DVector<f64> {
        self.at.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        // where the model breaks off the search turns back
        let predicted = self.layout.predictions(self.at.as_slice()).ok()?;
        let all = self.stacked(&predicted);
        *self.count.borrow_mut() += 1;
        (self.progress)(*self.count.borrow(), all.iter().map(|r| r * r).sum());
        Some(DVector::from_vec(all))
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let size = self.layout.size();
        let mut rows: Vec<Vec<f64>> = Vec::new();
        for (log, (experiment, deviation)) in
            self.layout.experiments.iter().zip(self.deviations).enumerate()
        {
            let (prediction, slopes) = self.layout.slopes(self.at.as_slice(), log).ok()?;
            for (signal, sigma) in deviation.iter().enumerate() {
                for (i, e) in residuals(experiment, &prediction, signal) {
                    let drawn = huber(e / sigma).1;
                    let mut row = vec![0.0; size];
                    for (place, slope) in &slopes {
                        row[*place] = -drawn * slope[i][signal] / sigma;
                    }
                    rows.push(row);
                }
            }
        }
        for (k, s) in self.priors.iter().enumerate() {
            rows.push((0..size).map(|j| if j == k { 1.0 / s } else { 0.0 }).collect());
        }
        Some(DMatrix::from_fn(rows.len(), size, |i, j| rows[i][j]))
    }
}
