//! Classical Runge-Kutta step, for converged references.

use crate::circuit::{Circuit, Coordinates};
use crate::crane::{Crane, CraneRates, CraneState};
use core::array::from_fn;
use hydroboom_math::Real;

/// One classical Runge-Kutta step of `step` \[s\]. Fourth order; explicit, so its step must resolve the fastest mode
/// and the fastest orifice.
pub fn runge_kutta_4<T: Real, const N: usize, C: Circuit<T>>(
    crane: &Crane<T, N, C>,
    state: &mut CraneState<T, N, C::State>,
    input: &C::Input,
    step: T,
) {
    let half = T::lit(0.5) * step;
    let start = *state;

    let k1 = crane.derivative(&start, input);
    let x2 = moved(crane, &start, &start, &k1, half);
    let k2 = crane.derivative(&x2, input);
    let x3 = moved(crane, &start, &x2, &k2, half);
    let k3 = crane.derivative(&x3, input);
    let x4 = moved(crane, &start, &x3, &k3, step);
    let k4 = crane.derivative(&x4, input);

    let (sixth, third) = (step / T::lit(6.0), step / T::lit(3.0));
    let x = moved(crane, &start, &start, &k1, sixth);
    let x = moved(crane, &x, &x2, &k2, third);
    let x = moved(crane, &x, &x3, &k3, third);
    *state = moved(crane, &x, &x4, &k4, sixth);
}

/// `from` moved for `time` along the rates that hold at the state `at`.
fn moved<T: Real, const N: usize, C: Circuit<T>>(
    crane: &Crane<T, N, C>,
    from: &CraneState<T, N, C::State>,
    at: &CraneState<T, N, C::State>,
    rate: &CraneRates<T, N, C::State>,
    time: T,
) -> CraneState<T, N, C::State> {
    let mut to = *from;
    for i in 0..crane.boom.coordinates() {
        to.boom.angle[i] = from.boom.angle[i] + time * at.boom.angular_velocity[i];
        to.boom.angular_velocity[i] =
            from.boom.angular_velocity[i] + time * rate.angular_acceleration[i];
    }
    to.bristle = from.bristle + time * rate.bristle;
    let (q, dq) = (C::coordinates(&from.circuit), C::coordinates(&rate.circuit));
    to.circuit = C::from_coordinates(&Coordinates {
        stiff: from_fn(|i| q.stiff[i] + time * dq.stiff[i]),
        slow: from_fn(|i| q.slow[i] + time * dq.slow[i]),
    });
    to
}
