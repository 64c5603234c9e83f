//! How sure the logs make it.

use super::layout::Layout;
use super::residual::{Deviations, Slopes, residuals};
use crate::error::IdentifyError;
use crate::experiment::COMPARED;
use nalgebra::DMatrix;

/// Autocorrelations of what is left are taken into account up to this lag \[s\].
const MEMORY: f64 = 1.0;

/// Information of the logs on ln θ: Jᵀ W J, and what its sum's scatter is, Jᵀ W R W J, with R the autocovariance of what is
/// left; both are equal where only white noise is left.
pub(super) struct Information {
    curvature: DMatrix<f64>,
    scatter: DMatrix<f64>,
}

impl Layout<'_> {
    pub(super) fn information(
        &self,
        at: &[f64],
        deviations: &[Deviations],
        kept: &mut [Option<Slopes>],
    ) -> Result<Information, IdentifyError> {
        let size = self.size();
        let logs: Vec<usize> = (0..self.experiments.len()).collect();
        let all = self.all_slopes(at, &logs, kept)?;
        let mut curvature = DMatrix::zeros(size, size);
        let mut scatter = DMatrix::zeros(size, size);
        for ((experiment, deviation), (prediction, slopes)) in
            self.experiments.iter().zip(deviations).zip(&all)
        {
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
                let errors = residuals(experiment, prediction, signal);
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
pub(super) fn covariance(information: &Information, prior: &DMatrix<f64>) -> DMatrix<f64> {
    let whole = &information.curvature + prior;
    let size = whole.nrows();
    let inverse = whole.cholesky().map_or_else(|| DMatrix::zeros(size, size), |c| c.inverse());
    &inverse * (&information.scatter + prior) * &inverse
}
