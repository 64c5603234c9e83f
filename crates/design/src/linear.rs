//! The crane linearised at an operating point, with exact derivatives.

use crate::DesignError;
use nalgebra::{Complex, DMatrix, Schur};
use serde::Serialize;

/// Eigenvalue of the linearised crane, or conjugate pair of eigenvalues.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Mode {
    /// Real part \[1/s\].
    pub real: f64,
    /// Imaginary part \[rad/s\], not negative.
    pub imaginary: f64,
    /// Frequency of the oscillation \[Hz\]; zero without oscillation.
    pub frequency_hz: f64,
    /// Damping ratio −Re λ/|λ| of the eigenvalue λ \[1\]: 1 for modes that decay without oscillation, negative for
    /// modes that grow. An eigenvalue of less than 1e-9 1/s counts as zero and has 0.
    pub damping_ratio: f64,
}

/// Modes of ẋ = A x, by the magnitude of their eigenvalues, smallest first; a conjugate pair is one mode.
///
/// # Errors
///
/// [`DesignError::Eigenvalues`] if an entry of A is not finite, or the iteration does not converge.
pub fn modes(a: &DMatrix<f64>) -> Result<Vec<Mode>, DesignError> {
    let mut modes: Vec<Mode> = eigenvalues(a)?
        .iter()
        .filter(|value| value.im >= 0.0)
        .map(|value| Mode {
            real: value.re,
            imaginary: value.im,
            frequency_hz: value.im / std::f64::consts::TAU,
            damping_ratio: if value.norm() > 1e-9 { -value.re / value.norm() } else { 0.0 },
        })
        .collect();
    modes.sort_by(|p, q| p.real.hypot(p.imaginary).total_cmp(&q.real.hypot(q.imaginary)));
    Ok(modes)
}

/// Eigenvalues \[1/s\] of a matrix whose states may differ in magnitude by many orders.
///
/// # Errors
///
/// [`DesignError::Eigenvalues`] if an entry is not finite, or the iteration does not converge.
pub fn eigenvalues(a: &DMatrix<f64>) -> Result<Vec<Complex<f64>>, DesignError> {
    if a.iter().any(|entry| !entry.is_finite()) {
        return Err(DesignError::Eigenvalues("the matrix has entries that are not finite".into()));
    }
    let (balanced, _) = balanced(a);
    // rows of zeros can keep the iteration from ending at the tightest tolerance
    [1.0, 10.0, 100.0, 1000.0]
        .into_iter()
        .find_map(|loosened| {
            Schur::try_new(balanced.clone(), loosened * f64::EPSILON, 100 * a.nrows())
        })
        .map(|schur| schur.complex_eigenvalues().iter().copied().collect())
        .ok_or_else(|| DesignError::Eigenvalues("the iteration does not converge".into()))
}

/// The balanced matrix S⁻¹ A S, with rows and columns scaled by powers of two until they are of similar
/// size, and S. Pressures and angles differ by ten orders of magnitude; unscaled, the small eigenvalues
/// would be inaccurate.
pub(crate) fn balanced(a: &DMatrix<f64>) -> (DMatrix<f64>, Vec<f64>) {
    let mut m = a.clone();
    let n = m.nrows();
    let mut sizes = vec![1.0; n];
    for _ in 0..100 {
        let mut changed = false;
        for i in 0..n {
            let (mut row, mut column) = (0.0, 0.0);
            for j in (0..n).filter(|j| *j != i) {
                row += m[(i, j)].abs();
                column += m[(j, i)].abs();
            }
            if row == 0.0 || column == 0.0 {
                continue;
            }
            let scale = (row / column).sqrt().log2().round().exp2();
            if (column * scale + row / scale) < 0.95 * (column + row) {
                changed = true;
                sizes[i] *= scale;
                for j in 0..n {
                    m[(j, i)] *= scale;
                    m[(i, j)] /= scale;
                }
            }
        }
        if !changed {
            break;
        }
    }
    (m, sizes)
}

/// Whether the piston side's load-holding valve is in its dead band: its flow does not change with the pump's
/// pressure.
///
/// `a` is the state matrix, `states` has the names of its rows. False if `pressure_a_pa` or `pressure_pump_a_pa` is
/// not among them.
pub fn in_dead_band(a: &DMatrix<f64>, states: &[String]) -> bool {
    let place = |name: &str| states.iter().position(|state| state == name);
    let pair = place("pressure_a_pa").zip(place("pressure_pump_a_pa"));
    pair.is_some_and(|(cylinder, pump)| a[(cylinder, pump)] == 0.0)
}

