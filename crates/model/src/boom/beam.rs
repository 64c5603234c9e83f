//! Lumped-parameter beam: division of a uniform beam into segments and joints (equations (13), (14)).

use super::{Boom, Joint, MAX_SEGMENTS, Mount, Payload, Segment};
use core::fmt;
use hydroboom_math::{Real, record};

record! {
    /// A uniform beam with a payload at its end.
    pub struct Beam<T> {
        /// Length from the bearing to the tip
        #[unit = "m"]
        pub length: T,
        /// Mass of the beam without payload
        #[unit = "kg"]
        pub mass: T,
        /// Flexural rigidity, E I
        #[unit = "N·m²"]
        pub flexural_rigidity: T,
        /// Damping ratio of each joint, ζ
        #[unit = "1"]
        pub damping_ratio: T,
        /// Mass of the payload
        #[unit = "kg"]
        pub payload_mass: T,
        /// Distance of the payload's centre of mass from the bearing, along the beam
        #[unit = "m"]
        pub payload_x: T,
        /// Offset of the payload's centre of mass across the beam, positive upwards
        #[unit = "m"]
        pub payload_y: T,
        /// Moment of inertia of the payload about its centre of mass
        #[unit = "kg·m²"]
        pub payload_inertia: T,
        /// Acceleration of gravity
        #[unit = "m/s²"]
        pub gravity: T,
    }
}

record! {
    /// Positions of bearing, cylinder foot and cylinder mount (Table 1, figure 2).
    pub struct Geometry<T> {
        /// Position of cylinder mount C along the straight boom, from the bearing
        #[unit = "m"]
        pub mount_x: T,
        /// Position of cylinder mount C across the straight boom, positive upwards
        #[unit = "m"]
        pub mount_y: T,
        /// Horizontal position of cylinder foot B, to the right of the bearing
        #[unit = "m"]
        pub base_x: T,
        /// Vertical position of cylinder foot B, above the bearing
        #[unit = "m"]
        pub base_y: T,
        /// Distance from foot B to mount C with the piston at its lower stop, L_cyl,min
        #[unit = "m"]
        pub shortest: T,
    }
}

/// Reason why a boom cannot be divided into segments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LayoutError {
    /// The number of segments is zero, or larger than the boom's type has room for.
    Count {
        /// Requested number of segments.
        asked: usize,
        /// Largest possible number of segments.
        most: usize,
    },
    /// A segment's share of the boom's length is not positive and finite.
    Length {
        /// Index of the segment, counted from the bearing, from 0.
        segment: usize,
    },
}

impl fmt::Display for LayoutError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count { asked, most } => {
                write!(f, "a boom has 1 to {most} segments, not {asked}")
            }
            Self::Length { segment } => {
                write!(f, "the length of segment {} is not a positive number", segment + 1)
            }
        }
    }
}

impl core::error::Error for LayoutError {}

impl<T: Real, const N: usize> Boom<T, N> {
    /// Divides a beam into segments whose lengths are in proportion to `shares`.
    ///
    /// Joints follow `k_C = E I/L_seg` and `b_C = ζ √(4 J_seg k_C)`, with `(L_i + L_{i+1})/2` for L_seg.
    /// J_seg is the mean of both neighbours' moments of inertia about their own inner joint, without
    /// payload (the paper states no point; ours). The payload belongs to the last segment. The mount
    /// belongs to the segment at `mount_share`, its place along the boom as a fraction of the length. The
    /// index of that segment is structure, not a number that can be differentiated.
    ///
    /// # Errors
    ///
    /// [`LayoutError::Count`] for a number of shares the boom has no room for, [`LayoutError::Length`] for a share
    /// that is not positive and finite.
    pub fn from_beam(
        beam: &Beam<T>,
        geometry: &Geometry<T>,
        shares: &[f64],
        mount_share: f64,
    ) -> Result<Self, LayoutError> {
        let count = shares.len();
        let fits = if N <= super::EXACT { count == N } else { (1..=N).contains(&count) };
        if !fits {
            return Err(LayoutError::Count { asked: count, most: MAX_SEGMENTS });
        }
        if let Some(segment) = shares.iter().position(|s| !(*s > 0.0 && s.is_finite())) {
            return Err(LayoutError::Length { segment });
        }
        let total: f64 = shares.iter().sum();
        let half = T::lit(0.5);

        let mut segments = [Segment::from_array([T::zero(); 5]); N];
        for (segment, share) in segments.iter_mut().zip(shares) {
            let length = beam.length * T::lit(share / total);
            let mass = beam.mass * T::lit(share / total);
            *segment = Segment {
                length,
                mass,
                centre_x: half * length,
                centre_y: T::zero(),
                inertia: mass * length.square() / T::lit(12.0),
            };
        }

        let mut joints = [Joint::from_array([T::zero(); 3]); N];
        for i in 0..count - 1 {
            let (inner, outer) = (&segments[i], &segments[i + 1]);
            let about_joint = |s: &Segment<T>| s.inertia + s.mass * s.centre_x.square();
            let stiffness = beam.flexural_rigidity / (half * (inner.length + outer.length));
            let inertia = half * (about_joint(inner) + about_joint(outer));
            let damping = beam.damping_ratio * (T::lit(4.0) * inertia * stiffness).sqrt();
            joints[i] = Joint { stiffness, damping, rest: T::zero() };
        }

        let payload = Payload {
            mass: beam.payload_mass,
            x: beam.payload_x - (beam.length - segments[count - 1].length),
            y: beam.payload_y,
            inertia: beam.payload_inertia,
        };
        segments[count - 1] = payload.on(&segments[count - 1]);

        // the segment under the mount; a mount on a joint belongs to the inner segment
        let mut mount_segment = 0;
        let mut start = 0.0;
        while mount_segment + 1 < count
            && mount_share > (start + shares[mount_segment]) / total * (1.0 + 1e-12)
        {
            start += shares[mount_segment];
            mount_segment += 1;
        }
        let mount = Mount {
            segment: mount_segment,
            on_segment: [geometry.mount_x - beam.length * T::lit(start / total), geometry.mount_y],
            on_base: [geometry.base_x, geometry.base_y],
            shortest: geometry.shortest,
        };
        Ok(Self { segments, joints, count, base: None, mount, gravity: beam.gravity })
    }
}
