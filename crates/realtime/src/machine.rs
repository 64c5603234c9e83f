//! Machine interface of the executive, implemented by every attachment.

use hydroboom_control::command::{AxisCommand, Command};
use hydroboom_control::measurement::{AXES, Measurement};
use hydroboom_control::supervision::limits::{MachineStatus, ValveState};
use hydroboom_control::supervision::supervisor::Decision;

/// Data from a machine in a control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Incoming {
    /// Sensor signals.
    pub measurement: Measurement,
    /// State of the load-holding valve, if the machine measures it.
    pub valve: Option<ValveState>,
    /// State reported by the machine, if it reports one.
    pub status: Option<MachineStatus>,
    /// State of the attachment, if it counts its datagrams.
    pub link: Option<Link>,
}

impl Incoming {
    /// Data of a machine that reports only its sensors and the valve.
    pub fn new(measurement: Measurement, valve: Option<ValveState>) -> Self {
        Self { measurement, valve, status: None, link: None }
    }
}

/// State of an attachment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Link {
    /// Measurements sent by the machine and lost, since the session began.
    pub lost: u64,
    /// Dropped datagrams since the session began.
    pub dropped: u64,
    /// Delays; none before a command has acted.
    pub delay: Option<Delay>,
    /// Whether commands do not reach the machine, or the attachment has stopped it because commands were
    /// missing.
    pub commands_lost: bool,
}

/// Delays of an attachment, means over about a quarter of a second \[cycles\].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Delay {
    /// From sampling to sending of the measurement.
    pub measurement: f64,
    /// From sampling to actuation: 0 if the command that answers a measurement acts before the next
    /// sampling.
    pub total: f64,
}

impl Delay {
    /// Delays of measurement and command in whole cycles; their sum is the total.
    pub fn cycles(&self) -> [usize; 2] {
        // a negative or NaN delay counts as zero
        let whole = |cycles: f64| cycles.max(0.0).round() as usize;
        let (total, measurement) = (whole(self.total), whole(self.measurement));
        [measurement.min(total), total.saturating_sub(measurement)]
    }
}

/// Data to a machine in a control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outgoing {
    /// Commands of drives and valves.
    pub command: Command,
    /// Whether the drives are enabled; otherwise they are without torque.
    pub is_enabled: bool,
}

impl Outgoing {
    /// Safe command: motor at zero, load held by its valves, drives without torque.
    pub const SAFE: Self = Self {
        command: Command { axes: [AxisCommand { motor_speed: 0.0, holding_valve: 0.0 }; AXES] },
        is_enabled: false,
    };

    /// Output of a decision.
    pub fn of(decision: &Decision) -> Self {
        Self { command: Command { axes: [decision.command] }, is_enabled: decision.is_enabled() }
    }

    /// Whether all motors are commanded to zero and all loads to be held.
    pub fn is_safe(&self) -> bool {
        self.command == Self::SAFE.command
    }
}

/// Sensors and actuators of a machine. The real-time cycle calls both functions: they must not allocate,
/// lock or wait.
pub trait Machine: Send {
    /// Newest data; none before the first measurement.
    fn read(&mut self) -> Option<Incoming>;
    /// Sends a command with its sequence number, which increases with every command.
    fn write(&mut self, sequence: u64, outgoing: &Outgoing);
    /// Lets nothing be sent to the machine until the next command, so that its own watchdog acts. Only commissioning
    /// does that.
    fn withhold(&mut self) {}
    /// A person has removed the cause of a fault and confirmed that. For attachments that keep a fault of their own;
    /// never called by a program on its own.
    fn reset_by_a_person(&mut self) {}
    /// When the control period begins that is due at a time of the monotonic clock \[ns\]: another time than that, by
    /// half a period at most, where the machine samples by a clock of its own that control is to follow.
    fn release(&self, due: u64) -> u64 {
        due
    }
}
