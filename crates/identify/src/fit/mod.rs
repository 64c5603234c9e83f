//! The model made right: keys moved until it shows what was measured.
//!
//! What is minimised is `Σ ((log − model)/σ)² + Σ ((ln θ − ln θ_0)/s)²`: differences of all signals of all logs, each
//! against what its sensor and the model's own shortcomings leave (σ), and each key against what is known of it (s, from its
//! provenance). Where each log starts from is free too, within what sensors err by: a pump side that starts a tenth of
//! a bar wrong would be explained by something else. Levenberg and Marquardt's method with exact slopes; σ is found anew once from what the first round leaves.

mod certainty;
mod layout;
mod residual;
mod search;

pub use search::Progress;

use crate::error::IdentifyError;
use crate::experiment::{COMPARED, Experiment};
use crate::free::Free;
use crate::prediction::{Prediction, STARTS};
use crate::tuning_fork::TuningFork;
use certainty::covariance;
use hydroboom_description::Description;
use layout::Layout;
use levenberg_marquardt::LevenbergMarquardt;
use nalgebra::{DMatrix, DVector};
use residual::{Deviations, residuals, sensors, widen};
use search::{Pitch, Problem, Watch};
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

impl Improvement {
    /// Differences of a log to two predictions.
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
    /// What the model shows under each log's inputs, before and after.
    pub predictions: (Vec<Prediction>, Vec<Prediction>),
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
/// What is asked of a search.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// The model to begin with.
    pub model: &'a Description,
    /// The logs.
    pub experiments: &'a [Experiment],
    /// The keys to move.
    pub free: &'a [Free],
    /// Where an earlier search was, as its [`Progress`] told; none to begin at the model.
    pub resume: Option<&'a [f64]>,
    /// Generations of a global search (CMA-ES) before the local one: as wide as what is known of the keys leaves
    /// open. It is for a model that is far off; usually none are needed.
    pub generations: usize,
}

/// Moves keys of a model until it shows what the logs do. `go_on` is told how far the search has come, and says whether
/// to go on.
///
/// # Errors
///
/// [`IdentifyError`] when the model cannot be run where it begins, or the search was stopped.
pub fn fit(task: &Task<'_>, go_on: &dyn Fn(&Progress<'_>) -> bool) -> Result<Fit, IdentifyError> {
    let Task { model, experiments, free, resume, generations } = *task;
    let mut begin: Vec<f64> = free.iter().map(|key| key.value(model).ln()).collect();
    let origins: Vec<String> = model.entries().map(|(_, _, o)| o.provenance.clone()).collect();
    let mut priors: Vec<f64> = free.iter().map(|key| prior(&origins[key.place])).collect();
    let known = priors.clone();
    for _ in experiments {
        begin.extend([0.0; STARTS]);
        priors.extend([1.0; STARTS]);
    }
    let layout = Layout { model, experiments, free };
    let longer: Vec<Experiment> = experiments.iter().map(Experiment::coarse).collect();
    let coarse = Layout { experiments: &longer, ..layout };
    let before = layout.predictions(&begin)?;
    let mut deviations: Vec<Deviations> = experiments.iter().map(sensors).collect();
    for (k, experiment) in experiments.iter().enumerate() {
        widen(&mut deviations[k], experiment, &before[k]);
    }
    let watch = Watch::new(go_on);
    let mut at = DVector::from_column_slice(&begin);
    if let Some(resume) = resume {
        if resume.len() != begin.len() {
            return Err(IdentifyError::Resume { moved: begin.len(), saved: resume.len() });
        }
        at = DVector::from_column_slice(resume);
    }
    let mut has_converged = false;
    let mut kept = vec![None; experiments.len()];
    // first the pitch, where log and model ring differently: compared sample by sample they would be out of phase
    let there = layout.predictions(at.as_slice())?;
    let forks: Vec<Option<TuningFork>> = experiments
        .iter()
        .zip(&there)
        .map(|(e, p)| TuningFork::new(e, p, generations > 0))
        .collect();
    if forks.iter().any(Option::is_some) {
        let pitch = Pitch {
            layout,
            begin: &begin,
            priors: &priors,
            forks: &forks,
            at: at.clone(),
            watch: &watch,
        };
        let pitch = pitch.searched(generations);
        at = LevenbergMarquardt::new()
            .with_ftol(1e-4)
            .with_xtol(1e-4)
            .with_patience(3)
            .minimize(pitch)
            .0
            .at;
    }
    for (k, prediction) in layout.predictions(at.as_slice())?.iter().enumerate() {
        deviations[k] = sensors(&experiments[k]);
        widen(&mut deviations[k], &experiments[k], prediction);
    }
    // the first round in longer steps; the second with what the first left as deviations. Neither may end early: a
    // ringing log has flat valleys
    for layout in [coarse, layout] {
        watch.borrow_mut().begin();
        let problem = Problem {
            layout,
            begin: &begin,
            priors: &priors,
            deviations: &deviations,
            at: at.clone(),
            kept: RefCell::new(vec![None; experiments.len()]),
            watch: &watch,
        };
        let (solved, report) = LevenbergMarquardt::new()
            .with_ftol(1e-6)
            .with_xtol(1e-5)
            .with_patience(6)
            .minimize(problem);
        at = solved.at;
        kept = solved.kept.into_inner();
        if watch.borrow().is_stopped() {
            return Err(IdentifyError::Stopped);
        }
        has_converged = report.termination.was_successful();
        let after = layout.predictions(at.as_slice())?;
        for (k, experiment) in experiments.iter().enumerate() {
            deviations[k] = sensors(experiment);
            widen(&mut deviations[k], experiment, &after[k]);
        }
    }
    let description = layout.moved(at.as_slice());
    let after = layout.predictions(at.as_slice())?;
    let information = layout.information(at.as_slice(), &deviations, &mut kept)?;
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
        .map(|(k, experiment)| Improvement::new(experiment, &before[k], &after[k]))
        .collect();
    let evaluations = watch.borrow().runs();
    Ok(Fit {
        description,
        tuned,
        correlation,
        improvements,
        predictions: (before, after),
        evaluations,
        has_converged,
    })
}
