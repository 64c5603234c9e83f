//! Integration tests of the crate, one program.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

mod balance;
mod c;
mod compilers;
mod cortex_m;
mod course;
mod evaluator;
mod fmi;
mod frame;
mod names;
mod on_plc;
mod recording;
mod repeats;
mod scheduled_lqr;
mod structured_text;
