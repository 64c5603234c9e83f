//! Log and model, sample by sample.

use super::layout::Layout;
use super::residual::{Deviations, Slopes, huber, residuals};
use super::search::Sum;
use crate::experiment::Experiment;
use crate::prediction::Prediction;
use nalgebra::DMatrix;
use std::cell::RefCell;

/// Each difference against its deviation, those far out drawn in.
pub(super) struct Samples<'a> {
    pub(super) experiments: &'a [Experiment],
    pub(super) deviations: &'a [Deviations],
    /// Slopes along the starts of each log, once they are known.
    pub(super) kept: RefCell<Vec<Option<Slopes>>>,
}

impl<'a> Samples<'a> {
    pub(super) fn new(experiments: &'a [Experiment], deviations: &'a [Deviations]) -> Self {
        Self { experiments, deviations, kept: RefCell::new(vec![None; experiments.len()]) }
    }

    /// Each log's place, with the deviations of its signals.
    fn logs(&self) -> impl Iterator<Item = (&'a Experiment, &'a Deviations)> {
        self.experiments.iter().zip(self.deviations)
    }
}

impl Sum for Samples<'_> {
    fn terms(&self, predictions: &[Prediction]) -> Vec<f64> {
        let mut all = Vec::new();
        for ((experiment, deviation), prediction) in self.logs().zip(predictions) {
            for (signal, sigma) in deviation.iter().enumerate() {
                let errors = residuals(experiment, prediction, signal);
                all.extend(errors.iter().map(|(_, e)| huber(e / sigma).0));
            }
        }
        all
    }

    fn slopes(&self, layout: &Layout<'_>, at: &[f64]) -> Option<DMatrix<f64>> {
        let logs: Vec<usize> = (0..self.experiments.len()).collect();
        let all = layout.all_slopes(at, &logs, &mut self.kept.borrow_mut()).ok()?;
        let mut rows: Vec<(usize, usize, usize, f64)> = Vec::new();
        for (log, ((experiment, deviation), (prediction, _))) in self.logs().zip(&all).enumerate() {
            for (signal, sigma) in deviation.iter().enumerate() {
                let errors = residuals(experiment, prediction, signal);
                let row =
                    |(sample, e): (usize, f64)| (log, sample, signal, -huber(e / sigma).1 / sigma);
                rows.extend(errors.into_iter().map(row));
            }
        }
        let mut jacobian = DMatrix::zeros(rows.len(), layout.size());
        for (log, (_, slopes)) in all.iter().enumerate() {
            let from = rows.partition_point(|row| row.0 < log);
            let to = rows.partition_point(|row| row.0 <= log);
            for (place, slope) in slopes {
                let mut column = jacobian.column_mut(*place);
                for (k, (_, sample, signal, factor)) in rows[from..to].iter().enumerate() {
                    column[from + k] = factor * slope[*sample][*signal];
                }
            }
        }
        Some(jacobian)
    }
}
