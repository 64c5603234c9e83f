//! Covariance of the estimates.
//!
//! Residuals are neither white nor independent between channels, because they are mostly model error. The
//! inverse of the information matrix, which assumes white noise, is then much too small. The covariance is
//! the sandwich of an M-estimator (Huber, The behavior of maximum likelihood estimates under nonstandard
//! conditions, Proc. 5th Berkeley Symp. 1, 1967, 221-233; White, Maximum likelihood estimation of
//! misspecified models, Econometrica 50, 1982, 1-25)
//!
//! ```text
//! D [Σ_i Σ_j J_iᵀ R(i − j) J_j] D,   D = (Σ_i J_iᵀ ψ'(e_i) J_i)⁻¹
//! ```
//!
//! with the residuals `e` and the Jacobian `J` of the prediction, both over the standard deviations, and
//! Huber's score function `ψ`. `R` is the covariance of the scores over lags and between all channels, estimated
//! consistently in `score_covariance.rs`.
//!
//! Fixed keys are not exact either. The covariance is that of the problem in which they are free as well,
//! with their priors. One Gauss-Newton step of that problem estimates the change of the free parameters if
//! they were freed. Its square, the bias of fixing them, is added to the variance (compare consider
//! parameters: Tapley, Schutz and Born, *Statistical Orbit Determination*, 2004, chapter 6).
//!
//! The square of the integration bias is added too: `D JᵀW` times the integration error is the bias of the parameters.

use super::information::Information;
use nalgebra::{DMatrix, DVector};

/// Uncertainty of the free parameters.
#[derive(Clone, Debug)]
pub(super) struct Uncertainty {
    /// Information of the logs.
    information: Information,
    /// Inverse prior variance 1/s² of each free parameter, then of each fixed key.
    prior_precision: Vec<f64>,
    /// Covariance with all priors.
    posterior: Covariance,
}

/// Covariance of the parameters, with the information matrix A, the score covariance S and the prior
/// precision P.
#[derive(Clone, Debug)]
struct Covariance {
    /// (A + P)⁻¹ (S + P) (A + P)⁻¹ of free parameters and fixed keys.
    sandwich: DMatrix<f64>,
    /// The same for the free parameters, with exact fixed keys.
    others_exact: DMatrix<f64>,
    /// (A + P)⁻¹ of the free parameters: the same for white residuals.
    white: DMatrix<f64>,
    /// Gauss-Newton step of the problem in which the fixed keys are free.
    newton_step: DVector<f64>,
    /// Change of the free parameters without integration error; zero for fixed keys.
    integration_bias: DVector<f64>,
}

/// Standard deviations of ln θ of a key from the logs without its prior, but with the priors of all others.
/// Infinite if the logs do not determine it.
#[derive(Clone, Copy, Debug)]
pub(super) struct FromLogs {
    /// With the uncertainty of the fixed keys.
    pub(super) deviation: f64,
    /// With exact fixed keys.
    pub(super) others_exact: f64,
    /// With exact fixed keys and white residuals.
    pub(super) white: f64,
}

impl Information {
    /// Covariance for a prior precision; none if the problem is singular.
    fn covariance(&self, prior_precision: &[f64]) -> Option<Covariance> {
        let prior = DMatrix::from_diagonal(&DVector::from_column_slice(prior_precision));
        let precision = &self.information_matrix + &prior;
        let size = (self.free_count, self.free_count);
        let white = precision.view((0, 0), size).into_owned().cholesky()?.inverse();
        let score_covariance = &self.score_covariance + &prior;
        let others_exact = &white * score_covariance.view((0, 0), size) * &white;
        let inverse = precision.cholesky()?.inverse();
        let sandwich = &inverse * score_covariance * &inverse;
        let integration_bias = &white * self.integration_gradient.rows(0, self.free_count);
        let integration_bias = integration_bias.resize_vertically(prior_precision.len(), 0.0);
        Some(Covariance {
            sandwich,
            others_exact,
            white,
            newton_step: inverse * &self.gradient,
            integration_bias,
        })
    }
}

impl Uncertainty {
    /// Uncertainty from the information of the logs and the prior standard deviations of the free parameters,
    /// then of the fixed keys.
    pub(super) fn new(information: Information, prior: impl Iterator<Item = f64>) -> Self {
        let prior_precision: Vec<f64> = prior.map(|s| 1.0 / (s * s)).collect();
        // without a covariance the uncertainty is infinite, not zero
        let open = |size: usize| DMatrix::from_diagonal_element(size, size, f64::INFINITY);
        let unknown = || Covariance {
            sandwich: open(prior_precision.len()),
            others_exact: open(information.free_count),
            white: open(information.free_count),
            newton_step: DVector::zeros(prior_precision.len()),
            integration_bias: DVector::zeros(prior_precision.len()),
        };
        let mut posterior = information.covariance(&prior_precision).unwrap_or_else(unknown);
        // a linear step is valid within the prior standard deviation at most
        for (step, precision) in posterior.newton_step.iter_mut().zip(&prior_precision) {
            let most = 1.0 / precision.sqrt();
            *step = if step.is_nan() { most } else { step.max(-most).min(most) };
        }
        Self { information, prior_precision, posterior }
    }

