//! The pitch: slow courses, frequencies and dampings, of which none has a phase.

use super::layout::Layout;
use super::search::{Search, Sum};
use crate::oscillation_features::OscillationFeatures;
use crate::prediction::Prediction;
use cmaes::{CMAESOptions, DVector as Point};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// The pitch of each log that log and model differ in.
pub(super) struct Pitch<'a> {
    pub(super) forks: &'a [Option<OscillationFeatures>],
}

impl Sum for Pitch<'_> {
    fn terms(&self, predictions: &[Prediction]) -> Vec<f64> {
        let pairs = self.forks.iter().zip(predictions);
        pairs.flat_map(|(fork, p)| fork.iter().flat_map(|fork| fork.residuals(p))).collect()
    }

    fn slopes(&self, layout: &Layout<'_>, at: &[f64]) -> Option<DMatrix<f64>> {
        let logs: Vec<usize> =
            (0..self.forks.len()).filter(|log| self.forks[*log].is_some()).collect();
        // where a start is moved from changes much in this search: its slopes are taken anew
        let kept = &mut vec![None; self.forks.len()];
        let all = layout.all_slopes(at, &logs, kept).ok()?;
        let mut whole = DMatrix::zeros(0, layout.size());
        for (fork, (prediction, slopes)) in self.forks.iter().flatten().zip(&all) {
            let (from, rows) = (whole.nrows(), fork.residuals(prediction).len());
            whole = whole.resize_vertically(from + rows, 0.0);
            let columns: Vec<(usize, Vec<f64>)> = slopes
                .par_iter()
                .map(|(place, slope)| (*place, fork.derivative(prediction, slope)))
                .collect();
            for (place, column) in columns {
                let column = DVector::from_vec(column);
                whole.view_mut((from, place), (rows, 1)).copy_from(&column);
            }
        }
        Some(whole)
    }
}

impl Search<'_, '_, Pitch<'_>> {
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
                at[k] += self.known.deviation[k] * x.clamp(-3.0, 3.0);
            }
            self.layout.within_bounds(at.as_mut_slice());
            at
        };
        let sum = |x: &Point<f64>| {
            let at = place(x);
            self.terms(&at)
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
        let best = self.watch.borrow().best().map(DVector::from_column_slice);
        if let Some(best) = best {
            self.at = best;
        }
        self
    }
}
