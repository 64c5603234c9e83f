//! The paper's time step (equations (30) to (32), section 5.1).

use crate::crane::{Crane, CraneState, Input};
use hydroboom_math::Real;

/// One step of `step` \[s\]: the circuit by forward Euler, the boom by the paper's sequential
/// update.
///
/// ```text
/// φ̇ ← φ̇ + φ̈ dt                                                                      (31)
/// φ ← φ + φ̇ dt + φ̈ dt²/2, with the new φ̇                                            (32)
/// ```
///
/// Order within one step: every right-hand side is evaluated at the old state. Piston position,
/// velocity and pressures that the flows see, and the pressures and friction in the cylinder force
/// that the boom sees, are those of the step's beginning; then all states move at once. (Blocks
/// that split circuit and boom reproduce this by exchanging x, v and F once a step.)
///
/// First order. Stable only below [`StepLimit`](super::StepLimit); damps a mode of angular
/// frequency ω by ω dt/4 on its own.
#[inline(always)]
pub fn published<T: Real, const N: usize>(
    crane: &Crane<T, N>,
    state: &mut CraneState<T, N>,
    input: &Input<T>,
    step: T,
) {
    let rate = crane.derivative(state, input);

    let half_square = T::lit(0.5) * step.square();
    for i in 0..crane.boom.coordinates() {
        let acceleration = rate.angular_acceleration[i];
        let velocity = acceleration.mul_add(step, state.boom.angular_velocity[i]);
        state.boom.angular_velocity[i] = velocity;
        state.boom.angle[i] =
            velocity.mul_add(step, acceleration.mul_add(half_square, state.boom.angle[i]));
    }

    let nodes = &mut state.circuit.nodes;
    nodes.pump_a = step.mul_add(rate.circuit.nodes.pump_a, nodes.pump_a);
    nodes.a = step.mul_add(rate.circuit.nodes.a, nodes.a);
    nodes.b = step.mul_add(rate.circuit.nodes.b, nodes.b);
    nodes.pump_b = step.mul_add(rate.circuit.nodes.pump_b, nodes.pump_b);
    nodes.accumulator = step.mul_add(rate.circuit.nodes.accumulator, nodes.accumulator);
    state.circuit.gas_volume = step.mul_add(rate.circuit.gas_volume, state.circuit.gas_volume);
    state.bristle = step.mul_add(rate.bristle, state.bristle);
}
