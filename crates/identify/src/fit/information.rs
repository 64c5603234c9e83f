//! Information matrix and score of the logs at the minimum, for free parameters and fixed keys.
//!
//! The scheme of integration is of second order, so halving the step shows three quarters of the integration error
//! (Richardson, The approximate arithmetical solution by finite differences of physical problems involving
//! differential equations, Phil. Trans. R. Soc. A 210, 1911, 307-357).

use super::Task;
use super::layout::Layout;
use super::least_squares::Prior;
use super::residual::{Deviations, Sensitivities};
use super::score_covariance::{LogResiduals, small_sample_factor};
use crate::error::IdentifyError;
use crate::experiment::Experiment;
use crate::free::Free;
use nalgebra::{DMatrix, DVector};

/// Information matrix and score of all logs at the minimum, for the free parameters and then the fixed keys.
#[derive(Clone, Debug)]
pub(super) struct Information {
    /// Jᵀ W J, without the prior.
    pub(super) information_matrix: DMatrix<f64>,
    /// Covariance of the score Jᵀ W (log − model).
    pub(super) score_covariance: DMatrix<f64>,
    /// Negative gradient of half the cost, prior included.
    pub(super) gradient: DVector<f64>,
    /// Jᵀ W (model without integration error − model).
    pub(super) integration_gradient: DVector<f64>,
    /// Number of free parameters.
    pub(super) free_count: usize,
}

/// Fixed keys with an effect on a log.
pub(super) struct FixedKeys {
    /// The keys.
    pub(super) keys: Vec<Free>,
    /// Their prior standard deviations of ln θ.
    pub(super) deviation: Vec<f64>,
}

impl FixedKeys {
    /// Fixed keys of a task.
    pub(super) fn of(task: &Task<'_>) -> Self {
        let all = Free::usual(task.model).into_iter().chain(Free::replaceable(task.model));
        let keys: Vec<Free> = all.filter(|key| !task.free.contains(key)).collect();
        let deviation = keys.iter().map(|key| key.fixed_prior_deviation(task.model)).collect();
        Self { keys, deviation }
    }
}

/// Error of a second-order scheme over the change by halving its step \[-\].
const RICHARDSON: f64 = 4.0 / 3.0;

impl Layout<'_> {
    /// Information of all logs at a parameter vector. Sensitivities to fixed keys are computed with long
    /// integration steps, because they only widen the intervals.
    ///
    /// # Errors
    ///
    /// [`IdentifyError`] if a simulation fails.
    pub(super) fn information(
        &self,
        parameters: &[f64],
        deviations: &[Deviations],
        cached: &mut [Option<Sensitivities>],
        prior: &Prior,
        fixed_keys: &[Free],
    ) -> Result<Information, IdentifyError> {
        let (free_count, size) = (self.size(), self.size() + fixed_keys.len());
        let logs: Vec<usize> = (0..self.experiments.len()).collect();
        let mut all = self.all_sensitivities(parameters, &logs, cached)?;
        let mut information_matrix = DMatrix::zeros(size, size);
        let mut score_covariance = DMatrix::zeros(size, size);
        let mut gradient = DVector::zeros(size);
        let mut integration_gradient = DVector::zeros(size);
        let with_steps = |of: fn(&Experiment) -> Experiment| -> Vec<Experiment> {
            self.experiments.iter().map(of).collect()
        };
        let finer = with_steps(Experiment::fine);
        let finer = Layout { experiments: &finer, ..*self }.predictions(parameters)?;
        let rough = with_steps(Experiment::rough);
        let rough = Layout { experiments: &rough, ..*self };
        let mut count = 0;
        let logs = self.experiments.iter().zip(deviations).zip(&mut all).zip(&finer).enumerate();
        for (log, (((experiment, deviation), (prediction, sensitivities)), finer)) in logs {
            let of_keys = rough.key_sensitivities(parameters, log, fixed_keys)?;
            sensitivities.extend(of_keys.into_iter().map(|(k, slope)| (free_count + k, slope)));
            let log_residuals = LogResiduals::new(experiment, deviation, prediction, sensitivities);
            count += log_residuals.count();
            let (own_information, own_score_covariance, own_gradient) = (
                log_residuals.information_matrix(),
                log_residuals.score_covariance(),
                log_residuals.gradient(),
            );
            let own_integration_gradient =
                log_residuals.projected_difference(deviation, prediction, finer);
            for (i, (row, _)) in sensitivities.iter().enumerate() {
                gradient[*row] += own_gradient[i];
                integration_gradient[*row] += RICHARDSON * own_integration_gradient[i];
                for (j, (column, _)) in sensitivities.iter().enumerate() {
                    information_matrix[(*row, *column)] += own_information[(i, j)];
                    score_covariance[(*row, *column)] += own_score_covariance[(i, j)];
                }
            }
        }
        score_covariance *= small_sample_factor(count, free_count);
        for (k, ((z, mean), s)) in
            parameters.iter().zip(&prior.mean).zip(&prior.deviation).enumerate()
        {
            gradient[k] -= (z - mean) / (s * s);
        }
        Ok(Information {
            information_matrix,
            score_covariance,
            gradient,
            integration_gradient,
            free_count,
        })
    }
}
