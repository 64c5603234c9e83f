//! Hydraulic components, one a file.

mod accumulator;
mod cylinder;
mod friction;
mod oil;
mod orifice;
mod pump;
mod valve;

pub use accumulator::Accumulator;
pub use cylinder::{Cylinder, EndStops};
pub use friction::{Friction, FrictionLaw, LuGre, Stribeck};
pub use oil::Oil;
pub use orifice::{Orifice, in_series, three_in_series};
pub use pump::{Delivery, Pump, Slip};
pub use valve::{CheckValve, PilotCheckValve};
