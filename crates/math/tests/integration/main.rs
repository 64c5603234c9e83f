//! Integration tests of the crate, one program.

mod interpolate;
mod scalars;
