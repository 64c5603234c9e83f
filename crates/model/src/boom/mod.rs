//! Flexible boom as a multibody system: rigid segments joined by elastic hinges (section 3.2).

mod articulated;
mod base;
mod beam;
mod forces;
mod links;
mod mount;
mod pose;

pub use articulated::Articulated;
pub use base::BaseFrame;
pub use beam::{Beam, Geometry, LayoutError};
pub use links::{Link, Payload};
pub use mount::{CylinderPose, Mount};
pub use pose::Pose;

use hydroboom_math::{Real, record};

/// Largest number of segments of a boom.
pub const MAX_SEGMENTS: usize = 50;

/// Up to this capacity a boom always has exactly as many segments as its type has room for, so
/// that the compiler knows the length of every loop.
const EXACT: usize = 3;

record! {
    /// Rigid body of the boom. Its frame has its origin at the inner joint, x along the boom, y across it, positive
    /// upwards.
    pub struct Segment<T> {
        /// Distance between its joints, L_seg
        #[unit = "m"]
        pub length: T,
        /// Mass of the segment, m
        #[unit = "kg"]
        pub mass: T,
        /// Position of the centre of mass along the segment, from the inner joint
        #[unit = "m"]
        pub centre_x: T,
        /// Position of the centre of mass across the segment, positive upwards
        #[unit = "m"]
        pub centre_y: T,
        /// Moment of inertia about the centre of mass, J
        #[unit = "kg·m²"]
        pub inertia: T,
    }
}

record! {
    /// The elastic hinge between two segments.
    pub struct Joint<T> {
        /// Torsional stiffness of the joint, k_C (15)
        #[unit = "N·m/rad"]
        pub stiffness: T,
        /// Torsional damping of the joint, b_C (16)
        #[unit = "N·m·s/rad"]
        pub damping: T,
        /// Angle of the outer segment to the inner one without moment, δ; zero for a straight boom
        #[unit = "rad"]
        pub rest: T,
    }
}

/// Flexible boom of at most `N` coordinates: rigid segments joined by torsional springs and dampers (section 3.2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Boom<T, const N: usize> {
    segments: [Segment<T>; N],
    /// Joint i is the one between segments i and i + 1; the last one is not used.
    joints: [Joint<T>; N],
    count: usize,
    /// The base frame, where it is not rigid; the published model's is.
    base: Option<BaseFrame<T>>,
    /// Positions of the cylinder's mount on the boom and of its foot on the base.
    pub mount: Mount<T>,
    /// Acceleration of gravity, downwards \[m/s²\].
    pub gravity: T,
}

/// Angles and angular velocities of the segments, then of the base frame if it is elastic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoomState<T, const N: usize> {
    /// Absolute angles, phi \[rad\].
    pub angle: [T; N],
    /// Absolute angular velocities \[rad/s\].
    pub angular_velocity: [T; N],
}

impl<T, const N: usize> Boom<T, N> {
    /// Number of segments, 1 to [`MAX_SEGMENTS`].
    #[inline(always)]
    pub fn len(&self) -> usize {
        if N <= EXACT { N } else { self.count.min(N) }
    }

    /// Number of angles: one for each segment, and one for an elastic base frame after them.
    #[inline(always)]
    pub fn coordinates(&self) -> usize {
        if N <= EXACT { N } else { (self.count + usize::from(self.base.is_some())).min(N) }
    }

    /// Whether the coordinate is the base frame's.
    #[inline(always)]
    pub(crate) fn is_base(&self, coordinate: usize) -> bool {
        N > EXACT && coordinate == self.len()
    }

    /// The elastic base frame; `None` for a rigid base, as published.
    pub fn base(&self) -> Option<&BaseFrame<T>> {
        self.base.as_ref()
    }

    /// Boom on an elastic base frame.
    ///
    /// # Errors
    ///
    /// [`LayoutError::Count`] when the boom's type has no room for one more coordinate; those of
    /// up to three segments never have.
    pub fn on_base(self, base: BaseFrame<T>) -> Result<Self, LayoutError> {
        if N <= EXACT || self.count >= N {
            return Err(LayoutError::Count { asked: self.count + 1, most: N });
        }
        Ok(Self { base: Some(base), ..self })
    }

