//! Reference motion of the piston: trajectories, velocity profiles, input shaping, preview and reference governor.

pub mod governor;
pub mod input_shaper;
pub mod preview;
pub mod profile;
pub mod smoothing;
pub mod speed_limit;
pub mod trajectory;
