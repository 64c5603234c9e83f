//! Box-constrained quadratic program, by a projected gradient with momentum: what a predictive controller solves every period.

use nalgebra::{DMatrix, DVector};

/// `½ uᵀHu + fᵀu`, H constant and positive definite.
pub(super) struct BoxQp {
    hessian: DMatrix<f64>,
    /// Largest and least curvature.
    steepest: f64,
    gentlest: f64,
}

impl BoxQp {
    pub(super) fn new(hessian: DMatrix<f64>) -> Self {
        let curvatures = hessian.clone().symmetric_eigenvalues();
        let (gentlest, steepest) = (curvatures.min(), curvatures.max());
        Self { hessian, steepest, gentlest }
    }

    /// The least within ± `limit`, from a guess: steps against the slope, with momentum, each back into the box. `steps` of them are done,
    /// each leaving at most `1 − √(least/largest curvature)` of what was lacking.
    pub(super) fn least(
        &self,
        slope: &DVector<f64>,
        guess: &mut DVector<f64>,
        limit: f64,
        steps: u32,
    ) {
        let root = (self.gentlest / self.steepest).sqrt();
        let momentum = (1.0 - root) / (1.0 + root);
        let mut before = guess.clone();
        for _ in 0..steps {
            let ahead = &*guess + (&*guess - &before) * momentum;
            let mut next = &ahead - (&self.hessian * &ahead + slope) / self.steepest;
            next.iter_mut().for_each(|u| *u = u.clamp(-limit, limit));
            before = std::mem::replace(guess, next);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Within the box the slope is none, at an edge it points out of it.
    #[test]
    fn the_least_meets_the_conditions_of_karush_kuhn_and_tucker() {
        let root = DMatrix::from_fn(6, 6, |i, j| ((3 * i + 5 * j) as f64).sin());
        let hessian = &root.transpose() * &root + DMatrix::identity(6, 6) * 0.3;
        let slope = DVector::from_fn(6, |i, _| 4.0 * (i as f64).cos());
        let program = BoxQp::new(hessian.clone());
        let mut found = DVector::zeros(6);
        program.least(&slope, &mut found, 1.0, 2000);
        let left = &hessian * &found + &slope;
        let mut edges = 0;
        for (u, g) in found.iter().zip(left.iter()) {
            if u.abs() < 1.0 {
                assert!(g.abs() < 1e-9, "{u}: {g}");
            } else {
                assert!(u * g < 0.0, "{u}: {g}");
                edges += 1;
            }
        }
        assert!((1..6).contains(&edges), "{edges} at an edge");
    }
}
