//! Monitor of an iteration: number of cost evaluations, best parameter vector, and stop on request.

use nalgebra::DVector;
use std::cell::RefCell;

/// Progress of a fit, after each cost evaluation.
#[derive(Clone, Debug)]
pub struct Progress<'a> {
    /// Number of cost evaluations since the start.
    pub runs: usize,
    /// Cost of the newest evaluation: sum of the squared residuals, each divided by its standard deviation \[-\].
    pub cost: f64,
    /// Parameter vector of least cost in this iteration, from which a fit can be resumed.
    pub best: &'a [f64],
}

/// Counts evaluations, keeps the best parameter vector, and stops the iteration on request.
pub(super) struct Monitor<'a> {
    runs: usize,
    best: Option<(f64, Vec<f64>)>,
    is_stopped: bool,
    go_on: &'a dyn Fn(&Progress<'_>) -> bool,
}

impl<'a> Monitor<'a> {
    /// Monitor before the first evaluation. `go_on` is called after each one; the iteration stops if it
    /// returns false.
    pub(super) fn new(go_on: &'a dyn Fn(&Progress<'_>) -> bool) -> RefCell<Self> {
        RefCell::new(Self { runs: 0, best: None, is_stopped: false, go_on })
    }

    /// Number of cost evaluations.
    pub(super) fn runs(&self) -> usize {
        self.runs
    }

    /// Whether a stop was requested.
    pub(super) fn is_stopped(&self) -> bool {
        self.is_stopped
    }

    /// Forgets the best parameter vector: the cost of the next iteration has other weights.
    pub(super) fn restart(&mut self) {
        self.best = None;
    }

    /// Parameter vector of least cost in this iteration; none before its first evaluation.
    pub(super) fn best(&self) -> Option<&[f64]> {
        self.best.as_ref().map(|(_, parameters)| parameters.as_slice())
    }

    /// Records an evaluation and returns its residuals; none if the iteration is to stop.
    pub(super) fn record(
        &mut self,
        residuals: Vec<f64>,
        parameters: &DVector<f64>,
    ) -> Option<DVector<f64>> {
        self.runs += 1;
        let cost = residuals.iter().map(|r| r * r).sum();
        if self.best.as_ref().is_none_or(|(least, _)| cost < *least) {
            self.best = Some((cost, parameters.as_slice().to_vec()));
        }
        let best = self.best.as_ref().map_or(&[][..], |(_, parameters)| parameters);
        self.is_stopped |= !(self.go_on)(&Progress { runs: self.runs, cost, best });
        (!self.is_stopped).then(|| DVector::from_vec(residuals))
    }
}
