//! Virtual crane: the high-fidelity model together with the equipment between a controller and a real crane. It
//! replaces the machine in tests.
//!
//! ```text
//! command -> fieldbus -> servo drive, ripple -> pump  \
//!         -> fieldbus -> 3/2 valve, pilot lines       -> model: elastic base, slip, oil temperature and air
//! reading <- fieldbus <- analogue inputs <- sensors   /
//! ```
//!
//! Each effect is off if the crane file does not contain its keys. With all effects off a [`VirtualCrane`] equals the
//! model, bit for bit. Its results are simulated, not measured.

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
