//! Circuits: how components, nodes and lines are connected. A new one is a file with parameters, a state,
//! an input and an `impl` of [`Circuit`].

mod self_contained;
mod valve_controlled;

pub use self_contained::{CircuitState, Flows, Nodes, SelfContained};
pub use valve_controlled::{
    Hose, SpoolValve, TrappedAir, ValveCircuitState, ValveControlled, ValveEdge, ValveFlows,
    ValveInput,
};

use crate::hydraulics::{Cylinder, Oil};
use hydroboom_math::Real;

/// The most coordinates of a circuit that a step is solved for.
pub const STIFF: usize = 5;
/// The most other coordinates of a circuit.
pub const SLOW: usize = 1;

/// The state of any circuit for the integration schemes; entries that a circuit does not need stay zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coordinates<T> {
    /// Pressure coordinates \[Pa\], which orifices and oil make stiff, and what moves as fast: the implicit scheme solves
    /// for them, with exact derivatives of each by each.
    pub stiff: [T; STIFF],
    /// All others, whose rates hardly depend on themselves.
    pub slow: [T; SLOW],
}

/// Hydraulic circuit of the cylinder, over one number type.
pub trait Circuit<T: Real>: Copy + core::fmt::Debug {
    /// Its state; also the rates of change of that.
    type State: Copy + core::fmt::Debug;
    /// Its input, constant over a step.
    type Input: Copy + core::fmt::Debug;
    /// The same circuit over another number type.
    type Over<U: Real>: Circuit<U>;

    /// The oil in it.
    fn oil(&self) -> &Oil<T>;

    /// Gauge pressures \[Pa\] on the cylinder's piston side and rod side.
    fn chambers(&self, state: &Self::State) -> (T, T);

    /// Rates of change of its state, with the piston at `stroke` \[m\] moving at `velocity` \[m/s\].
    fn state_rates(
        &self,
        state: &Self::State,
        input: &Self::Input,
        cylinder: &Cylinder<T>,
        stroke: T,
        velocity: T,
    ) -> Self::State;

    /// A state, or rates, in coordinates.
    fn coordinates(state: &Self::State) -> Coordinates<T>;

    /// A state, or rates, from coordinates.
    fn from_coordinates(coordinates: &Coordinates<T>) -> Self::State;

    /// The same circuit over another number type.
    fn over<U: Real>(&self, f: &mut impl FnMut(T) -> U) -> Self::Over<U>;

    /// An input over another number type.
    fn input_over<U: Real>(
        input: &Self::Input,
        f: &mut impl FnMut(T) -> U,
    ) -> <Self::Over<U> as Circuit<U>>::Input;
}
