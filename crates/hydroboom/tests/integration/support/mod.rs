//! The program as a user starts it, a run with a dashboard, a browser for it, and a crane.

pub mod browser;
pub mod command;
pub mod run;
pub mod short_crane;
