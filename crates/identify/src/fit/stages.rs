//! Stages of the minimisation, from coarse to fine.

use super::Task;
use super::features::FeatureResiduals;
use super::layout::Layout;
use super::least_squares::{LeastSquares, Prior, Termination};
use super::monitor::Monitor;
use super::nuisance::Nuisance;
use super::residual::{Weighting, deviations};
use super::samples::SampleResiduals;
use crate::error::IdentifyError;
use crate::oscillation_features::OscillationFeatures;
use nalgebra::DVector;
use std::cell::RefCell;

/// First stage: parameter vector with the frequencies and damping of the logs. Where log and model oscillate at
/// different frequencies, samples would be compared out of phase.
pub(super) fn match_oscillations(
    task: &Task<'_>,
    layout: Layout<'_>,
    prior: &Prior,
    parameters: DVector<f64>,
    monitor: &RefCell<Monitor<'_>>,
) -> Result<DVector<f64>, IdentifyError> {
    let predictions = layout.predictions(parameters.as_slice())?;
    let features: Vec<Option<OscillationFeatures>> = task
        .experiments
        .iter()
        .zip(&predictions)
        .map(|(e, p)| OscillationFeatures::new(e, p, task.generations > 0))
        .collect();
    if features.iter().all(Option::is_none) {
        return Ok(parameters);
    }
    let function = FeatureResiduals { features: &features };
    // delays and offsets of channels change neither frequency nor damping
    let all = Nuisance::named("all")?;
    let keys = Layout { fixed: &all, ..layout };
    let problem = LeastSquares::new(keys, function, prior, parameters, monitor);
    let termination = Termination { cost: 1e-4, step: 1e-4, evaluations: 3 };
    let (found, _) = problem.global_search(task.generations).minimised(termination);
    Ok(found.parameters)
}

/// Second stage, with long integration steps, from the same place twice: parameter vector of the smaller cost.
///
/// Far from the minimum, delays and offsets of channels cause local minima, and so do small residuals of one signal
/// beside large ones of another. Without them the cost may become smaller despite fewer parameters.
pub(super) fn match_samples(
    task: &Task<'_>,
    layout: Layout<'_>,
    prior: &Prior,
    initial: DVector<f64>,
    monitor: &RefCell<Monitor<'_>>,
) -> Result<DVector<f64>, IdentifyError> {
    let predictions = layout.predictions(initial.as_slice())?;
    let sigma = deviations(task.experiments, &predictions, Weighting::Independent);
    let accuracy = deviations(task.experiments, &predictions, Weighting::Transducers);
    let (coarse, all) = (task.coarse(), Nuisance::named("all")?);
    let first = Layout { experiments: &coarse, ..layout };
    let (mut parameters, mut least) = (initial.clone(), f64::INFINITY);
    for (stage, weights) in [(first, &sigma), (Layout { fixed: &all, ..first }, &accuracy)] {
        let function = SampleResiduals::new(stage.experiments, weights);
        let (found, _) =
            solve(LeastSquares::new(stage, function, prior, initial.clone(), monitor))?;
        let at = found.parameters;
        let function = SampleResiduals::new(first.experiments, &sigma);
        let problem = LeastSquares::new(first, function, prior, at.clone(), monitor);
        let residuals = problem.residual_vector(&at).unwrap_or_else(|| vec![f64::INFINITY]);
        let cost: f64 = residuals.iter().map(|residual| residual * residual).sum();
        if cost < least {
            (parameters, least) = (at, cost);
        }
    }
    Ok(parameters)
}

/// The problem at its minimum, and whether the iteration has converged. The tolerances are tight, because the
/// cost function of an oscillating log has narrow, flat valleys.
pub(super) fn solve<'a, 'w>(
    problem: LeastSquares<'a, 'w, SampleResiduals<'a>>,
) -> Result<(LeastSquares<'a, 'w, SampleResiduals<'a>>, bool), IdentifyError> {
    let monitor = problem.monitor;
    monitor.borrow_mut().restart();
    let found = problem.minimised(Termination { cost: 1e-6, step: 1e-5, evaluations: 6 });
    if monitor.borrow().is_stopped() {
        return Err(IdentifyError::Stopped);
    }
    Ok(found)
}