/// Mode shape of an eigenvalue λ: complex amplitude of each state, scaled so that the state `unit` has amplitude one.
/// By inverse iteration near λ.
///
/// # Errors
///
/// [`DesignError::Eigenvalues`] if the state `unit` does not take part, or the iteration fails.
pub fn mode_shape(
    a: &DMatrix<f64>,
    mode: &Mode,
    unit: usize,
) -> Result<Vec<Complex<f64>>, DesignError> {
    let n = a.nrows();
    let failed = || DesignError::Eigenvalues("the mode's shape cannot be computed".into());
    let size = mode.real.hypot(mode.imaginary).max(1.0);
    let beside = Complex::new(mode.real, mode.imaginary) + Complex::new(1e-7, 1e-7) * size;
    let shifted = DMatrix::from_fn(n, n, |i, j| {
        Complex::new(a[(i, j)], 0.0) - if i == j { beside } else { Complex::new(0.0, 0.0) }
    });
    let factored = shifted.lu();
    // a start that no symmetry makes orthogonal to the mode
    let mut shape = DMatrix::from_fn(n, 1, |i, _| Complex::new(1.0 + 0.37 * i as f64, 0.5));
    for _ in 0..4 {
        shape = factored.solve(&shape).ok_or_else(failed)?;
        let largest = shape.iter().map(|x| x.norm()).fold(0.0, f64::max);
        shape.unscale_mut(largest);
    }
    let reference = shape.get((unit, 0)).copied().filter(|x| x.norm() > 0.0).ok_or_else(failed)?;
    let shape: Vec<_> = shape.iter().map(|x| x / reference).collect();
    match shape.iter().all(|x| x.re.is_finite() && x.im.is_finite()) {
        true => Ok(shape),
        false => Err(failed()),
    }
}

/// Frequency response `C (jω − A)⁻¹ B` of one output at a frequency \[Hz\]; `c_row` is its row of C. `None` at a
/// pole.
pub fn response(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    c_row: &[f64],
    frequency_hz: f64,
) -> Option<Complex<f64>> {
    transfer(a, b, c_row, Complex::new(0.0, std::f64::consts::TAU * frequency_hz))
}

/// `C (s − A)⁻¹ B`, for one row of C: response of an output to an input that rings and grows as e to the s t, s in
/// \[1/s\].
pub(crate) fn transfer(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    c_row: &[f64],
    s: Complex<f64>,
) -> Option<Complex<f64>> {
    let n = a.nrows();
    let zero = Complex::new(0.0, 0.0);
    let matrix = DMatrix::from_fn(n, n, |i, j| (if i == j { s } else { zero }) - a[(i, j)]);
    let rhs = b.column(0).map(|x| Complex::new(x, 0.0));
    let x = matrix.lu().solve(&rhs)?;
    Some(c_row.iter().zip(x.iter()).map(|(c, x)| x * *c).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coupled_pendulums_have_an_in_phase_and_an_antiphase_mode() {
        // x1'' = -x1 - c (x1 - x2), x2'' = -x2 - c (x2 - x1)
        let c = 0.3;
        #[rustfmt::skip]
        let a = DMatrix::from_row_slice(4, 4, &[
            0.0, 0.0, 1.0, 0.0,
            0.0, 0.0, 0.0, 1.0,
            -1.0 - c, c, 0.0, 0.0,
            c, -1.0 - c, 0.0, 0.0,
        ]);
        let modes = modes(&a).unwrap();
        for (mode, other) in modes.iter().zip([1.0, -1.0]) {
            let shape = mode_shape(&a, mode, 0).unwrap();
            assert!((shape[1] - Complex::new(other, 0.0)).norm() < 1e-9, "{shape:?}");
        }
    }

    #[test]
    fn badly_scaled_oscillator_keeps_its_frequency() {
        // x'' = -k x with x in metres and a "pressure" state k x/s of size 1e12
        let (omega, scale) = (20.0, 1e12);
        let a = DMatrix::from_row_slice(2, 2, &[0.0, -omega / scale, omega * scale, 0.0]);
        let mode = modes(&a).unwrap()[0];
        assert!((mode.imaginary / omega - 1.0).abs() < 1e-12, "{mode:?}");
    }
}
