//! Commissioning: the first motions of a machine, in steps that are each bounded in movement.
//!
//! ```text
//! identity -> listening -> stop circuit -> watchdog -> polarity   the load-holding valve stays shut
//!          -> release -> travel -> delay -> stop distance         under the supervisor
//! ```
//!
//! [`Sequence`](sequence::Sequence) is a state machine over any [`Machine`](crate::machine::Machine): one call a
//! control period, without clock and without allocation. A step that fails sends the safe command and ends the
//! sequence. [`record`] is the file that `hydroboom run` requires before it moves a real machine.
//!
//! It is no safety function: it finds mistakes of wiring, signs, scales and tables.

pub mod finding;
pub mod record;
pub mod sequence;
pub mod settings;
pub mod simulated_machine;
pub mod step;
pub mod task;
pub mod window;
