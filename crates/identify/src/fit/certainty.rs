//! How sure the logs make it.

use super::layout::Layout;
use super::residual::{Deviations, Slopes, residuals};
use crate::error::IdentifyError;
use crate::experiment::COMPARED;
use nalgebra::{DMatrix, DVector};

/// Autocorrelations of what is left are taken into account up to this lag \[s\].
const MEMORY: f64 = 1.0;

/// Information of the logs on ln θ: Jᵀ W J, and what its sum's scatter is, Jᵀ W R W J, with R the autocovariance of what is
/// left; both are equal where only white noise is left.
#[derive(Clone, Debug)]
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

/// How sure it is what was moved.
#[derive(Clone, Debug)]
pub(super) struct Certainty {
    information: Information,
    /// What was known: 1/s² of each.
    known: Vec<f64>,
    /// With what was known.
    whole: Covariance,
}

/// How what was moved scatters.
#[derive(Clone, Debug)]
struct Covariance {
    /// (A + P)⁻¹ (S + P) (A + P)⁻¹: what the logs scatter and what was known, through the curvature of both.
    real: DMatrix<f64>,
    /// (A + P)⁻¹: the same if what is left were white noise.
    white: DMatrix<f64>,
}

/// What the logs alone say of one key, the others as well known as they were.
#[derive(Clone, Copy, Debug)]
pub(super) struct Alone {
    /// Deviation of ln θ; infinite where they say nothing.
    pub(super) deviation: f64,
    /// The same if what is left were white noise.
    pub(super) white: f64,
}

impl Information {
    /// None where neither logs nor what was known fix all that was moved.
    fn covariance(&self, known: &[f64]) -> Option<Covariance> {
        let prior = DMatrix::from_diagonal(&DVector::from_column_slice(known));
        let white = (&self.curvature + &prior).cholesky()?.inverse();
        let real = &white * (&self.scatter + &prior) * &white;
        Some(Covariance { real, white })
    }
}

impl Certainty {
    /// From the logs' information, and the deviations of what was known.
    pub(super) fn new(information: Information, known: &[f64]) -> Self {
        let known: Vec<f64> = known.iter().map(|s| 1.0 / (s * s)).collect();
        let size = known.len();
        let nothing =
            || Covariance { real: DMatrix::zeros(size, size), white: DMatrix::zeros(size, size) };
        let whole = information.covariance(&known).unwrap_or_else(nothing);
        Self { information, known, whole }
    }

    /// Deviation of one of those that were moved.
    pub(super) fn deviation(&self, place: usize) -> f64 {
        self.whole.real[(place, place)].max(0.0).sqrt()
    }

    /// Correlations of the first ones.
    pub(super) fn correlation(&self, count: usize) -> Vec<Vec<f64>> {
        (0..count).map(|i| (0..count).map(|j| self.correlation_of(i, j)).collect()).collect()
    }

    /// Correlation of two.
    pub(super) fn correlation_of(&self, i: usize, j: usize) -> f64 {
        self.whole.real[(i, j)] / (self.deviation(i) * self.deviation(j)).max(1e-300)
    }

    /// What the logs alone say of one of those that were moved.
    pub(super) fn alone(&self, place: usize) -> Alone {
        let mut known = self.known.clone();
        // as good as nothing: a matrix that is singular for this key alone has an inverse still
        known[place] *= 1e-9;
        let of = |of: &DMatrix<f64>| of[(place, place)].max(0.0).sqrt();
        let found = self.information.covariance(&known);
        let found = found.map(|c| Alone { deviation: of(&c.real), white: of(&c.white) });
        // less than a thousandth of what was known is nothing
        let least = 1e3 / self.known[place].sqrt();
        let found = found.filter(|alone| alone.white < least);
        found.unwrap_or(Alone { deviation: f64::INFINITY, white: f64::INFINITY })
    }

    /// How all the others go along when one is moved by one.
    pub(super) fn along(&self, place: usize) -> Vec<f64> {
        let own = self.whole.white[(place, place)].max(1e-300);
        self.whole.white.column(place).iter().map(|c| c / own).collect()
    }
}
