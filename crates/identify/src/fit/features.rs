//! Residuals of phase-independent features, and their global minimisation: the first stage of a fit.

use super::layout::Layout;
use super::least_squares::{LeastSquares, ResidualFunction};
use crate::oscillation_features::OscillationFeatures;
use crate::prediction::Prediction;
use cmaes::{CMAESOptions, DVector as Point};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Residuals of the features of all logs that have them.
pub(super) struct FeatureResiduals<'a> {
    pub(super) features: &'a [Option<OscillationFeatures>],
}

impl ResidualFunction for FeatureResiduals<'_> {
    fn residuals(&self, predictions: &[Prediction]) -> Vec<f64> {
        let pairs = self.features.iter().zip(predictions);
        pairs
            .flat_map(|(log_features, p)| {
                log_features.iter().flat_map(|log_features| log_features.residuals(p))
            })
            .collect()
    }

    fn jacobian(&self, layout: &Layout<'_>, parameters: &[f64]) -> Option<DMatrix<f64>> {
        let logs: Vec<usize> =
            (0..self.features.len()).filter(|log| self.features[*log].is_some()).collect();
        // initial values change much in this stage: their sensitivities are not cached
        let cached = &mut vec![None; self.features.len()];
        let all = layout.all_sensitivities(parameters, &logs, cached).ok()?;
        let mut whole = DMatrix::zeros(0, layout.size());
        for (log_features, (prediction, sensitivities)) in self.features.iter().flatten().zip(&all)
        {
            let (first, rows) = (whole.nrows(), log_features.residuals(prediction).len());
            whole = whole.resize_vertically(first + rows, 0.0);
            let columns: Vec<(usize, Vec<f64>)> = sensitivities
                .par_iter()
                .map(|(index, slope)| (*index, log_features.derivative(prediction, slope)))
                .collect();
            for (index, column) in columns {
                let column = DVector::from_vec(column);
                whole.view_mut((first, index), (rows, 1)).copy_from(&column);
            }
        }
        Some(whole)
    }
}

impl LeastSquares<'_, '_, FeatureResiduals<'_>> {
    /// The problem at the best parameter vector of a global search by CMA-ES (Hansen and Ostermeier,
    /// Completely derandomized self-adaptation in evolution strategies, Evol. Comput. 9, 2001, 159-195). It
    /// varies the keys within three prior standard deviations.
    pub(super) fn global_search(mut self, generations: usize) -> Self {
        if generations == 0 {
            return self;
        }
        let keys = self.layout.free.len();
        let initial = self.parameters.clone();
        let parameters_of = |x: &Point<f64>| {
            let mut parameters = initial.clone();
            for (k, x) in x.iter().enumerate() {
                parameters[k] += self.prior.deviation[k] * x.clamp(-3.0, 3.0);
            }
            self.layout.clamp_to_bounds(parameters.as_mut_slice());
            parameters
        };
        let cost = |x: &Point<f64>| {
            let parameters = parameters_of(x);
            self.residual_vector(&parameters)
                .and_then(|all| self.monitor.borrow_mut().record(all, &parameters))
                .map_or(f64::INFINITY, |all| all.norm_squared())
        };
        let search = CMAESOptions::new(vec![0.0; keys], 1.0).seed(1).build(cost);
        if let Ok(mut search) = search {
            for _ in 0..generations {
                if search.next().is_some() || self.monitor.borrow().is_stopped() {
                    break;
                }
            }
        }
        let best = self.monitor.borrow().best().map(DVector::from_column_slice);
        if let Some(best) = best {
            self.parameters = best;
        }
        self
    }
}
