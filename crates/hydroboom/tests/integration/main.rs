//! Integration tests of the crate, one program.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

mod bounds;
mod commands;
mod commission;
mod dashboard;
mod documents;
mod export;
mod files_out;
mod json_schemas;
mod local_machine;
mod readings;
mod result_tables;
mod round_trips;
mod running;
mod support;
mod tuning;
mod verdicts;
