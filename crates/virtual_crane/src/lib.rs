//! A crane that stands in for a real one: the model at high fidelity between the equipment that
//! stands between a controller and a machine.
//!
//! ```text
//! command -> fieldbus -> servo drive, ripple -> pump  \
//!         -> fieldbus -> 3/2 valve, pilot lines       -> model with elastic base, slip, warm and airy oil
//! reading <- fieldbus <- analogue inputs <- sensors   /
//! ```
//!
//! Each part is off where the crane file does not mention it; with all of them off a
//! [`VirtualCrane`] is the model, bit for bit. Nothing it yields is a measurement.

mod air;
mod crane;
mod drive;
mod effect;
mod equipment;
mod fieldbus;
mod fleet;
mod lag;
mod pump;
mod sensor;
mod signals;
mod surrogate;
mod temperature;
mod valve;

pub use crane::VirtualCrane;
pub use effect::Effect;
pub use fleet::Fleet;
pub use signals::Truth;
pub use surrogate::{fieldbus_delay, surrogate};
