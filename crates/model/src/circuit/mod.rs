//! Hydraulic circuits: connection of components, pressure nodes and lines. A new circuit is a file with parameters, a
//! state, an input and an `impl` of [`Circuit`].

mod self_contained;
mod valve_controlled;

pub use self_contained::{CircuitState, Flows, Nodes, SelfContained};
pub use valve_controlled::{
    Hose, SpoolValve, TrappedAir, ValveCircuitState, ValveControlled, ValveEdge, ValveFlows,
    ValveInput,
};

use crate::hydraulics::{Cylinder, Oil};
use hydroboom_math::Real;

/// Largest number of pressure-like (stiff) coordinates of a circuit, solved implicitly together.
pub const STIFF: usize = 5;
/// Largest number of other (slow) coordinates of a circuit.
pub const SLOW: usize = 1;

/// State of any circuit as numbers for the integration schemes; coordinates that a circuit lacks are zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coordinates<T> {
    /// Stiff coordinates: node pressures \[Pa\], and states as fast as they, such as a spool's position. The implicit
    /// scheme solves for them with the exact Jacobian.
    pub stiff: [T; STIFF],
    /// Slow coordinates, whose rates hardly depend on themselves, such as the accumulator's gas volume \[m³\].
    pub slow: [T; SLOW],
}

/// Hydraulic circuit that drives the cylinder, over one number type.
pub trait Circuit<T: Real>: Copy + core::fmt::Debug {
    /// State of the circuit (pressures, volumes, spool); also used for its rates of change, each per second.
    type State: Copy + core::fmt::Debug;
    /// Input from outside, such as pump speed or valve command, constant over a step.
    type Input: Copy + core::fmt::Debug;
    /// The circuit in another number type.
    type Over<U: Real>: Circuit<U>;

    /// Oil of the circuit.
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

    /// Converts a state, or its rates, to coordinates.
    fn coordinates(state: &Self::State) -> Coordinates<T>;

    /// Converts coordinates to a state, or to its rates.
    fn from_coordinates(coordinates: &Coordinates<T>) -> Self::State;

    /// Converts every parameter to another number type by `f`.
    fn over<U: Real>(&self, f: &mut impl FnMut(T) -> U) -> Self::Over<U>;

    /// Converts every input to another number type by `f`.
    fn input_over<U: Real>(
        input: &Self::Input,
        f: &mut impl FnMut(T) -> U,
    ) -> <Self::Over<U> as Circuit<U>>::Input;
}
