//! Discrete algebraic Riccati equation: optimal state feedback, and optimal observer gain.

use nalgebra::SMatrix;

/// Cost-to-go P of `z(k+1) = A z + B u` with costs `zᵀQz + uᵀRu`, and the gain K of the optimal feedback `u
/// = −K z`.
///
/// Riccati recursion from P = Q until the relative change is below 1e-12; none if it does not converge.
pub(super) fn least_cost<const N: usize, const M: usize>(
    a: &SMatrix<f64, N, N>,
    b: &SMatrix<f64, N, M>,
    q: &SMatrix<f64, N, N>,
    r: &SMatrix<f64, M, M>,
) -> Option<(SMatrix<f64, N, N>, SMatrix<f64, M, N>)> {
    let mut p = *q;
    for _ in 0..200_000 {
        let gain = (r + b.transpose() * p * b).try_inverse()? * b.transpose() * p * a;
        let next = q + a.transpose() * p * (a - b * gain);
        // rounding breaks the symmetry and the asymmetry grows
        let next = (next + next.transpose()) * 0.5;
        let change = (next - p).norm();
        p = next;
        if change <= 1e-12 * p.norm() {
            return p.iter().all(|v| v.is_finite()).then_some((p, gain));
        }
    }
    None
}

/// Steady-state Kalman gain L for the output `y = C z` with covariances Q of process noise and R of
/// measurement noise.
pub(super) fn least_variance<const N: usize, const M: usize>(
    a: &SMatrix<f64, N, N>,
    c: &SMatrix<f64, M, N>,
    q: &SMatrix<f64, N, N>,
    r: &SMatrix<f64, M, M>,
) -> Option<SMatrix<f64, N, M>> {
    // dual problem: the same equation with transposed matrices
    let (p, _) = least_cost(&a.transpose(), &c.transpose(), q, r)?;
    Some(p * c.transpose() * (c * p * c.transpose() + r).try_inverse()?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{matrix, vector};

    #[test]
    fn the_riccati_solution_of_an_integrator_is_the_golden_ratio() {
        let one = matrix![1.0];
        let (p, gain) = least_cost(&one, &one, &one, &one).unwrap();
        let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
        assert!(
            (p[0] - golden).abs() < 1e-9 && (gain[0] - 1.0 / golden).abs() < 1e-9,
            "{p} {gain}"
        );
    }

    #[test]
    fn no_other_feedback_costs_less() {
        let (a, b) = (matrix![1.0, 0.1; -0.3, 0.98], vector![0.0, 0.1]);
        let (q, r) = (matrix![1.0, 0.0; 0.0, 0.1], matrix![0.5]);
        let (p, gain) = least_cost(&a, &b, &q, &r).unwrap();
        let begin = vector![1.0, -0.5];
        let cost = |gain: &SMatrix<f64, 1, 2>| {
            let (mut z, mut sum) = (begin, 0.0);
            for _ in 0..5000 {
                let u = -gain * z;
                sum += (z.transpose() * q * z)[0] + (u.transpose() * r * u)[0];
                z = a * z + b * u;
            }
            sum
        };
        let least = cost(&gain);
        assert!((least / (begin.transpose() * p * begin)[0] - 1.0).abs() < 1e-9);
        for change in [matrix![0.1, 0.0], matrix![-0.1, 0.0], matrix![0.0, 0.1], matrix![0.0, -0.1]]
        {
            assert!(cost(&(gain + change)) > least);
        }
    }
}
