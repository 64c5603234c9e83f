//! Integration tests of the crate, one program.

mod machine;
mod reference;
mod supervisor;
