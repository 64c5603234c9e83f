//! Kinematics of the boom: directions and positions of its segments.

use super::{Boom, Segment};
use hydroboom_math::Real;

/// Sines and cosines of the absolute angles of segments and base frame, computed once for a state.
#[derive(Clone, Copy, Debug)]
pub struct Pose<T, const N: usize> {
    sin: [T; N],
    cos: [T; N],
}

impl<T: Real, const N: usize> Pose<T, N> {
    /// A vector of segment `i`'s frame in the world's.
    #[inline(always)]
    pub(super) fn turned(&self, i: usize, x: T, y: T) -> (T, T) {
        (x.mul_add(self.cos[i], -(y * self.sin[i])), x.mul_add(self.sin[i], y * self.cos[i]))
    }

    /// From the inner joint of segment `i` to its centre of mass \[m\].
    #[inline(always)]
    pub(super) fn centre(&self, i: usize, segment: &Segment<T>) -> (T, T) {
        self.turned(i, segment.centre_x, segment.centre_y)
    }

    /// From the inner to the outer joint of segment `i` \[m\].
    #[inline(always)]
    pub(super) fn along(&self, i: usize, segment: &Segment<T>) -> (T, T) {
        (segment.length * self.cos[i], segment.length * self.sin[i])
    }
}

impl<T: Real, const N: usize> Boom<T, N> {
    /// Pose at the absolute angles φ \[rad\], counter-clockwise from the horizontal.
    #[inline(always)]
    pub fn pose(&self, angle: &[T; N]) -> Pose<T, N> {
        let mut pose = Pose { sin: [T::zero(); N], cos: [T::one(); N] };
        let mut turn = |i: usize| (pose.sin[i], pose.cos[i]) = angle[i].sin_cos();
        // written out for the short booms: left to the compiler, a loop over so large a body is
        // vectorised across segments instead of across lanes, at twice the time
        let n = self.coordinates();
        if n > 0 {
            turn(0);
        }
        if n > 1 {
            turn(1);
        }
        if n > 2 {
            turn(2);
        }
        for i in 3..n {
            turn(i);
        }
        pose
    }

    /// Position \[m\] of the outer end of segment `i`, right of and above the bearing; of the tip for an `i` beyond
    /// the last.
    pub fn joint_position(&self, pose: &Pose<T, N>, i: usize) -> [T; 2] {
        let mut position = [T::zero(); 2];
        for k in 0..=i.min(self.len() - 1) {
            let (dx, dy) = pose.along(k, &self.segments[k]);
            position = [position[0] + dx, position[1] + dy];
        }
        position
    }

    /// Position \[m\] of the boom's tip, right of and above the bearing.
    pub fn tip_position(&self, pose: &Pose<T, N>) -> [T; 2] {
        self.joint_position(pose, self.len() - 1)
    }

    /// Distance \[m\] of the tip from the straight continuation of the first segment, positive
    /// upwards across it.
    pub fn tip_deflection(&self, pose: &Pose<T, N>) -> T {
        let [x, y] = self.tip_position(pose);
        y * pose.cos[0] - x * pose.sin[0]
    }
}
