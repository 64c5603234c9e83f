//! Nonlinear least squares with a Gaussian prior by the Levenberg-Marquardt method (Levenberg, A method for
//! the solution of certain non-linear problems in least squares, Quart. Appl. Math. 2, 1944, 164-168;
//! Marquardt, An algorithm for least-squares estimation of nonlinear parameters, J. SIAM 11, 1963, 431-441).
//!
//! ```text
//! cost(z) = Σ r_i(z)² + Σ ((z_k − m_k)/s_k)²
//! ```
//!
//! with the residuals `r` of log and model, and the prior mean `m` and prior standard deviation `s` of each
//! parameter.

use super::layout::Layout;
use super::monitor::Monitor;
use crate::prediction::{INITIAL_VALUES, Prediction};
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DMatrix, DVector, Dyn, storage::Owned};
use std::cell::{Cell, RefCell};

/// Residuals of log and model as a function of the parameter vector.
pub(super) trait ResidualFunction {
    /// Scaled residuals for a prediction of each log, in an order that does not depend on the parameters.
    fn residuals(&self, predictions: &[Prediction]) -> Vec<f64>;

    /// Jacobian of the residuals: a row for each residual, a column for each parameter. None if a simulation
    /// fails.
    fn jacobian(&self, layout: &Layout<'_>, parameters: &[f64]) -> Option<DMatrix<f64>>;
}

/// Least-squares problem at a parameter vector.
pub(super) struct LeastSquares<'a, 'w, S> {
    pub(super) layout: Layout<'a>,
    pub(super) function: S,
    /// Prior of all parameters.
    pub(super) prior: &'a Prior,
    pub(super) parameters: DVector<f64>,
    pub(super) monitor: &'a RefCell<Monitor<'w>>,
    /// Length of the residual vector, zero before its first evaluation.
    residual_count: Cell<usize>,
}

/// Value of every residual where the simulation fails, in standard deviations \[-\]: so large that the step
/// is rejected.
const FAILED_RESIDUAL: f64 = 1e3;

/// Gaussian prior of the parameter vector, uncorrelated.
#[derive(Clone, Debug)]
pub(super) struct Prior {
    /// Prior mean of each parameter.
    pub(super) mean: Vec<f64>,
    /// Prior standard deviation of each parameter.
    pub(super) deviation: Vec<f64>,
}

/// Termination criteria.
#[derive(Clone, Copy, Debug)]
pub(super) struct Termination {
    /// Relative decrease of the cost below which the iteration has converged.
    pub(super) cost: f64,
    /// Relative step of the parameters below which the iteration has converged.
    pub(super) step: f64,
    /// Largest number of cost evaluations per parameter.
    pub(super) evaluations: usize,
}

impl<'a, 'w, S: ResidualFunction> LeastSquares<'a, 'w, S> {
    /// Problem with its initial parameter vector.
    pub(super) fn new(
        layout: Layout<'a>,
        function: S,
        prior: &'a Prior,
        parameters: DVector<f64>,
        monitor: &'a RefCell<Monitor<'w>>,
    ) -> Self {
        Self { layout, function, prior, parameters, monitor, residual_count: Cell::new(0) }
    }

    /// Residuals of log and model, then those of the prior; none if a simulation fails.
    pub(super) fn residual_vector(&self, parameters: &DVector<f64>) -> Option<Vec<f64>> {
        let predicted = self.layout.predictions(parameters.as_slice()).ok()?;
        let mut all = self.function.residuals(&predicted);
        let Prior { mean, deviation } = self.prior;
        all.extend(parameters.iter().zip(mean).zip(deviation).map(|((z, z0), s)| (z - z0) / s));
        Some(all)
    }

    /// The problem at the minimum of its cost, and whether the iteration has converged.
    pub(super) fn minimised(self, termination: Termination) -> (Self, bool) {
        // the solver's limit counts all parameters; residuals are nearly linear in those of the channels
        let (keys, all) = (self.layout.free.len() + INITIAL_VALUES, self.parameters.len());
        let solver = LevenbergMarquardt::new()
            .with_ftol(termination.cost)
            .with_xtol(termination.step)
            .with_patience(
                (termination.evaluations * keys).div_ceil(all).clamp(1, termination.evaluations),
            );
        let (mut solution, report) = solver.minimize(self);
        // the last evaluation may belong to a rejected step
        if let Some(best) = solution.monitor.borrow().best() {
            solution.parameters = DVector::from_column_slice(best);
        }
        (solution, report.termination.was_successful())
    }
}

impl<S: ResidualFunction> LeastSquaresProblem<f64, Dyn, Dyn> for LeastSquares<'_, '_, S> {
    type ParameterStorage = Owned<f64, Dyn>;
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;

    fn set_params(&mut self, x: &DVector<f64>) {
        self.parameters.copy_from(x);
        self.layout.clamp_to_bounds(self.parameters.as_mut_slice());
    }

    fn params(&self) -> DVector<f64> {
        self.parameters.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        let all = self
            .residual_vector(&self.parameters)
            .unwrap_or_else(|| vec![FAILED_RESIDUAL; self.residual_count.get()]);
        self.residual_count.set(all.len());
        self.monitor.borrow_mut().record(all, &self.parameters)
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let jacobian = self.function.jacobian(&self.layout, self.parameters.as_slice())?;
        let (rows, size) = jacobian.shape();
        let mut all = jacobian.resize_vertically(rows + size, 0.0);
        for (k, s) in self.prior.deviation.iter().enumerate() {
            all[(rows + k, k)] = 1.0 / s;
        }
        Some(all)
    }
}
