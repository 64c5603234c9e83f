//! Numerical damping and observed order of the integration schemes, on a crane without losses.
//!
//! The integration step is differentiated with respect to its initial state. An eigenvalue μ of that matrix
//! equals `exp(λ h)` with λ the numerical eigenvalue of a mode. It is compared with the eigenvalue of the
//! differential equation.

use crate::eigenfrequency::without_friction;
use crate::energy_audit::scheme_name;
use crate::linearise::{eigenvalues, modes};
use crate::{LabError, plant};
use hydroboom_description::{BuildError, Description};
use hydroboom_math::Dual;
use hydroboom_model::stepping::{Implicit, published, runge_kutta_4};
use hydroboom_model::{Input, Scheme, Start};
use hydroboom_plant::{flatten, unflatten};
use nalgebra::{Complex, DMatrix};
use serde::Serialize;

/// Numerical damping and frequency error of one integration scheme with one step.
#[derive(Clone, Debug, Serialize)]
pub struct NumericalDamping {
    /// Name of the integration scheme.
    pub scheme: String,
    /// Integration step \[us\].
    pub step_us: f64,
    /// Damping ratio that the scheme adds to the crane's lowest mode \[-\]; negative if it excites the oscillation.
    pub damping_ratio: f64,
    /// Relative error of the mode's frequency \[-\].
    pub frequency_error: f64,
    /// Observed order of convergence \[-\] of the mode's error between this step and half of it; none if rounding
    /// dominates.
    pub order: Option<f64>,
}

/// Number of boom segments.
const SEGMENTS: usize = 3;
/// Relative errors below this are due to rounding.
const ROUNDING: f64 = 1e-10;

/// Description of the crane without any loss: friction, structural damping, pump leakage.
///
/// # Errors
///
/// [`LabError::Description`] if the resulting machine is impossible; none for a valid description.
pub fn lossless(description: &Description) -> Result<Description, LabError> {
    let mut lossless = without_friction(description)?;
    for assignment in [
        "boom.damping_ratio=0",
        "pump.internal_leakage_m3_s_sqrtpa=0",
        "pump.case_leakage_a_m3_s_sqrtpa=0",
        "pump.case_leakage_b_m3_s_sqrtpa=0",
    ] {
        lossless.set(assignment)?;
    }
    Ok(lossless)
}

/// Numerical damping of the integration schemes with their usual steps, on the lossless crane of three segments with
/// its load held.
///
/// # Errors
///
/// [`LabError::NoOscillation`] if the crane does not oscillate; [`LabError::Plant`] if it has no state of rest at 40 %
/// of its stroke; [`LabError::Design`] if eigenvalues cannot be computed.
pub fn numerical_damping(description: &Description) -> Result<Vec<NumericalDamping>, LabError> {
    let lossless = lossless(&description.divided(SEGMENTS))?;
    let trials = [
        (Scheme::Published, 50e-6),
        (Scheme::RungeKutta4, 50e-6),
        (Scheme::Implicit, 500e-6),
        (Scheme::Implicit, 1000e-6),
        (Scheme::Implicit, 2000e-6),
    ];
    trials
        .into_iter()
        .map(|(scheme, step)| {
            let (seen, exact) = lowest_mode(&lossless, scheme, step)?;
            let (finer, _) = lowest_mode(&lossless, scheme, 0.5 * step)?;
            let (error, finer_error) = ((seen - exact).norm(), (finer - exact).norm());
            Ok(NumericalDamping {
                scheme: scheme_name(scheme).into(),
                step_us: step * 1e6,
                damping_ratio: (exact - seen).re / exact.norm(),
                frequency_error: (seen - exact).im / exact.im,
                order: (finer_error > ROUNDING * exact.norm())
                    .then(|| (error / finer_error).log2()),
            })
        })
        .collect()
}

/// Eigenvalue of the lowest mode \[1/s\]: numerical, and of the differential equation.
fn lowest_mode(
    description: &Description,
    scheme: Scheme,
    step: f64,
) -> Result<(Complex<f64>, Complex<f64>), LabError> {
    let mut start = description.start(0.4 * description.numbers.stroke);
    start.preload = 0.0;
    let held = Input { pump_speed: 0.0, holding_valve: 0.0 };
    let silent = || LabError::NoOscillation("the lossless crane does not oscillate".into());
    let (a, _) = plant(description, &start, Scheme::Implicit, step)?.jacobian(&held);
    let exact = modes(&a)?
        .into_iter()
        .find(|mode| mode.frequency_hz > 0.1)
        .map(|mode| Complex::new(mode.real, mode.imaginary))
        .ok_or_else(silent)?;
    eigenvalues(&step_jacobian(description, &start, scheme, step)?)?
        .iter()
        .map(|multiplier| multiplier.ln() / step)
        .min_by(|p, q| (p - exact).norm().total_cmp(&(q - exact).norm()))
        .map(|seen| (seen, exact))
        .ok_or_else(silent)
}

/// Derivatives of the state after one step with respect to the state before it.
fn step_jacobian(
    description: &Description,
    start: &Start,
    scheme: Scheme,
    step: f64,
) -> Result<DMatrix<f64>, LabError> {
    type D = Dual<f64, 1>;
    let crane = description.crane::<SEGMENTS>()?;
    let rest = crane.at_rest(start).map_err(BuildError::from)?;
    let crane = crane.map(&mut D::constant);
    let rest = rest.map(D::constant);
    let implicit = Implicit::new(&crane);
    let held = Input { pump_speed: D::constant(0.0), holding_valve: D::constant(0.0) };
    let flat = flatten(&rest, SEGMENTS);
    let mut jacobian = DMatrix::zeros(flat.len(), flat.len());
    for column in 0..flat.len() {
        let mut varied = flat.clone();
        varied[column].slope[0] = 1.0;
        let mut x = unflatten(&rest, &varied, SEGMENTS);
        let step = D::constant(step);
        match scheme {
            Scheme::Published => published(&crane, &mut x, &held, step),
            Scheme::Implicit => {
                implicit.step(&crane, &mut x, &held, step);
            }
            Scheme::RungeKutta4 => runge_kutta_4(&crane, &mut x, &held, step),
        }
        for (row, entry) in flatten(&x, SEGMENTS).iter().enumerate() {
            jacobian[(row, column)] = entry.slope[0];
        }
    }
    Ok(jacobian)
}
