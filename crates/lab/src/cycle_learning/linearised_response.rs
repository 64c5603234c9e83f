//! Response of the tracking error to a correction of the motor speed, by the model linearised along the reference.

use super::drive_delay::total_delay;
use crate::LabError;
use crate::closed_loop::scenario::Course;
use hydroboom_control::estimation::reduced_model::ReducedModel;
use hydroboom_description::Description;
use hydroboom_design::operating_points::rod_side_term;
use hydroboom_design::reduced_model_fit::reduced_model;
use nalgebra::{DMatrix, Matrix3, Vector3};

/// Sampling interval of the compared errors \[s\]: a fortieth of the period of a mode at 2.5 Hz, and much
/// shorter than the knot interval of a correction.
const SAMPLING: f64 = 0.01;

/// Control periods per sample of the compared errors.
pub(super) fn decimation(period: f64) -> usize {
    (SAMPLING / period).round().max(1.0) as usize
}

/// Control periods between two knots of a correction.
pub(super) fn periods_per_knot(interval: f64, period: f64) -> usize {
    (interval / period).round().max(1.0) as usize
}

/// Lowest natural frequency \[Hz\] of the load on boom and oil along a course.
pub(super) fn lowest_frequency(
    model: &Description,
    course: &dyn Course,
    periods: usize,
) -> Result<f64, LabError> {
    let reduced = reduced_model(model)?;
    let (n, rod_side) = (&model.numbers, rod_side_term(model));
    let frequency = |k: usize| {
        let position = course.reference(k as f64 * n.control_period).position;
        Linear::new(&reduced, position, n.payload, n.transition, rod_side).natural_frequency()
    };
    let every = decimation(n.control_period);
    // one that is not a number remains
    let lower = |least: f64, f: f64| if least.is_nan() || least <= f { least } else { f };
    Ok((0..periods).step_by(every).map(frequency).fold(f64::INFINITY, lower))
}

/// Response of the tracking error to each knot of a correction \[m/(rev/s)\]. The model is the load on boom
/// and oil, linearised along the reference with sliding friction, behind the drive's delay.
///
/// ```text
/// y' = w,   w' = a_p (p − p_v w − p_0' (y + γ p)),   p' = β/(V + γ A β) (D n − A w),   x = y + γ p
/// ```
pub(super) fn response(
    model: &Description,
    course: &dyn Course,
    periods: usize,
    interval: f64,
) -> Result<DMatrix<f64>, LabError> {
    let reduced = reduced_model(model)?;
    let n = &model.numbers;
    let (period, payload) = (n.control_period, n.payload);
    let per = periods_per_knot(interval, period);
    let every = decimation(period);
    let (rows, columns) = (periods.div_ceil(every), periods / per + 2);
    let step = every as f64 * period;
    let rod_side = rod_side_term(model);
    let delay = total_delay(model);
    // each row's interval takes the hat functions at its middle
    let hat = |row: usize, column: usize| {
        let time = (row as f64 + 0.5) * step - delay;
        (1.0 - (time / (per as f64 * period) - column as f64).abs()).max(0.0)
    };
    let mut states = vec![Vector3::zeros(); columns];
    let mut response = DMatrix::zeros(rows, columns);
    for row in 0..rows {
        let position = course.reference(row as f64 * step).position;
        let linear = Linear::new(&reduced, position, payload, n.transition, rod_side);
        let (transition, input) = linear.discrete(step);
        for (column, state) in states.iter_mut().enumerate() {
            response[(row, column)] = state.x + linear.compliance * state.z;
            let speed = hat(row, column);
            if speed > 0.0 || *state != Vector3::zeros() {
                *state = transition * *state + input * speed;
            }
        }
    }
    Ok(response)
}

/// Reduced model linearised about an equilibrium; states: position and velocity of the load, load pressure.
struct Linear {
    system: Matrix3<f64>,
    input: Vector3<f64>,
    /// γ \[m/Pa\].
    compliance: f64,
}

impl Linear {
    fn new(
        reduced: &ReducedModel<f64>,
        position: f64,
        payload: f64,
        transition: f64,
        rod_side: f64,
    ) -> Self {
        let at = reduced.at(position, payload);
        let bulk_modulus = reduced.bulk_modulus(at.holding_pressure, transition, rod_side);
        let area = reduced.piston_area;
        let stiffness = bulk_modulus / (at.volume + at.compliance * area * bulk_modulus);
        let a = at.acceleration;
        let system = Matrix3::new(
            0.0,
            1.0,
            0.0,
            -a * at.holding_slope,
            -a * reduced.viscous,
            a,
            0.0,
            -stiffness * area,
            0.0,
        );
        let input = Vector3::new(0.0, 0.0, stiffness * reduced.displacement);
        Self { system, input, compliance: at.compliance }
    }

    /// Natural frequency of the undamped load on boom and oil \[Hz\].
    fn natural_frequency(&self) -> f64 {
        let [acceleration, stiffness] = [self.system[(1, 2)], -self.system[(2, 1)]];
        (acceleration * stiffness).sqrt() / std::f64::consts::TAU
    }

    /// Discretisation over a step \[s\] with zero-order hold: transition and input matrices by the
    /// exponential of the augmented system.
    fn discrete(&self, step: f64) -> (Matrix3<f64>, Vector3<f64>) {
        let mut augmented = nalgebra::Matrix4::zeros();
        augmented.fixed_view_mut::<3, 3>(0, 0).copy_from(&(self.system * step));
        augmented.fixed_view_mut::<3, 1>(0, 3).copy_from(&(self.input * step));
        let exponential = augmented.exp();
        (
            exponential.fixed_view::<3, 3>(0, 0).into_owned(),
            exponential.fixed_view::<3, 1>(0, 3).into_owned(),
        )
    }
}
