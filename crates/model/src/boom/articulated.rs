//! Articulated-body method: the mass matrix solved in time proportional to the number of segments (as in R.
//! Featherstone, Rigid Body Dynamics Algorithms, 2008).
//!
//! M(phi) of equation (26) is full, but the boom is a chain. Everything beyond a joint acts on it with a
//! force that is linear in the joint's acceleration `a` and in the inner segment's angular acceleration.
//! Eliminating the segments from tip to bearing leaves one equation at the bearing; going back out gives
//! all accelerations. Its cost grows linearly, where forming and factoring M grows with the cube.
//!
//! Each joint may carry an impedance κ that resists the *difference* of its neighbours' angular
//! accelerations. An implicit time step needs it, `κ = γh b_C + (γh)² k_C`, to treat the stiff
//! bending modes without a step limit; with κ = 0 this is the plain mass matrix. The matrix solved
//! is `M + Bᵀ κ B` with (B α)_i = α_{i+1} − α_i, symmetric and positive definite. An elastic base frame
//! adds one line of its own, with its own impedance after those of the segments.

use super::{Boom, Pose};
use hydroboom_math::Real;

/// Factors of the boom's mass matrix M(φ) (26) at one pose, by the articulated-body method.
///
/// Joint impedances \[kg·m²\] may be added to it, as an implicit step needs: `(γh)² k_C + γh b_C`.
#[derive(Clone, Copy, Debug)]
pub struct Articulated<T, const N: usize> {
    /// Reciprocal of each segment's inertia with all outer segments, 1/D.
    inverse: [T; N],
    /// Coupling of each segment to the acceleration of its inner joint, g.
    coupling: [(T, T); N],
    /// Coupling to the inner neighbour's angular acceleration, κ/D of the outer segment; none
    /// without impedances.
    share: Option<[T; N]>,
    /// From inner to outer joint.
    along: [(T, T); N],
}

impl<T: Real, const N: usize> Boom<T, N> {
    /// Factors the mass matrix M(φ) (26) at a pose. `impedance` \[kg·m²\], one per joint, is added; `None`
    /// adds none.
    #[inline(always)]
    pub fn articulated(&self, pose: &Pose<T, N>, impedance: Option<&[T; N]>) -> Articulated<T, N> {
        let zero = T::zero();
        let n = self.len();
        let mut factors = Articulated {
            inverse: [zero; N],
            coupling: [(zero, zero); N],
            share: impedance.map(|_| [zero; N]),
            along: [(zero, zero); N],
        };
        // nothing couples the base frame to the segments but the cylinder's force
        if let Some(base) = &self.base {
            let stiffened = impedance.map_or(base.inertia, |kappa| base.inertia + kappa[n]);
            factors.inverse[n] = T::one() / stiffened;
        }
        // effective mass of all that lies beyond the outer joint, symmetric 2x2
        let (mut axx, mut axy, mut ayy) = (zero, zero, zero);
        // coefficients of the outer neighbour: κ/D, κ (1 − κ/D), g
        let (mut share, mut stiffening, mut outer) = (zero, zero, (zero, zero));
        for i in (0..n).rev() {
            let s = &self.segments[i];
            let (dx, dy) = pose.along(i, s);
            let (rx, ry) = pose.centre(i, s);
            // the paper's hat: (x, y) turned by 90 degrees is (−y, x)
            let mut qx = axy.mul_add(dx, -(axx * dy));
            let mut qy = ayy.mul_add(dx, -(axy * dy));
            // about the inner joint; in the segment's own frame, where it does not wait for the pose
            let own = s.mass.mul_add(s.centre_x.square() + s.centre_y.square(), s.inertia);
            let mut inertia = dx.mul_add(qy, (-dy).mul_add(qx, own));
            let mut kappa = zero;
            if let Some(impedance) = impedance {
                let passed = (share * outer.0, share * outer.1);
                (qx, qy) = (qx + passed.0, qy + passed.1);
                kappa = if i > 0 { impedance[i - 1] } else { zero };
                let two = T::lit(2.0);
                inertia = inertia + two * (dx * passed.1 - dy * passed.0) + stiffening + kappa;
            }
            let gx = (-s.mass).mul_add(ry, qx);
            let gy = s.mass.mul_add(rx, qy);
            let inverse = T::one() / inertia;

            factors.inverse[i] = inverse;
            factors.coupling[i] = (gx, gy);
            factors.along[i] = (dx, dy);

            axx = (-gx * gx).mul_add(inverse, axx + s.mass);
            axy = (-gx * gy).mul_add(inverse, axy);
            ayy = (-gy * gy).mul_add(inverse, ayy + s.mass);
            if let Some(shares) = &mut factors.share {
                shares[i] = share;
                share = kappa * inverse;
                stiffening = kappa * (T::one() - share);
                outer = (gx, gy);
            }
        }
        factors
    }
}

impl<T: Real, const N: usize> Articulated<T, N> {
    /// Angular accelerations φ̈ = M⁻¹ l \[rad/s²\] of all coordinates under generalised moments l \[N·m\].
    #[inline(always)]
    pub fn solve(&self, boom: &Boom<T, N>, moment: &[T; N]) -> [T; N] {
        let zero = T::zero();
        let n = boom.len();
        // in: each segment's moment with what its outer neighbours leave on it
        let mut acceleration = *moment;
        let (mut bx, mut by, mut outer) = (zero, zero, zero);
        for i in (0..n).rev() {
            let (dx, dy) = self.along[i];
            let mut total = dy.mul_add(bx, (-dx).mul_add(by, moment[i]));
            if let Some(share) = &self.share {
                total = share[i].mul_add(outer, total);
            }
            acceleration[i] = total;
            let scaled = total * self.inverse[i];
            bx = self.coupling[i].0.mul_add(scaled, bx);
            by = self.coupling[i].1.mul_add(scaled, by);
            outer = total;
        }
        // out: accelerations from the bearing, which rests
        let (mut ax, mut ay) = (zero, zero);
        for i in 0..n {
            let (gx, gy) = self.coupling[i];
            let (dx, dy) = self.along[i];
            let mut alpha = (-gx).mul_add(ax, (-gy).mul_add(ay, acceleration[i])) * self.inverse[i];
            if let Some(share) = &self.share
                && i > 0
            {
                // κ_i/D_i is kept with the inner neighbour
                alpha = share[i - 1].mul_add(acceleration[i - 1], alpha);
            }
            acceleration[i] = alpha;
            (ax, ay) = ((-dy).mul_add(alpha, ax), dx.mul_add(alpha, ay));
        }
        for i in n..boom.coordinates() {
            acceleration[i] = moment[i] * self.inverse[i];
        }
        acceleration
    }
}
