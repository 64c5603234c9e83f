//! Kinematics of the cylinder between base and boom (equations (28), (29), figure 12).

use super::{Boom, Pose};
use hydroboom_math::Real;

/// Attachment of the cylinder: mount C on a boom segment, foot B on the base (figure 12).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mount<T> {
    /// Index of the segment that carries mount C, from 0 at the bearing.
    pub segment: usize,
    /// Position of mount C in that segment's frame, along and across it \[m\].
    pub on_segment: [T; 2],
    /// Position of foot B on the base, to the right of the bearing and above it \[m\].
    pub on_base: [T; 2],
    /// Distance from B to C with the piston at its lower stop, L_cyl,min \[m\].
    pub shortest: T,
}

impl<T> Mount<T> {
    /// Converts every parameter to another number type by `f`.
    pub fn map<U>(self, f: &mut impl FnMut(T) -> U) -> Mount<U> {
        Mount {
            segment: self.segment,
            on_segment: self.on_segment.map(&mut *f),
            on_base: self.on_base.map(&mut *f),
            shortest: f(self.shortest),
        }
    }
}

/// Piston position and its derivatives by the boom's coordinates, equations (28), (29).
#[derive(Clone, Copy, Debug)]
pub struct CylinderPose<T, const N: usize> {
    /// Piston position from the lower stop, x_cyl \[m\].
    pub stroke: T,
    /// Moment arm of the cylinder's force about each coordinate, ∂x_cyl/∂φ_i \[m/rad\] (29).
    pub arm: [T; N],
    /// The same times the cylinder's length \[m²/rad\].
    leverage: [T; N],
    /// Reciprocal of the cylinder's length \[1/m\].
    per_length: T,
}

impl<T: Real, const N: usize> CylinderPose<T, N> {
    /// Piston velocity ẋ_cyl = Σ_i ∂x_cyl/∂φ_i φ̇_i \[m/s\], from angular velocities φ̇ \[rad/s\].
    #[inline(always)]
    pub fn velocity(&self, boom: &Boom<T, N>, angular_velocity: &[T; N]) -> T {
        let mut velocity = T::zero();
        for i in 0..boom.coordinates() {
            if i <= boom.mount.segment || boom.is_base(i) {
                velocity = velocity + self.leverage[i] * angular_velocity[i];
            }
        }
        // the sum does not wait for the length
        velocity * self.per_length
    }
}

impl<T: Real, const N: usize> Boom<T, N> {
    /// Position of the cylinder's mount C on the boom \[m\], right of and above the bearing.
    pub fn mount_position(&self, pose: &Pose<T, N>) -> [T; 2] {
        let inner = match self.mount.segment {
            0 => [T::zero(); 2],
            i => self.joint_position(pose, i - 1),
        };
        let [x, y] = self.mount.on_segment;
        let (dx, dy) = pose.turned(self.mount.segment, x, y);
        [inner[0] + dx, inner[1] + dy]
    }

    /// The cylinder's pose: `x = |C − B| − L_min` (28) and its derivatives (29).
    #[inline(always)]
    pub fn cylinder_pose(&self, pose: &Pose<T, N>) -> CylinderPose<T, N> {
        let mount = &self.mount;
        let [bx, by] = mount.on_base;
        let (mut rx, mut ry) = match self.base {
            // the foot turns with its frame
            Some(_) => pose.turned(self.len(), -bx, -by),
            None => (-bx, -by),
        };
        // each segment's contribution to the mount's position; its arm once the direction is known
        let mut reach = [(T::zero(), T::zero()); N];
        if self.base.is_some() && self.coordinates() > self.len() {
            reach[self.len()] = (rx, ry);
        }
        for i in 0..self.len() {
            if i <= mount.segment {
                reach[i] = if i == mount.segment {
                    pose.turned(i, mount.on_segment[0], mount.on_segment[1])
                } else {
                    pose.along(i, &self.segments[i])
                };
                (rx, ry) = (rx + reach[i].0, ry + reach[i].1);
            }
        }
        let square = rx.mul_add(rx, ry.square());
        let length = square.sqrt();
        // 1/length; the division need not wait for the root
        let per_length = length * (T::one() / square);
        let mut leverage = [T::zero(); N];
        let mut arm = [T::zero(); N];
        for i in 0..self.coordinates() {
            if i <= mount.segment || self.is_base(i) {
                // u . (reach turned by 90 degrees), u = r/length
                leverage[i] = ry.mul_add(reach[i].0, -(rx * reach[i].1));
                arm[i] = leverage[i] * per_length;
            }
        }
        CylinderPose { stroke: length - mount.shortest, arm, leverage, per_length }
    }
}
