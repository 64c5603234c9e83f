//! What a controller of piston and load pressure sees of a crane: a mass on an oil spring.

use crate::{DesignError, Lifting};
use hydroboom_control::boom::Boom;
use hydroboom_control::oil_spring::OilSpring;
use nalgebra::{Complex, DMatrix, DVector};
use std::f64::consts::TAU;

/// The crane's exact responses are matched at these shares of the frequency at which it rings.
const AT: [f64; 8] = [0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.15, 1.3];

/// The oil spring of a crane, and its boom: to the responses of its exact linearisation to the motor's speed, by least squares.
///
/// With `s v = a_x x + a_v v + a_p p` for the spring alone, in which the boom is rigid; with another a_p and `γ s² p` beside for the boom, whose load is
/// at x − γ p. One that gives nothing by that is rigid.
///
/// # Errors
///
/// [`DesignError`] when the crane does not ring, or its responses cannot be computed.
pub fn oil_spring(crane: &Lifting) -> Result<(OilSpring<f64>, Boom<f64>), DesignError> {
    let ringing = crane.ringing()?.frequency_hz;
    let rows = 2 * AT.len();
    let (mut left, mut right) = (DMatrix::zeros(rows, 3), DVector::zeros(rows));
    let mut left_bent = DMatrix::zeros(rows, 4);
    let (mut left_p, mut right_p) = (DMatrix::zeros(rows, 4), DVector::zeros(rows));
    for (k, share) in AT.into_iter().enumerate() {
        let frequency = share * ringing;
        let s = Complex::new(0.0, TAU * frequency);
        let seen = crane.responses(frequency)?;
        let (x, v, p) = (seen.position, seen.velocity, seen.pressure);
        // each frequency counts alike, whatever the crane answers there
        let (sv, sp) = (1.0 / (s * v).norm(), 1.0 / (s * p).norm());
        for (part, i) in [2 * k, 2 * k + 1].into_iter().enumerate() {
            let of = |z: Complex<f64>| if part == 0 { z.re } else { z.im };
            for (column, z) in [x, v, p].into_iter().enumerate() {
                left[(i, column)] = of(z) * sv;
                left_bent[(i, column)] = of(z) * sv;
                left_p[(i, column)] = of(z) * sp;
            }
            left_bent[(i, 3)] = of(s * s * p) * sv;
            left_p[(i, 3)] = if part == 0 { sp } else { 0.0 };
            right[i] = of(s * v) * sv;
            right_p[i] = of(s * p) * sp;
        }
    }
    let none = || crane.none("no mass on an oil spring answers as it does");
    let [_, _, acceleration_by_pressure, give] = solved(left_bent, &right).ok_or_else(none)?;
    let [a_x, a_v, a_p] = solved(left, &right).ok_or_else(none)?;
    let [c_x, c_v, c_p, by_speed] = solved(left_p, &right_p).ok_or_else(none)?;
    let spring = OilSpring::from_array([a_x, a_v, a_p, c_x, c_v, c_p, by_speed]);
    let is_sound = spring.to_array().iter().all(|v| v.is_finite());
    let lifts = a_p > 0.0 && by_speed > 0.0 && c_v < 0.0;
    let boom = Boom { acceleration_by_pressure, give };
    let bends = give > 0.0 && acceleration_by_pressure > 0.0;
    let boom = if bends { boom } else { Boom::rigid(&spring) };
    (is_sound && lifts)
        .then_some((spring, boom))
        .ok_or_else(|| crane.none("the motor does not lift it"))
}

/// Least squares with columns of like size.
fn solved<const N: usize>(mut left: DMatrix<f64>, right: &DVector<f64>) -> Option<[f64; N]> {
    let scale: Vec<f64> = left.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
    for (mut column, scale) in left.column_iter_mut().zip(&scale) {
        column /= *scale;
    }
    let found = left.svd(true, true).solve(right, 1e-12).ok()?;
    Some(std::array::from_fn(|k| found[k] / scale[k]))
}
