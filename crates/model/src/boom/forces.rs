//! Equations of motion of the boom: applied moments l (24) and inertial moments M φ̈, in one pass out and one back.

use super::{Boom, BoomState, Pose};
use hydroboom_math::Real;

impl<T: Real, const N: usize> Boom<T, N> {
    /// Moments l \[N·m\] on each segment from gravity, the centripetal accelerations and the
    /// joints:
    ///
    /// ```text
    /// l_i = Σ_k ∂r_k/∂φ_i · (W_k − m_k a*_k) + τ_i − τ_{i−1}
    /// τ_i = k_C (φ_{i+1} − φ_i − δ_i) + b_C (φ̇_{i+1} − φ̇_i)                            (15, 16)
    /// ```
    ///
    /// δ_i is the joint's bend without load, zero in the paper's straight boom. a*_k holds the terms of the
    /// acceleration with φ̇²; each points back along its vector. The cylinder's force F adds `arm_i F`.
    #[inline(always)]
    pub fn applied_moments(&self, pose: &Pose<T, N>, state: &BoomState<T, N>) -> [T; N] {
        let n = self.len();
        // out: what gravity and φ̇² do to each mass; (ax, ay) is −a* of the inner joint
        let mut force = [(T::zero(), T::zero()); N];
        let (mut ax, mut ay) = (T::zero(), T::zero());
        for i in 0..n {
            let s = &self.segments[i];
            let square = state.angular_velocity[i].square();
            let (rx, ry) = pose.centre(i, s);
            force[i] =
                (s.mass * rx.mul_add(square, ax), s.mass * ry.mul_add(square, ay - self.gravity));
            let (dx, dy) = pose.along(i, s);
            (ax, ay) = (dx.mul_add(square, ax), dy.mul_add(square, ay));
        }
        // back: its moments about the inner joints
        let mut moment = self.moments_of(pose, &force);
        for i in 0..n - 1 {
            let joint = &self.joints[i];
            let bend = (state.angle[i + 1] - state.angle[i]) - joint.rest;
            let torque = joint.stiffness * bend
                + joint.damping * (state.angular_velocity[i + 1] - state.angular_velocity[i]);
            moment[i] = moment[i] + torque;
            moment[i + 1] = moment[i + 1] - torque;
        }
        if let Some(base) = &self.base {
            moment[n] = base.moment(state.angle[n], state.angular_velocity[n]);
        }
        moment
    }

    /// Inertial moments M(φ) φ̈ \[N·m\], left-hand side of (26), for angular accelerations φ̈ \[rad/s²\] at a pose.
    #[inline(always)]
    pub fn inertial_moments(&self, pose: &Pose<T, N>, acceleration: &[T; N]) -> [T; N] {
        let n = self.len();
        let mut force = [(T::zero(), T::zero()); N];
        let (mut ax, mut ay) = (T::zero(), T::zero());
        for i in 0..n {
            let s = &self.segments[i];
            let alpha = acceleration[i];
            let (rx, ry) = pose.centre(i, s);
            force[i] = (s.mass * (ax - ry * alpha), s.mass * (ay + rx * alpha));
            let (dx, dy) = pose.along(i, s);
            (ax, ay) = (ax - dy * alpha, ay + dx * alpha);
        }
        let mut moment = self.moments_of(pose, &force);
        for i in 0..n {
            moment[i] = moment[i] + self.segments[i].inertia * acceleration[i];
        }
        if let Some(base) = &self.base {
            moment[n] = base.inertia * acceleration[n];
        }
        moment
    }

    /// Generalised moments Σ_k ∂r_k/∂φ_i · F_k of a force on each centre of mass.
    #[inline(always)]
    fn moments_of(&self, pose: &Pose<T, N>, force: &[(T, T); N]) -> [T; N] {
        let mut moment = [T::zero(); N];
        let (mut fx, mut fy) = (T::zero(), T::zero());
        for i in (0..self.len()).rev() {
            let s = &self.segments[i];
            let (rx, ry) = pose.centre(i, s);
            let (dx, dy) = pose.along(i, s);
            // (fx, fy) sums the forces beyond this segment's outer joint
            moment[i] =
                rx.mul_add(force[i].1, (-ry).mul_add(force[i].0, dx.mul_add(fy, -(dy * fx))));
            (fx, fy) = (fx + force[i].0, fy + force[i].1);
        }
        moment
    }
}
