//! Where the piston shall be: trajectories, velocity profiles, their shaping, preview and governor.

pub mod governor;
pub mod input_shaper;
pub mod preview;
pub mod profile;
pub mod smoothing;
pub mod speed_limit;
pub mod trajectory;
