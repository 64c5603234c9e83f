//! The program as a user starts it, a run with a dashboard, a browser for it, a crane, the study, and schemas of JSON.

pub mod browser;
pub mod command;
pub mod json_schema;
pub mod run;
pub mod short_crane;
pub mod study;
