//! The searches: Levenberg and Marquardt's method over samples, and over the pitch before that.

use super::layout::Layout;
use super::residual::{Deviations, Slopes, huber, residuals};
use crate::free::Free;
use crate::prediction::Prediction;
use crate::tuning_fork::TuningFork;
use cmaes::{CMAESOptions, DVector as Point};
use levenberg_marquardt::LeastSquaresProblem;
use nalgebra::{DMatrix, DVector, Dyn, storage::Owned};
use std::cell::RefCell;

/// How far a search has come.
#[derive(Clone, Debug)]
pub struct Progress<'a> {
    /// How often the model was run.
    pub runs: usize,
    /// The sum that is minimised.
    pub sum: f64,
    /// Where it was least in this search: what is moved, to begin from again.
    pub best: &'a [f64],
}

/// Counts runs, keeps the best place of a search, and ends it when told to.
pub(super) struct Watch<'a> {
    runs: usize,
    best: Option<(f64, Vec<f64>)>,
    is_stopped: bool,
    go_on: &'a dyn Fn(&Progress<'_>) -> bool,
}

impl<'a> Watch<'a> {
    /// Nothing done yet; `go_on` is told of each run and says whether to.
    pub(super) fn new(go_on: &'a dyn Fn(&Progress<'_>) -> bool) -> RefCell<Self> {
        RefCell::new(Self { runs: 0, best: None, is_stopped: false, go_on })
    }

    /// How often the model was run.
    pub(super) fn runs(&self) -> usize {
        self.runs
    }

    /// Whether the search was told to end.
    pub(super) fn is_stopped(&self) -> bool {
        self.is_stopped
    }

    /// A new search begins: sums of the last one mean something else.
    pub(super) fn begin(&mut self) {
        self.best = None;
    }

    /// A place was looked at; none where the search is to end.
    fn saw(&mut self, all: Vec<f64>, at: &DVector<f64>) -> Option<DVector<f64>> {
        self.runs += 1;
        let sum = all.iter().map(|r| r * r).sum();
        if self.best.as_ref().is_none_or(|(least, _)| sum < *least) {
            self.best = Some((sum, at.as_slice().to_vec()));
        }
        let best = self.best.as_ref().map_or(&[][..], |(_, at)| at);
        self.is_stopped |= !(self.go_on)(&Progress { runs: self.runs, sum, best });
        (!self.is_stopped).then(|| DVector::from_vec(all))
    }
}

/// The search over samples: each difference against its deviation, and each key against what was known.
pub(super) struct Problem<'a, 'w> {
    pub(super) layout: Layout<'a>,
    pub(super) begin: &'a [f64],
    pub(super) priors: &'a [f64],
    pub(super) deviations: &'a [Deviations],
    pub(super) at: DVector<f64>,
    /// Slopes along the starts of each log, once they are known.
    pub(super) kept: RefCell<Vec<Option<Slopes>>>,
    pub(super) watch: &'a RefCell<Watch<'w>>,
}

impl Problem<'_, '_> {
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

impl LeastSquaresProblem<f64, Dyn, Dyn> for Problem<'_, '_> {
    type ParameterStorage = Owned<f64, Dyn>;
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;

    fn set_params(&mut self, x: &DVector<f64>) {
        self.at.copy_from(x);
        within_bounds(&mut self.at, self.layout.free);
    }

