//! Published time step: sequential Euler update (equations (30) to (32), section 5.1).

use crate::circuit::Circuit;
use crate::crane::{Crane, CraneState};
use hydroboom_math::Real;

/// One step of `step` \[s\]: the circuit by forward Euler, the boom by the paper's sequential
/// update.
///
/// ```text
/// φ̇ ← φ̇ + φ̈ dt                                                                      (31)
/// φ ← φ + φ̇ dt + φ̈ dt²/2, with the new φ̇                                            (32)
/// ```
///
/// Order within one step: every right-hand side is evaluated at the old state. Flows are computed with
/// piston position, velocity and pressures of the step's beginning. So is the cylinder force on the boom,
/// with pressures and friction of the step's beginning. Then all states move at once. (Blocks that split
/// circuit and boom reproduce this by exchanging x, v and F once a step.)
///
/// First order. Stable only below [`StepLimit`](super::StepLimit); damps a mode of angular
/// frequency ω by ω dt/4 on its own.
#[inline(always)]
pub fn published<T: Real, const N: usize, C: Circuit<T>>(
    crane: &Crane<T, N, C>,
    state: &mut CraneState<T, N, C::State>,
    input: &C::Input,
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

    let (mut q, dq) = (C::coordinates(&state.circuit), C::coordinates(&rate.circuit));
    for (q, rate) in q.stiff.iter_mut().zip(dq.stiff) {
        *q = step.mul_add(rate, *q);
    }
    for (q, rate) in q.slow.iter_mut().zip(dq.slow) {
        *q = step.mul_add(rate, *q);
    }
    state.circuit = C::from_coordinates(&q);
    state.bristle = step.mul_add(rate.bristle, state.bristle);
}
