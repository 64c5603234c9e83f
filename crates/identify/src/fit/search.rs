//! A search for the least sum of squares, whatever it is of, by Levenberg and Marquardt's method.

use super::layout::Layout;
use super::watch::Watch;
use crate::prediction::{INITIAL_VALUES, Prediction};
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DMatrix, DVector, Dyn, storage::Owned};
use std::cell::{Cell, RefCell};

/// What of log and model is squared and added up.
pub(super) trait Sum {
    /// Its terms, in an order that does not depend on the place.
    fn terms(&self, predictions: &[Prediction]) -> Vec<f64>;

    /// The slopes of its terms along all that is moved, a row for each; none where the model breaks off.
    fn slopes(&self, layout: &Layout<'_>, at: &[f64]) -> Option<DMatrix<f64>>;
}

/// A search: a sum of log and model, and all that is moved against what is known of it.
pub(super) struct Search<'a, 'w, S> {
    pub(super) layout: Layout<'a>,
    pub(super) sum: S,
    /// What is known of all that is moved: mean and deviation.
    pub(super) known: &'a Known,
    pub(super) at: DVector<f64>,
    pub(super) watch: &'a RefCell<Watch<'w>>,
    /// How many terms there are, once they were looked at.
    count: Cell<usize>,
}

/// A term where the model breaks off, so that the search turns back: a thousand deviations.
const IMPOSSIBLE: f64 = 1e3;

/// What is known beforehand of all that is moved.
#[derive(Clone, Debug)]
pub(super) struct Known {
    /// Where the search would stay if the logs said nothing.
    pub(super) mean: Vec<f64>,
    /// Deviations from there.
    pub(super) deviation: Vec<f64>,
}

/// When a search ends: shares by which the sum, and what is moved, change no more; and how many runs of the model it
/// may take for each number that is moved.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ends {
    pub(super) sum: f64,
    pub(super) place: f64,
    pub(super) patience: usize,
}

impl<'a, 'w, S: Sum> Search<'a, 'w, S> {
    /// A search that begins at a place.
    pub(super) fn new(
        layout: Layout<'a>,
        sum: S,
        known: &'a Known,
        at: DVector<f64>,
        watch: &'a RefCell<Watch<'w>>,
    ) -> Self {
        Self { layout, sum, known, at, watch, count: Cell::new(0) }
    }

    /// All terms at a place; none where the model breaks off.
    pub(super) fn terms(&self, at: &DVector<f64>) -> Option<Vec<f64>> {
        let predicted = self.layout.predictions(at.as_slice()).ok()?;
        let mut all = self.sum.terms(&predicted);
        let Known { mean, deviation } = self.known;
        all.extend(at.iter().zip(mean).zip(deviation).map(|((z, z0), s)| (z - z0) / s));
        Some(all)
    }

    /// The search at its end, and whether nothing more was to be gained.
    pub(super) fn minimised(self, ends: Ends) -> (Self, bool) {
        // the method counts runs for each number that is moved; channels are as good as linear and cost none
        let (keys, all) = (self.layout.free.len() + INITIAL_VALUES, self.at.len());
        let method = LevenbergMarquardt::new()
            .with_ftol(ends.sum)
            .with_xtol(ends.place)
            .with_patience((ends.patience * keys).div_ceil(all).clamp(1, ends.patience));
        let (mut search, report) = method.minimize(self);
        // the last place that was looked at may be one that the search turned back from
        if let Some(best) = search.watch.borrow().best() {
            search.at = DVector::from_column_slice(best);
        }
        (search, report.termination.was_successful())
    }
}

impl<S: Sum> LeastSquaresProblem<f64, Dyn, Dyn> for Search<'_, '_, S> {
    type ParameterStorage = Owned<f64, Dyn>;
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;

    fn set_params(&mut self, x: &DVector<f64>) {
        self.at.copy_from(x);
        self.layout.within_bounds(self.at.as_mut_slice());
    }

    fn params(&self) -> DVector<f64> {
        self.at.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        let all = self.terms(&self.at).unwrap_or_else(|| vec![IMPOSSIBLE; self.count.get()]);
        self.count.set(all.len());
        self.watch.borrow_mut().saw(all, &self.at)
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let slopes = self.sum.slopes(&self.layout, self.at.as_slice())?;
        let (rows, size) = slopes.shape();
        let mut all = slopes.resize_vertically(rows + size, 0.0);
        for (k, s) in self.known.deviation.iter().enumerate() {
            all[(rows + k, k)] = 1.0 / s;
        }
        Some(all)
    }
}
