//! Integration tests of the crate, one program.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

mod crane_file_reference;
mod crane_files;
mod digest;
mod mutations;
mod ranges;
mod virtual_crane;
