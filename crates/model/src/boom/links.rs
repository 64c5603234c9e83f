//! Boom of unequal links, each with its own mass, centre of mass and joint (ours: the paper's boom is a beam).

use super::{Boom, Geometry, Joint, LayoutError, MAX_SEGMENTS, Mount, Segment};
use hydroboom_math::{Real, record};

/// A rigid link of the boom, and the elastic joint at its inner end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link<T> {
    /// Length, mass, centre of mass and moment of inertia of the link.
    pub body: Segment<T>,
    /// Torsional stiffness of the joint to the link before \[N·m/rad\]: a cylinder at rest, a weld, a bend in steel.
    /// The first link turns freely about the bearing.
    pub joint_stiffness: T,
    /// Damping ratio ζ \[1\] of the joint with this link alone on it; 0 is undamped.
    pub joint_damping: T,
    /// Angle to the link before with no moment in the joint \[rad\], counter-clockwise.
    pub joint_angle: T,
}

record! {
    /// Payload on the last segment, in that segment's frame (x along the segment from its inner joint, y across it).
    pub struct Payload<T> {
        /// Mass of the payload
        #[unit = "kg"]
        pub mass: T,
        /// Position of its centre of mass along the segment, from the inner joint
        #[unit = "m"]
        pub x: T,
        /// Position of its centre of mass across the segment, positive upwards
        #[unit = "m"]
        pub y: T,
        /// Moment of inertia about its centre of mass
        #[unit = "kg·m²"]
        pub inertia: T,
    }
}

impl<T: Real> Payload<T> {
    /// A segment with the payload fixed to it: common centre of mass, inertias about that.
    pub(super) fn on(&self, bare: &Segment<T>) -> Segment<T> {
        let together = bare.mass + self.mass;
        let centre_x = (bare.mass * bare.centre_x + self.mass * self.x) / together;
        let centre_y = (bare.mass * bare.centre_y + self.mass * self.y) / together;
        let distance = |x: T, y: T| (x - centre_x).square() + (y - centre_y).square();
        let inertia = bare.inertia
            + bare.mass * distance(bare.centre_x, bare.centre_y)
            + self.inertia
            + self.mass * distance(self.x, self.y);
        Segment { mass: together, centre_x, centre_y, inertia, ..*bare }
    }
}

impl<T: Real, const N: usize> Boom<T, N> {
    /// Joins links to a boom; the first one turns about the bearing and carries the cylinder's mount, the last one the
    /// payload.
    ///
    /// A joint's damping is `b = 2 ζ √(k J)`, J the moment of inertia of its outer link about it, with the payload if
    /// it carries that.
    ///
    /// # Errors
    ///
    /// [`LayoutError::Count`] for no link, or a number of links the boom has no room for.
    pub fn from_links(
        links: &[Link<T>],
        payload: &Payload<T>,
        geometry: &Geometry<T>,
        gravity: T,
    ) -> Result<Self, LayoutError> {
        let count = links.len();
        let fits = if N <= super::EXACT { count == N } else { (1..=N).contains(&count) };
        if !fits {
            return Err(LayoutError::Count { asked: count, most: MAX_SEGMENTS });
        }
        let mut segments = [Segment::from_array([T::zero(); 5]); N];
        for (segment, link) in segments.iter_mut().zip(links) {
            *segment = link.body;
        }
        segments[count - 1] = payload.on(&segments[count - 1]);
        let mut joints = [Joint::from_array([T::zero(); 3]); N];
        for i in 1..count {
            let (link, s) = (&links[i], &segments[i]);
            let inertia = s.inertia + s.mass * (s.centre_x.square() + s.centre_y.square());
            let stiffness = link.joint_stiffness;
            let damping = T::lit(2.0) * link.joint_damping * (stiffness * inertia).sqrt();
            joints[i - 1] = Joint { stiffness, damping, rest: link.joint_angle };
        }
        let mount = Mount {
            segment: 0,
            on_segment: [geometry.mount_x, geometry.mount_y],
            on_base: [geometry.base_x, geometry.base_y],
            shortest: geometry.shortest,
        };
        Ok(Self { segments, joints, count, base: None, mount, gravity })
    }
}
