//! Where the piston shall be: trajectories, velocity profiles and their shaping.

pub mod input_shaper;
pub mod profile;
pub mod trajectory;
