//! Integration tests of the crate, one program.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

mod commissioning;
mod faults;
mod flow_baseline;
mod hand_over;
mod local_machine;
mod lockstep;
mod machine_examples;
mod release;
mod replay;
mod requests;
mod session;
