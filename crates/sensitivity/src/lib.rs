//! Which of a crane's parameters matter, and for what.
//!
//! ```text
//! Case (crane, outputs) -> outputs over any number -> local: exact slopes, by dual numbers
//!                                                 |-> ends: re-run at both ends of what is known of a key
//!                                                 \-> global: Sobol indices, by many runs
//! ```
//!
//! What varies is the machine; its controllers, and the simulation beside it, keep the described parameters: that is how
//! a machine differs from what is known of it.

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
