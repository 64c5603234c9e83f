//! The machine, as the executive sees it: what a fieldbus is attached to.

use hydroboom_control::command::Command;
use hydroboom_control::measurement::Measurement;
use hydroboom_control::supervision::limits::ValveState;

/// What comes from a machine in a control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Incoming {
    /// What its sensors show.
    pub measurement: Measurement,
    /// State of the load-holding valve, where the machine can read it.
    pub valve: Option<ValveState>,
}

/// Sensors and actuators of a machine. Both calls are made in the real-time cycle: they must not
/// allocate, lock or wait.
pub trait Machine: Send {
    /// The newest measurement; none before the first.
    fn read(&mut self) -> Option<Incoming>;
    /// Sends a command, with a number that grows with each.
    fn write(&mut self, sequence: u64, command: &Command);
}
