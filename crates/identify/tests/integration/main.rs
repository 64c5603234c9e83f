//! Integration tests of the crate, one program.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

mod closed_loop;
mod coverage;
mod fault_isolation;
mod fit;
mod made;
mod nuisance;
mod prediction;
mod segments;
