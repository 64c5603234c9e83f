//! Integration tests of the crate, one program.

mod c_header;
mod datagrams;
