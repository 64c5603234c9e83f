//! Integration tests of the crate, one program.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

mod baselines;
mod derivatives;
mod first_controller;
mod independent_plant;
mod learning;
mod log_estimation;
mod physics;
mod published;
