//! Range of validity of the model.

use crate::crane::{Crane, CraneState};
use core::fmt;
use hydroboom_math::{LaneMask, Real};

/// Pressures above this \[Pa\] mean that the model, or the machine, has broken: 1000 bar, four
/// times what such cylinders are built for.
const HIGHEST_PRESSURE: f64 = 1000e5;
/// Neighbouring segments bent by more than this \[rad\] have left linear bending: ten degrees.
const LARGEST_BEND: f64 = 0.1745;
/// Depth \[m\] into an end stop beyond which it would have been destroyed.
const DEEPEST_STOP: f64 = 0.02;

/// Conditions for the validity of the model at a state; one truth value per lane.
#[derive(Clone, Copy, Debug)]
pub struct Validity<M> {
    /// Every number is finite.
    pub finite: M,
    /// Every pressure is below 1000 bar, four times what such cylinders are built for.
    pub pressures: M,
    /// Every cavity is smaller than its node.
    pub filled: M,
    /// No joint is bent beyond ten degrees, the end of linear bending, and the first segment has not turned over:
    /// |φ_1| < π.
    pub bending: M,
    /// The piston is within its stroke, or at most 20 mm into a stop.
    pub stroke: M,
}

/// Violated condition for the validity of the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Invalid {
    /// A state is NaN or infinite: the integration diverged.
    NotFinite,
    /// A pressure above 1000 bar.
    Pressure,
    /// A node ran dry: its cavity is as large as its volume.
    Dry,
    /// A joint bent by more than ten degrees, or the boom turned over.
    Bending,
    /// The piston more than 20 mm beyond its stroke.
    Stroke,
}

impl fmt::Display for Invalid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "the simulation diverged: a state is no longer a finite number",
            Self::Pressure => {
                "a pressure rose above 1000 bar: no relief valve, or a piston at its stop"
            }
            Self::Dry => "a node ran dry: more oil was drawn from it than it holds",
            Self::Bending => "a joint of the boom bent by more than 10 degrees",
            Self::Stroke => "the piston went more than 20 mm beyond its stroke",
        })
    }
}

impl core::error::Error for Invalid {}

impl<T: Real, const N: usize> Crane<T, N> {
    /// Checks the conditions for the validity of the model at a state. A state with a NaN is not valid.
    #[inline(always)]
    pub fn validity(&self, state: &CraneState<T, N>) -> Validity<T::Mask> {
        let n = self.boom.len();
        let mut sum = state.bristle + state.circuit.gas_volume;
        let mut largest_bend = T::zero();
        for i in 0..self.boom.coordinates() {
            sum = sum + state.boom.angle[i] + state.boom.angular_velocity[i];
            if i > 0 && i < n {
                let bend = state.boom.angle[i] - state.boom.angle[i - 1];
                let bend = (bend - self.boom.joints()[i - 1].rest).abs();
                largest_bend = largest_bend.max(bend);
            }
        }
        let nodes = state.circuit.nodes.to_array();
        let mut highest = nodes[0];
        let mut lowest = nodes[0];
        for q in nodes {
            sum = sum + q;
            highest = highest.max(q);
            lowest = lowest.min(q);
        }
        // a cavity as large as its node: V_cav = V (p_v − q)/β(p_v)
        let oil = &self.circuit.oil;
        let driest = oil.vapour_pressure - oil.bulk_modulus_min;
        let stroke = self.stroke(state);
        let depth = (-stroke).max(stroke - self.cylinder.stroke_length);
        Validity {
            finite: sum.is_finite(),
            pressures: highest.lt(T::lit(HIGHEST_PRESSURE)),
            filled: driest.lt(lowest),
            bending: largest_bend.lt(T::lit(LARGEST_BEND))
                & state.boom.angle[0].abs().lt(T::lit(core::f64::consts::PI)),
            stroke: depth.lt(T::lit(DEEPEST_STOP)),
        }
    }

    /// Piston position \[m\].
    #[inline(always)]
    fn stroke(&self, state: &CraneState<T, N>) -> T {
        let pose = self.boom.pose(&state.boom.angle);
        self.boom.cylinder_pose(&pose).stroke
    }
}

impl<const W: usize> Validity<LaneMask<W>> {
    /// The validity of each lane.
    pub fn to_lanes(self) -> [Validity<bool>; W] {
        let [finite, pressures, filled, bending, stroke] =
            [self.finite, self.pressures, self.filled, self.bending, self.stroke]
                .map(LaneMask::to_array);
        core::array::from_fn(|lane| Validity {
            finite: finite[lane],
            pressures: pressures[lane],
            filled: filled[lane],
            bending: bending[lane],
            stroke: stroke[lane],
        })
    }
}

impl Validity<bool> {
    /// Checks the conditions in their order.
    ///
    /// # Errors
    ///
    /// The first violated condition, in the order of [`Invalid`].
    pub fn check(self) -> Result<(), Invalid> {
        match self {
            Self { finite: false, .. } => Err(Invalid::NotFinite),
            Self { pressures: false, .. } => Err(Invalid::Pressure),
            Self { filled: false, .. } => Err(Invalid::Dry),
            Self { bending: false, .. } => Err(Invalid::Bending),
            Self { stroke: false, .. } => Err(Invalid::Stroke),
            _ => Ok(()),
        }
    }
}
