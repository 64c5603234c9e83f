//! Frequency response of a linear system by its Hessenberg form.
//!
//! ```text
//! C (s − A)⁻¹ B = C' (s − H)⁻¹ B',   A = S Q H Qᵀ S⁻¹
//! ```
//!
//! S balances the matrix, Q makes it an upper Hessenberg one, once; a frequency then costs n² operations in place of
//! n³. Source: A. J. Laub, Efficient multivariable frequency response computations, IEEE Transactions on Automatic
//! Control 26(2), 1981, doi:10.1109/TAC.1981.1102656.

use crate::linear::balanced;
use nalgebra::{Complex, DMatrix, DVector};

/// A system in continuous time, or a sampled one.
#[derive(Clone, Debug)]
pub(crate) struct FrequencyResponse {
    /// H.
    hessenberg: DMatrix<f64>,
    /// B', a column for each input.
    inputs: DMatrix<f64>,
    /// Rows of C'.
    outputs: Vec<DVector<f64>>,
}

impl FrequencyResponse {
    /// Hessenberg form of ẋ = A x + B u, or of x(k+1) = A x(k) + B u(k), with the output matrix C by rows.
    pub fn new(a: &DMatrix<f64>, b: &DMatrix<f64>, outputs: &[Vec<f64>]) -> Self {
        let (balanced, sizes) = balanced(a);
        let scaled = DMatrix::from_fn(a.nrows(), b.ncols(), |i, j| b[(i, j)] / sizes[i]);
        let rows = outputs.iter().map(|row| {
            DVector::from_iterator(row.len(), row.iter().zip(&sizes).map(|(c, size)| c * size))
        });
        // a matrix of order one is one already
        let (q, hessenberg) = match a.nrows() {
            0 | 1 => (DMatrix::identity(a.nrows(), a.nrows()), balanced),
            _ => balanced.hessenberg().unpack(),
        };
        Self {
            inputs: q.tr_mul(&scaled),
            outputs: rows.map(|row| q.tr_mul(&row)).collect(),
            hessenberg,
        }
    }

    /// Complex amplitudes of the outputs for inputs `amplitudes` e^(s t), one per column of B, at s \[1/s\].
    ///
    /// For a sampled system the inputs are `amplitudes` z^k, and `s` is z. `None` where s is a pole.
    pub fn at(&self, s: Complex<f64>, amplitudes: &[Complex<f64>]) -> Option<Vec<Complex<f64>>> {
        let n = self.hessenberg.nrows();
        let zero = Complex::new(0.0, 0.0);
        let mut m: Vec<Complex<f64>> = Vec::with_capacity(n * n);
        for i in 0..n {
            m.extend((0..n).map(|j| if i == j { s } else { zero } - self.hessenberg[(i, j)]));
        }
        let driven =
            |row| amplitudes.iter().enumerate().map(move |(j, u)| u * self.inputs[(row, j)]);
        let mut x: Vec<Complex<f64>> = (0..n).map(|row| driven(row).sum()).collect();
        // Gauss, with the larger of two rows as pivot: below the diagonal there is one entry in each column
        for k in 0..n.saturating_sub(1) {
            let (upper, lower) = m.split_at_mut((k + 1) * n);
            let (upper, lower) = (&mut upper[k * n..], &mut lower[..n]);
            if lower[k].norm_sqr() > upper[k].norm_sqr() {
                upper.swap_with_slice(lower);
                x.swap(k, k + 1);
            }
            let factor = lower[k] / upper[k];
            for (below, above) in lower[k..].iter_mut().zip(&upper[k..]) {
                *below -= factor * above;
            }
            let above = x[k];
            x[k + 1] -= factor * above;
        }
        for k in (0..n).rev() {
            let row = &m[k * n..(k + 1) * n];
            let known: Complex<f64> = (k + 1..n).map(|j| row[j] * x[j]).sum();
            x[k] = (x[k] - known) / row[k];
        }
        let of = |row: &DVector<f64>| row.iter().zip(&x).map(|(c, x)| x * *c).sum();
        let responses: Vec<Complex<f64>> = self.outputs.iter().map(of).collect();
        responses.iter().all(|response| response.is_finite()).then_some(responses)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LinearisedPlant;
    use hydroboom_description::Description;

    /// Compared with an LU decomposition of s − A, for a crane whose pressures and angles differ by ten
    /// orders of magnitude.
    #[test]
    fn the_frequency_response_equals_the_direct_solution() {
        let crane = LinearisedPlant::new(&Description::uia_virtual().unwrap(), 0.3).unwrap();
        let order = crane.a.nrows();
        let response = FrequencyResponse::new(&crane.a, &crane.b, &crane.outputs);
        for s in [(0.0, 0.3), (0.02, 14.0), (0.0, 15.0), (0.0, 900.0), (0.02, 0.0)] {
            let s = Complex::new(s.0, s.1);
            let left = DMatrix::from_diagonal_element(order, order, s) - crane.a.map(Complex::from);
            let x = left.lu().solve(&crane.b.map(Complex::from)).unwrap();
            for (row, found) in
                crane.outputs.iter().zip(response.at(s, &[Complex::from(1.0)]).unwrap())
            {
                let wanted: Complex<f64> = row.iter().zip(x.iter()).map(|(c, x)| x * *c).sum();
                // without balance LU decomposition has lost half of the digits near the integrators
                assert!((found - wanted).norm() < 1e-6 * wanted.norm(), "{s}: {found}, {wanted}");
            }
        }
    }
}
