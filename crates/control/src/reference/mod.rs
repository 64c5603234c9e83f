//! Where the piston shall be: trajectories, velocity profiles, their shaping and preview.

pub mod input_shaper;
pub mod preview;
pub mod profile;
pub mod trajectory;
