//! Sensitivity of tracking errors, pressures and eigenfrequency to the parameters of a crane.
//!
//! ```text
//! Case (crane, outputs) -> outputs over any number -> local: exact slopes, by dual numbers
//!                                                 |-> ends: re-run at both ends of a key's uncertainty interval
//!                                                 \-> global: Sobol indices, by many runs
//! ```
//!
//! Only the machine's parameters vary. Its controllers and the simulation beside it keep the nominal ones: this is the
//! model mismatch between a real crane and its description.

mod case;
mod closed_loop;
mod ends;
mod error;
mod global;
mod local;
mod output;
mod ringing;

pub use case::Case;
pub use ends::{at_ends, end_values, with_value};
pub use error::SensitivityError;
pub use global::{Index, Sobol, Study, sobol};
pub use local::{Local, local};
pub use output::Output;
