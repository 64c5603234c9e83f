//! Physical properties of the assembled crane that hold for any parameters.
mod boom;
mod circuit;
mod cranes;
mod energy;
mod numbers;
mod rest;
mod stepping;
mod valve;
