//! Feedforward by an approximate inverse of the reduced model: state and motor speed along a reference.
//!
//! The boom bends quasi-statically: acceleration and friction of the load are those of the piston, γ p'' is left out.
//! With x and its derivatives given,
//!
//! ```text
//! p = p_0(x) + x''/a_p + p_v x' + p_C s + f (1 − |s|) − d,    s = tanh(x'/v_s)
//! w = x' − γ p',    n = (p'/c + A w)/D + n_l(p) − r,          c = β/(V + γ A β)
//! ```
//!
//! The load's position is a flat output of the reduced model (M. Fliess, J. Lévine, P. Martin, P. Rouchon, *Flatness
//! and defect of non-linear systems*, 1995); the piston's would leave the boom's own mode as internal dynamics.

use crate::estimation::reduced_model::{MachineState, ReducedModel};
use crate::estimation::state_estimator::PredictedState;
use crate::reference::smoothing::SmoothSetPoint;
use hydroboom_math::Real;

/// State and motor speed \[rev/s\] along a reference trajectory, by inversion of the reduced model.
///
/// `estimate` has friction, disturbances and parameters. Friction changes its sign within a velocity of `turning`
/// \[m/s\] or more. The pressure on the piston side is the load pressure plus `rod_side_term`, (A_r/A_p) p_B \[Pa\],
/// and at least zero.
#[inline(always)]
pub fn inverse_dynamics<T: Real>(
    model: &ReducedModel<T>,
    estimate: &MachineState<T>,
    reference: &SmoothSetPoint<T>,
    turning: T,
    rod_side_term: T,
) -> PredictedState<T> {
    let one = T::one();
    let SmoothSetPoint { position, velocity, acceleration, jerk } = *reference;
    let at = model.at(position, estimate.payload);
    let sliding = model.sliding_velocity.max(turning);
    let sense = (velocity / sliding).tanh();
    let turn = (one - sense.square()) * acceleration / sliding;
    // at rest friction has its present value
    let held = estimate.friction;
    let signed = T::select(sense.lt(T::zero()), -held, held);
    let pressure = at.holding_pressure
        + acceleration / at.acceleration
        + model.viscous * velocity
        + model.coulomb * sense
        + held * (one - sense.abs())
        - estimate.disturbance;
    let pressure = pressure.max(-rod_side_term);
    let rate = at.holding_slope * velocity
        + jerk / at.acceleration
        + model.viscous * acceleration
        + (model.coulomb - signed) * turn;
    let bulk_modulus = model.bulk_modulus(pressure, estimate.transition_pressure, rod_side_term);
    let load_velocity = velocity - at.compliance * rate;
    let inflow = rate / model.stiffness(&at, bulk_modulus) + model.piston_area * load_velocity;
    PredictedState {
        position: position - at.compliance * pressure,
        velocity: load_velocity,
        load_pressure: pressure,
        motor_speed: inflow / model.displacement + model.leakage(pressure) - estimate.unknown_flow,
    }
}
