//! LU factorisation of small dense linear systems of fixed size, without and with partial pivoting.

use crate::Real;

/// LU factors of a square matrix, without pivoting.
///
/// For matrices whose pivots cannot vanish, such as `1 - h J` of a dissipative network. Without pivoting there is no
/// branch on a value, so it works for lanes and dual numbers.
#[derive(Clone, Copy, Debug)]
pub struct Factored<T, const M: usize> {
    /// U on and above the diagonal, the multipliers of L below it.
    entries: [[T; M]; M],
    /// Reciprocals of the pivots.
    inverse_pivots: [T; M],
}

impl<T: Real, const M: usize> Factored<T, M> {
    /// Factors `matrix`, given by rows. A zero pivot gives infinities or NaN.
    #[inline(always)]
    pub fn new(mut matrix: [[T; M]; M]) -> Self {
        let mut inverse_pivots = [T::zero(); M];
        for k in 0..M {
            inverse_pivots[k] = T::one() / matrix[k][k];
            for i in k + 1..M {
                let factor = matrix[i][k] * inverse_pivots[k];
                matrix[i][k] = factor;
                for j in k + 1..M {
                    matrix[i][j] = matrix[i][j] - factor * matrix[k][j];
                }
            }
        }
        Self { entries: matrix, inverse_pivots }
    }

    /// The solution of `matrix * x = rhs` for one right-hand side, which the argument holds. Not finite if a pivot was
    /// zero.
    #[inline(always)]
    pub fn solve(&self, mut x: [T; M]) -> [T; M] {
        for i in 1..M {
            for j in 0..i {
                x[i] = x[i] - self.entries[i][j] * x[j];
            }
        }
        for i in (0..M).rev() {
            for j in i + 1..M {
                x[i] = x[i] - self.entries[i][j] * x[j];
            }
            x[i] = x[i] * self.inverse_pivots[i];
        }
        x
    }
}

/// Solves the leading `count` equations of `matrix * x = rhs` in place, with partial pivoting.
///
/// For set-up code on plain numbers. The solution replaces `rhs`, and elimination overwrites `matrix`; `count` is at
/// most `M`. Returns `None` if a pivot is zero or not finite; both arguments are then partly eliminated.
pub fn solve_pivoted<const M: usize>(
    matrix: &mut [[f64; M]; M],
    rhs: &mut [f64; M],
    count: usize,
) -> Option<()> {
    for k in 0..count {
        let pivot =
            (k..count).max_by(|&a, &b| matrix[a][k].abs().total_cmp(&matrix[b][k].abs()))?;
        if !(matrix[pivot][k].abs() > 0.0 && matrix[pivot][k].is_finite()) {
            return None;
        }
        matrix.swap(k, pivot);
        rhs.swap(k, pivot);
        for i in k + 1..count {
            let factor = matrix[i][k] / matrix[k][k];
            for j in k..count {
                matrix[i][j] -= factor * matrix[k][j];
            }
            rhs[i] -= factor * rhs[k];
        }
    }
    for i in (0..count).rev() {
        for j in i + 1..count {
            rhs[i] -= matrix[i][j] * rhs[j];
        }
        rhs[i] /= matrix[i][i];
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Diagonally dominant, with a zero entry below the diagonal.
    const MATRIX: [[f64; 3]; 3] = [[4.0, -1.0, 0.5], [1.0, 3.0, -1.0], [0.0, 0.25, 2.0]];
    const X: [f64; 3] = [1.5, -2.0, 0.25];

    fn product(matrix: &[[f64; 3]; 3], x: [f64; 3]) -> [f64; 3] {
        core::array::from_fn(|i| (0..3).map(|j| matrix[i][j] * x[j]).sum())
    }

    #[test]
    fn factored_system_returns_the_vector_it_was_made_from() {
        let x = Factored::new(MATRIX).solve(product(&MATRIX, X));
        assert!(x.iter().zip(X).all(|(a, b)| (a - b).abs() < 1e-14), "{x:?}");
    }

    #[test]
    fn row_exchanges_solve_a_system_whose_first_pivot_is_zero() {
        let mut matrix = [MATRIX[2], MATRIX[0], MATRIX[1]];
        let mut x = product(&matrix, X);
        solve_pivoted(&mut matrix, &mut x, 3).unwrap();
        assert!(x.iter().zip(X).all(|(a, b)| (a - b).abs() < 1e-14), "{x:?}");
    }

    #[test]
    fn a_singular_system_is_refused() {
        let mut matrix = [[1.0, 2.0], [2.0, 4.0]];
        assert!(solve_pivoted(&mut matrix, &mut [1.0, 2.0], 2).is_none());
    }
}
