//! Controllers designed from a crane's description, before anything moves.
//!
//! ```text
//! Description -> linear (the crane linearised, its modes and responses)
//!             -> lifting (as it is once the pump lifts)
//!             -> oil_spring (what of that a controller of piston and load pressure sees)
//!             -> model_following (scheduled over stroke and payload), linear_feedback (what it makes of readings)
//!             -> balances (by what is learned of the crane), informed (the description with what was learned)
//!             -> growth (whether a closed loop rings on), margins (how far it is from that), look (all of a design)
//!             -> supervision (limits, monitors and the release of the load)
//! ```

// what runs in the control cycle cannot panic
#![deny(
    clippy::disallowed_methods,
    clippy::expect_used,
    clippy::panic,
    clippy::todo,
    clippy::unimplemented,
    clippy::unreachable
)]

mod balances;
mod error;
mod growth;
mod informed;
mod lifting;
pub mod linear;
mod linear_feedback;
mod look;
mod margins;
mod model_following;
pub mod observability;
mod oil_spring;
pub mod reduced_model_fit;
pub mod scheduled_lqr;
pub mod small_signal_controller;
mod supervision;

pub use balances::{balances, leakage};
pub use error::DesignError;
pub use informed::{informed, overrides};
pub use lifting::{Lifting, Responses};
pub use linear_feedback::LinearFeedback;
pub use look::{Look, look, machine_loops, step_response};
pub use margins::{Loop, Margins, margins};
pub use model_following::{bending, conditions, law, model_following, schedule, stations, under};
pub use oil_spring::oil_spring;
pub use supervision::{
    LoadPressure, framed_benchmark, framed_simulation_feedforward, limits, load_pressure,
};