    /// Standard deviation of a free parameter, with the biases by fixed keys and integration.
    pub(super) fn deviation(&self, index: usize) -> f64 {
        let Covariance { newton_step, integration_bias, .. } = &self.posterior;
        self.sandwich_deviation(index).hypot(newton_step[index]).hypot(integration_bias[index])
    }

    /// Standard deviation of a free parameter without biases.
    fn sandwich_deviation(&self, index: usize) -> f64 {
        standard_deviation(self.posterior.sandwich[(index, index)])
    }

    /// Correlation matrix of the first `count` parameters.
    pub(super) fn correlation(&self, count: usize) -> Vec<Vec<f64>> {
        (0..count).map(|i| (0..count).map(|j| self.correlation_of(i, j)).collect()).collect()
    }

    /// Correlation of two parameters, without their biases.
    pub(super) fn correlation_of(&self, i: usize, j: usize) -> f64 {
        if i == j {
            return 1.0;
        }
        self.posterior.sandwich[(i, j)]
            / (self.sandwich_deviation(i) * self.sandwich_deviation(j)).max(1e-300)
    }

    /// Standard deviations of a free parameter without its own prior.
    pub(super) fn by_logs_alone(&self, index: usize) -> FromLogs {
        let mut prior_precision = self.prior_precision.clone();
        // nearly no prior, so that the matrix stays invertible if the logs do not determine the parameter
        prior_precision[index] *= 1e-9;
        let of = |of: &DMatrix<f64>| standard_deviation(of[(index, index)]);
        let found = self.information.covariance(&prior_precision).map(|c| FromLogs {
            deviation: of(&c.sandwich)
                .hypot(self.posterior.newton_step[index])
                .hypot(c.integration_bias[index]),
            others_exact: of(&c.others_exact),
            white: of(&c.white),
        });
        // beyond a thousand prior standard deviations the logs do not determine it
        let least = 1e3 / self.prior_precision[index].sqrt();
        let found = found.filter(|from_logs| from_logs.white < least);
        let infinite = f64::INFINITY;
        found.unwrap_or(FromLogs { deviation: infinite, others_exact: infinite, white: infinite })
    }

    /// Change of all free parameters for a unit change of one: their conditional mean given that one.
    pub(super) fn conditional_shift(&self, index: usize) -> Vec<f64> {
        let own = self.posterior.white[(index, index)].max(1e-300);
        self.posterior.white.column(index).iter().map(|c| c / own).collect()
    }
}

/// Root of a variance: zero if it is negative by rounding, infinite if it is not a number.
fn standard_deviation(variance: f64) -> f64 {
    if variance.is_nan() { f64::INFINITY } else { variance.max(0.0).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;
    /// A log determines its key to a thousandth, but integration moves it by a hundredth: the interval
    /// includes the hundredth.
    #[test]
    fn the_integration_bias_widens_the_interval() {
        let information = Information {
            information_matrix: DMatrix::from_element(1, 1, 1e6),
            score_covariance: DMatrix::from_element(1, 1, 1e6),
            gradient: DVector::zeros(1),
            integration_gradient: DVector::from_element(1, 1e4),
            free_count: 1,
        };
        let uncertainty = Uncertainty::new(information, [0.1].into_iter());
        for deviation in [uncertainty.deviation(0), uncertainty.by_logs_alone(0).deviation] {
            assert!((deviation - 1e-3_f64.hypot(1e-2)).abs() < 2e-4, "{deviation}");
        }
    }

    #[test]
    fn without_a_covariance_the_uncertainty_is_infinite() {
        let information = Information {
            information_matrix: DMatrix::from_element(1, 1, f64::NAN),
            score_covariance: DMatrix::zeros(1, 1),
            gradient: DVector::zeros(1),
            integration_gradient: DVector::zeros(1),
            free_count: 1,
        };
        let uncertainty = Uncertainty::new(information, [0.1].into_iter());
        assert_eq!(uncertainty.deviation(0), f64::INFINITY);
        assert_eq!(uncertainty.by_logs_alone(0).deviation, f64::INFINITY);
        assert_eq!(uncertainty.correlation(1), [[1.0]]);
    }
}
