//! Supervision: the state machine that releases, holds and stops the load, its limits, its fault
//! causes, and the plausibility checks of the measurements.

mod fault;
mod limits;
mod plausibility;
mod supervisor;

pub use fault::Cause;
pub use limits::{Limits, Observation};
pub use supervisor::{Decision, Request, SOFT_STOP, State, Supervisor};
