//! Reference motion and controllers.
//!
//! Parameters live in `self`, memory is passed in: a controller cannot change its own settings,
//! and one set of settings serves any number of runs. Speeds are in rev/s here; rpm belongs to
//! files and screens.
#![cfg_attr(not(test), no_std)]
// what runs in the control cycle cannot panic
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
pub mod reference;
pub mod strategy;
pub mod supervision;

mod attainable;
mod belief;
pub mod boom;
mod carried_load;
pub mod command_lag;
pub mod deviation;
pub mod deviation_memory;
pub mod flow_balance;
pub mod follower;
mod following_feedback;
mod foreseen;
pub mod learner;
mod likelihood;
pub mod load_balance;
pub mod model_following;
pub mod oil_spring;
pub mod oil_stiffness;
pub mod out_of_range;
pub mod out_of_reach;
mod pushed;
pub mod reckoned;
pub mod reserve;
pub mod schedule;
pub mod sooner;
pub mod station;
pub mod stroke_by_pressure;
pub mod way_back;
