//! The machine, as the executive sees it: what a fieldbus is attached to.

use hydroboom_control::signals::{Command, Reading};
use hydroboom_control::supervision::limits::ValveState;

/// A reading and its number, which grows by one with each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Incoming {
    /// Number of the reading.
    pub sequence: u64,
    /// What the sensors show.
    pub reading: Reading<f64>,
    /// State of the load-holding valve, where the machine can read it.
    pub valve: Option<ValveState>,
}

/// Sensors and actuators of a machine. Both calls are made in the real-time cycle: they must not
/// allocate, lock or wait.
pub trait Machine: Send {
    /// The newest reading; none before the first.
    fn read(&mut self) -> Option<Incoming>;
    /// Sends a command, with a number that grows with each.
    fn write(&mut self, sequence: u64, command: &Command<f64>);
}