    fn params(&self) -> DVector<f64> {
        self.at.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        // where the model breaks off the search turns back
        let predicted = self.layout.predictions(self.at.as_slice()).ok()?;
        let all = self.stacked(&predicted);
        self.watch.borrow_mut().saw(all, &self.at)
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let size = self.layout.size();
        let mut rows: Vec<Vec<f64>> = Vec::new();
        let logs: Vec<usize> = (0..self.layout.experiments.len()).collect();
        let kept = &mut self.kept.borrow_mut();
        let all = self.layout.all_slopes(self.at.as_slice(), &logs, kept).ok()?;
        for ((experiment, deviation), (prediction, slopes)) in
            self.layout.experiments.iter().zip(self.deviations).zip(&all)
        {
            for (signal, sigma) in deviation.iter().enumerate() {
                for (i, e) in residuals(experiment, prediction, signal) {
                    let drawn = huber(e / sigma).1;
                    let mut row = vec![0.0; size];
                    for (place, slope) in slopes {
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

/// The search for the pitch: slow courses, frequencies and dampings, and each key against what was known.
pub(super) struct Pitch<'a, 'w> {
    pub(super) layout: Layout<'a>,
    pub(super) begin: &'a [f64],
    pub(super) priors: &'a [f64],
    pub(super) forks: &'a [Option<TuningFork>],
    pub(super) at: DVector<f64>,
    pub(super) watch: &'a RefCell<Watch<'w>>,
}

impl Pitch<'_, '_> {
    /// The same at the best place of a global search over the keys, each up to three deviations away.
    pub(super) fn searched(mut self, generations: usize) -> Self {
        if generations == 0 {
            return self;
        }
        let keys = self.layout.free.len();
        let from = self.at.clone();
        let place = |x: &Point<f64>| {
            let mut at = from.clone();
            for (k, x) in x.iter().enumerate() {
                at[k] += self.priors[k] * x.clamp(-3.0, 3.0);
            }
            within_bounds(&mut at, self.layout.free);
            at
        };
        let sum = |x: &Point<f64>| {
            let at = place(x);
            self.stacked(&at)
                .and_then(|all| self.watch.borrow_mut().saw(all, &at))
                .map_or(f64::INFINITY, |all| all.norm_squared())
        };
        let search = CMAESOptions::new(vec![0.0; keys], 1.0).seed(1).build(sum);
        if let Ok(mut search) = search {
            for _ in 0..generations {
                if search.next().is_some() || self.watch.borrow().is_stopped() {
                    break;
                }
            }
        }
        let best = self.watch.borrow().best.as_ref().map(|(_, at)| at.clone());
        if let Some(best) = best {
            self.at = DVector::from_vec(best);
        }
        self
    }

    /// All residuals at a place; none where the model breaks off.
    fn stacked(&self, at: &DVector<f64>) -> Option<Vec<f64>> {
        let predicted = self.layout.predictions(at.as_slice()).ok()?;
        let mut all = Vec::new();
        for (fork, prediction) in self.forks.iter().zip(&predicted) {
            all.extend(fork.iter().flat_map(|fork| fork.residuals(prediction)));
        }
        all.extend(at.iter().zip(self.begin).zip(self.priors).map(|((z, z0), s)| (z - z0) / s));
        Some(all)
    }
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Pitch<'_, '_> {
    type ParameterStorage = Owned<f64, Dyn>;
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;

    fn set_params(&mut self, x: &DVector<f64>) {
        self.at.copy_from(x);
        within_bounds(&mut self.at, self.layout.free);
    }

    fn params(&self) -> DVector<f64> {
        self.at.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        let all = self.stacked(&self.at)?;
        self.watch.borrow_mut().saw(all, &self.at)
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let size = self.layout.size();
        let mut columns: Vec<DMatrix<f64>> = Vec::new();
        let logs: Vec<usize> =
            (0..self.forks.len()).filter(|log| self.forks[*log].is_some()).collect();
        // where a start is moved from changes much in this search: its slopes are taken anew
        let kept = &mut vec![None; self.layout.experiments.len()];
        let all = self.layout.all_slopes(self.at.as_slice(), &logs, kept).ok()?;
        for (fork, (prediction, slopes)) in self.forks.iter().flatten().zip(&all) {
            let rows = fork.residuals(prediction).len();
            let mut part = DMatrix::zeros(rows, size);
            for (place, slope) in slopes {
                let column = fork.slopes(prediction, slope);
                part.set_column(*place, &DVector::from_vec(column));
            }
            columns.push(part);
        }
        columns.push(DMatrix::from_fn(
            size,
            size,
            |i, j| {
                if i == j { 1.0 / self.priors[i] } else { 0.0 }
            },
        ));
        let rows = columns.iter().map(DMatrix::nrows).sum();
        let mut whole = DMatrix::zeros(rows, size);
        let mut from = 0;
        for part in columns {
            whole.rows_mut(from, part.nrows()).copy_from(&part);
            from += part.nrows();
        }
        Some(whole)
    }
}

/// Keeps keys within what a crane file allows.
fn within_bounds(at: &mut DVector<f64>, free: &[Free]) {
    for (z, key) in at.iter_mut().zip(free) {
        let (low, high) = key.bounds();
        *z = z.clamp(low.max(1e-300).ln(), high.ln());
    }
}
