//! A run with a dashboard, and a browser to look at it with.

pub mod browser;
pub mod run;
