//! Residuals of log and model at each sample.

use super::layout::Layout;
use super::least_squares::ResidualFunction;
use super::residual::{Deviations, Sensitivities, residuals, root_huber_loss};
use crate::experiment::Experiment;
use crate::prediction::Prediction;
use nalgebra::DMatrix;
use std::cell::RefCell;

/// Residuals of all logs, signals and samples over their standard deviations, with Huber's loss.
pub(super) struct SampleResiduals<'a> {
    pub(super) experiments: &'a [Experiment],
    pub(super) deviations: &'a [Deviations],
    /// Sensitivities of each log to its initial values, computed once: they change little during the
    /// iteration.
    pub(super) cached: RefCell<Vec<Option<Sensitivities>>>,
}

impl<'a> SampleResiduals<'a> {
    pub(super) fn new(experiments: &'a [Experiment], deviations: &'a [Deviations]) -> Self {
        Self { experiments, deviations, cached: RefCell::new(vec![None; experiments.len()]) }
    }

    /// Each log with the standard deviations of its signals.
    fn logs(&self) -> impl Iterator<Item = (&'a Experiment, &'a Deviations)> {
        self.experiments.iter().zip(self.deviations)
    }
}

impl ResidualFunction for SampleResiduals<'_> {
    fn residuals(&self, predictions: &[Prediction]) -> Vec<f64> {
        let mut all = Vec::new();
        for ((experiment, deviation), prediction) in self.logs().zip(predictions) {
            for (signal, sigma) in deviation.iter().enumerate() {
                let errors = residuals(experiment, prediction, signal);
                all.extend(errors.iter().map(|(_, e)| root_huber_loss(e / sigma).0));
            }
        }
        all
    }

    fn jacobian(&self, layout: &Layout<'_>, parameters: &[f64]) -> Option<DMatrix<f64>> {
        let logs: Vec<usize> = (0..self.experiments.len()).collect();
        let all =
            layout.all_sensitivities(parameters, &logs, &mut self.cached.borrow_mut()).ok()?;
        let mut rows: Vec<(usize, usize, usize, f64)> = Vec::new();
        for (log, ((experiment, deviation), (prediction, _))) in self.logs().zip(&all).enumerate() {
            for (signal, sigma) in deviation.iter().enumerate() {
                let errors = residuals(experiment, prediction, signal);
                let row = |(sample, e): (usize, f64)| {
                    (log, sample, signal, -root_huber_loss(e / sigma).1 / sigma)
                };
                rows.extend(errors.into_iter().map(row));
            }
        }
        let mut jacobian = DMatrix::zeros(rows.len(), layout.size());
        for (log, (_, sensitivities)) in all.iter().enumerate() {
            let from = rows.partition_point(|row| row.0 < log);
            let to = rows.partition_point(|row| row.0 <= log);
            for (parameter, slope) in sensitivities {
                let mut column = jacobian.column_mut(*parameter);
                for (k, (_, sample, signal, factor)) in rows[from..to].iter().enumerate() {
                    column[from + k] = factor * slope[*sample][*signal];
                }
            }
        }
        Some(jacobian)
    }
}
