//! Circuits: how components, nodes and lines are connected.

mod self_contained;

pub use self_contained::{CircuitState, Flows, Nodes, SelfContained};
