//! The machine, as the executive sees it: what a fieldbus is attached to.

use hydroboom_control::command::{AxisCommand, Command};
use hydroboom_control::measurement::{AXES, Measurement};
use hydroboom_control::supervision::limits::{MachineStatus, ValveState};
use hydroboom_control::supervision::supervisor::Decision;

/// What comes from a machine in a control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Incoming {
    /// What its sensors show.
    pub measurement: Measurement,
    /// State of the load-holding valve, where the machine can read it.
    pub valve: Option<ValveState>,
    /// State that it reports of itself, where it reports one.
    pub status: Option<MachineStatus>,
    /// What its attachment tells of itself, where it counts.
    pub link: Option<Link>,
}

impl Incoming {
    /// Of a machine that tells its sensors and no more.
    pub fn new(measurement: Measurement, valve: Option<ValveState>) -> Self {
        Self { measurement, valve, status: None, link: None }
    }
}

/// What an attachment tells of itself.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Link {
    /// Measurements that were sent and never arrived, since the session began.
    pub lost: u64,
    /// Datagrams that were dropped, since the session began.
    pub dropped: u64,
    /// Delays; none before a command has acted.
    pub delay: Option<Delay>,
    /// Whether commands do not reach the machine, or the attachment has stopped it for want of commands.
    pub commands_lost: bool,
}

/// Delays of an attachment, means over about the last quarter of a second \[cycles\].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Delay {
    /// From sampling to the measurement's being sent.
    pub measurement: f64,
    /// From sampling to actuation: 0 where the command that answers a measurement acts before the next sampling.
    pub total: f64,
}

impl Delay {
    /// Of measurement and command, in whole cycles.
    pub fn cycles(&self) -> [usize; 2] {
        // what is negative or no number counts as none
        let whole = |cycles: f64| cycles.max(0.0).round() as usize;
        let (total, measurement) = (whole(self.total), whole(self.measurement));
        [measurement.min(total), total.saturating_sub(measurement)]
    }
}

/// What goes to a machine in a control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outgoing {
    /// What drives and valves are to do.
    pub command: Command,
    /// Whether drives are to follow; else they are without torque.
    pub is_enabled: bool,
}

impl Outgoing {
    /// The safe command: motor at zero, load held by its valves, drives without torque.
    pub const SAFE: Self = Self {
        command: Command { axes: [AxisCommand { motor_speed: 0.0, holding_valve: 0.0 }; AXES] },
        is_enabled: false,
    };

    /// What was decided.
    pub fn of(decision: &Decision) -> Self {
        Self { command: Command { axes: [decision.command] }, is_enabled: decision.is_enabled() }
    }

    /// Whether motors are commanded to stand and loads to be held.
    pub fn is_safe(&self) -> bool {
        self.command == Self::SAFE.command
    }
}

/// Sensors and actuators of a machine. Both calls are made in the real-time cycle: they must not
/// allocate, lock or wait.
pub trait Machine: Send {
    /// The newest measurement; none before the first.
    fn read(&mut self) -> Option<Incoming>;
    /// Sends a command, with a number that grows with each.
    fn write(&mut self, sequence: u64, outgoing: &Outgoing);
}
