//! Feedback laws and their filters.

pub mod benchmark;
pub mod filter;