    /// Always false: a boom has at least one segment.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The segments, from the bearing to the tip.
    pub fn segments(&self) -> &[Segment<T>] {
        &self.segments[..self.len()]
    }

    /// The joints between neighbouring segments, from the bearing to the tip.
    pub fn joints(&self) -> &[Joint<T>] {
        &self.joints[..self.len() - 1]
    }

    /// Converts every parameter to another number type by `f`.
    pub fn map<U>(self, f: &mut impl FnMut(T) -> U) -> Boom<U, N> {
        Boom {
            segments: self.segments.map(|segment| segment.map(&mut *f)),
            joints: self.joints.map(|joint| joint.map(&mut *f)),
            count: self.count,
            base: self.base.map(|base| base.map(&mut *f)),
            mount: self.mount.map(f),
            gravity: f(self.gravity),
        }
    }
}

impl<T: Real, const N: usize> Boom<T, N> {
    /// Kinetic energy \[J\] of segments and base frame, ½ Σ (m v² + J ω²), v that of the centre of mass.
    pub fn kinetic_energy(&self, pose: &Pose<T, N>, state: &BoomState<T, N>) -> T {
        let mut energy = T::zero();
        let (mut vx, mut vy) = (T::zero(), T::zero());
        for i in 0..self.len() {
            let s = &self.segments[i];
            let omega = state.angular_velocity[i];
            let (rx, ry) = pose.centre(i, s);
            let (cx, cy) = (vx - ry * omega, vy + rx * omega);
            let square = s.mass * (cx.square() + cy.square()) + s.inertia * omega.square();
            energy = energy + T::lit(0.5) * square;
            let (dx, dy) = pose.along(i, s);
            (vx, vy) = (vx - dy * omega, vy + dx * omega);
        }
        if let Some(base) = &self.base {
            let omega = state.angular_velocity[self.len()];
            energy = energy + T::lit(0.5) * base.inertia * omega.square();
        }
        energy
    }

    /// Gravitational potential energy \[J\], Σ m g y; zero with every centre of mass level with the bearing.
    pub fn gravitational_energy(&self, pose: &Pose<T, N>) -> T {
        let mut energy = T::zero();
        let mut height = T::zero();
        for i in 0..self.len() {
            let s = &self.segments[i];
            energy = energy + s.mass * self.gravity * (height + pose.centre(i, s).1);
            height = height + pose.along(i, s).1;
        }
        energy
    }

    /// Elastic energy \[J\] of the joints' springs, ½ Σ k_C (φ_{i+1} − φ_i − δ_i)², and of the base frame.
    pub fn elastic_energy(&self, state: &BoomState<T, N>) -> T {
        let mut energy = T::zero();
        for i in 0..self.len() - 1 {
            let joint = &self.joints[i];
            let bend = (state.angle[i + 1] - state.angle[i]) - joint.rest;
            energy = energy + T::lit(0.5) * joint.stiffness * bend.square();
        }
        if let Some(base) = &self.base {
            energy = energy + base.elastic_energy(state.angle[self.len()]);
        }
        energy
    }

    /// Power \[W\] dissipated by the dampers of the joints, Σ b_C (φ̇_{i+1} − φ̇_i)², and of the base frame, b ψ̇².
    pub fn damping_loss(&self, state: &BoomState<T, N>) -> T {
        let mut power = T::zero();
        for i in 0..self.len() - 1 {
            let rate = state.angular_velocity[i + 1] - state.angular_velocity[i];
            power = power + self.joints[i].damping * rate.square();
        }
        if let Some(base) = &self.base {
            power = power + base.damping * state.angular_velocity[self.len()].square();
        }
        power
    }
}

impl<T: Real, const N: usize> BoomState<T, N> {
    /// State with all angles \[rad\] and angular velocities \[rad/s\] zero: a horizontal boom at rest.
    pub fn zero() -> Self {
        Self { angle: [T::zero(); N], angular_velocity: [T::zero(); N] }
    }
}
