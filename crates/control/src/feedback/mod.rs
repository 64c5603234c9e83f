//! Feedback laws and their filters.

pub mod benchmark;
pub mod filter;
pub mod inverse_dynamics;
pub mod published_strategy;
pub mod riccati;
pub mod rollout;
pub mod saturation;
pub mod scheduled_lqr;
pub mod scheduled_lqr_controller;
