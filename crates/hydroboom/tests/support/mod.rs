//! Run with a dashboard, and a browser for it.

pub mod browser;
pub mod run;
