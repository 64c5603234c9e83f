//! Reference motion, state estimation, feedback and supervision.
//!
//! Parameters live in `self`, memory is passed in: a controller cannot change its own settings,
//! and one set of settings serves any number of runs. Speeds are in rev/s here; rpm belongs to
//! files and screens.
#![cfg_attr(not(test), no_std)]
// code of the control cycle cannot panic
#![deny(
    clippy::disallowed_methods,
    clippy::expect_used,
    clippy::panic,
    clippy::todo,
    clippy::unimplemented,
    clippy::unreachable
)]

pub mod actuator_limits;
pub mod command;
pub mod controller;
pub mod estimation;
pub mod feedback;
pub mod measurement;
pub mod memory;
pub mod reference;
pub mod strategy;
pub mod supervision;
