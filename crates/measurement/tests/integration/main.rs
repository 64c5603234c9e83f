//! Integration tests of the crate, one program.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

mod cases;
mod exports;
mod logs;
mod mat;
mod mcap;
mod mdf;
mod names;
#[cfg(feature = "parquet")]
mod parquet;
mod plausibility;
mod temporary;
mod times;
mod units;
