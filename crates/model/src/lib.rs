//! An electro-hydraulic crane with a flexible boom, written once over any scalar.
//!
//! A [`Crane`] holds parameters and never changes during a run; a [`CraneState`] is all that does.
//! [`Crane::derivative`] reads like the equations of Hagen et al., *Real-Time Simulation-Based Control of
//! an Electro-Hydraulic Flexible Manipulator* (Actuators 2025, 14, 80, doi:10.3390/act14020080), with their
//! numbers. [`stepping`] integrates it, [`energy`] checks it.
//!
//! SI units throughout: m, rad, kg, s, N, Pa, m³, rev/s. Pressures are gauge; only the gas law
//! adds the atmosphere. x to the right, y up, angles absolute from the x axis and
//! counter-clockwise; the origin is the boom's bearing. Piston motion, force and velocity are
//! positive outwards.
#![no_std]
// code of the control cycle cannot panic
#![deny(
    clippy::disallowed_methods,
    clippy::expect_used,
    clippy::panic,
    clippy::todo,
    clippy::unimplemented,
    clippy::unreachable
)]

pub mod boom;
pub mod circuit;
mod crane;
pub mod drive;
pub mod energy;
mod equilibrium;
pub mod hydraulics;
mod lifted;
mod simulation;
pub mod stepping;
mod validity;

pub use boom::{Beam, Boom, BoomState, Geometry, LayoutError, MAX_SEGMENTS};
pub use circuit::{
    Circuit, CircuitState, Flows, Nodes, SelfContained, ValveCircuitState, ValveControlled,
    ValveInput,
};
pub use crane::{Crane, CraneRates, CraneState, Input, Outputs};
pub use equilibrium::{EquilibriumError, Start, ValveCraneState, ValveStart};
pub use simulation::{Scheme, Simulation, SimulationError};
pub use stepping::{StepBound, StepLimit};
pub use validity::{Invalid, Validity};
