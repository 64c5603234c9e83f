//! Physical properties of the assembled crane that hold for any parameters.
#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

mod boom;
mod circuit;
mod cranes;
mod energy;
mod numbers;
mod rest;
mod stepping;
mod valve;
