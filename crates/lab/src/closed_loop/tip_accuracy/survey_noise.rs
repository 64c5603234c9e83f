//! Errors of the tip estimator that the noise of its survey alone causes.

use super::INSTANT;
use crate::closed_loop::monte_carlo::Percentiles;
use hydroboom_control::estimation::tip::{PARAMETERS, TipLoad};
use hydroboom_description::Description;
use hydroboom_design::tip_survey::SurveyFit;
use nalgebra::{Matrix3, Vector3};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;

/// Simulated surveys per crane, for the effect of the survey's noise.
const DRAWS: usize = 200;

const _: () = assert!(PARAMETERS == 3, "the matrices of a survey's noise are of three numbers");

/// Errors of the surveyed estimator that the noise of the survey alone causes.
#[derive(Clone, Debug, Serialize)]
pub struct NoiseFloor {
    /// Magnitude of the mean error \[mm\].
    pub bias_mm: Percentiles,
    /// RMS error about the mean \[mm\].
    pub rms_about_mm: Percentiles,
}

/// Sums of the derivatives of the height with respect to the fitted parameters along a course, and of their
/// products.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SlopeMoments {
    count: f64,
    sum: Vector3<f64>,
    products: Matrix3<f64>,
}

impl SlopeMoments {
    pub(super) fn add(&mut self, slopes: Vector3<f64>) {
        self.count += 1.0;
        self.sum += slopes;
        self.products += slopes * slopes.transpose();
    }

    /// Bias and RMS about it \[m\] for given errors of the fitted parameters.
    fn left_by(&self, errors: &Vector3<f64>) -> (f64, f64) {
        let bias = self.sum.dot(errors) / self.count;
        let square = errors.dot(&(self.products * errors)) / self.count;
        (bias, (square - bias * bias).max(0.0).sqrt())
    }

    /// The same for [`DRAWS`] surveys with noise of a given covariance.
    pub(super) fn left_by_noise(
        &self,
        noise: &Matrix3<f64>,
        random: &mut Pcg64Mcg,
    ) -> Vec<(f64, f64)> {
        // scaled, because the parameters have different magnitudes
        let scale = Vector3::from_fn(|i, _| noise[(i, i)].sqrt().max(f64::MIN_POSITIVE));
        let scaled = Matrix3::from_fn(|i, j| noise[(i, j)] / (scale[i] * scale[j]));
        let eigen = scaled.symmetric_eigen();
        let size = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
        let draw = |_| {
            let normal = Vector3::from_fn(|_, _| StandardNormal.sample(&mut *random));
            let errors = eigen.eigenvectors * size.component_mul(&normal);
            self.left_by(&errors.component_mul(&scale))
        };
        (0..DRAWS).map(draw).collect()
    }
}

impl NoiseFloor {
    pub(super) fn of(left: &[(f64, f64)]) -> Self {
        Self {
            bias_mm: Percentiles::of(left.iter().map(|(bias, _)| bias.abs() * 1e3)),
            rms_about_mm: Percentiles::of(left.iter().map(|(_, rms)| rms * 1e3)),
        }
    }

    /// Errors due to a survey's noise along the fast motion of a description with its payload.
    pub fn of_survey(fit: &SurveyFit, description: &Description, seed: u64) -> Self {
        let n = &description.numbers;
        let motion = description.motion(n.fast);
        let mut slopes = SlopeMoments::default();
        for k in 0..=(motion.duration() / INSTANT) as u32 {
            let piston = motion.reference(f64::from(k) * INSTANT).position;
            let load = TipLoad { piston, payload: n.payload, acceleration: 0.0 };
            slopes.add(Vector3::from(fit.estimator.slopes(&load).0[1]));
        }
        let noise = Matrix3::from_fn(|i, j| fit.noise[i][j]);
        Self::of(&slopes.left_by_noise(&noise, &mut Pcg64Mcg::seed_from_u64(seed)))
    }
}
