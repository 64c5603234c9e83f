//! A search, watched: how far it has come, its best place so far, and its end when somebody wants it.

use nalgebra::DVector;
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

    /// The best place of this search; none where nothing was looked at.
    pub(super) fn best(&self) -> Option<&[f64]> {
        self.best.as_ref().map(|(_, at)| at.as_slice())
    }

    /// A place was looked at; none where the search is to end.
    pub(super) fn saw(&mut self, all: Vec<f64>, at: &DVector<f64>) -> Option<DVector<f64>> {
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
