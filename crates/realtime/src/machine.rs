//! Machine interface of the executive, implemented by every attachment.

use hydroboom_control::command::{AxisCommand, Command};
use hydroboom_control::measurement::{AXES, Measurement};
use hydroboom_control::supervision::limits::{MachineStatus, ValveState};
use hydroboom_control::supervision::supervisor::Decision;

/// Data from a machine in one control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Incoming {
    /// Signals of the sensors, with their number and sampling time.
    pub measurement: Measurement,
    /// State of the load-holding valve; none if the machine does not measure it.
    pub valve: Option<ValveState>,
    /// State that the machine reports; none if it reports none.
    pub status: Option<MachineStatus>,
    /// State of the connection; none for a machine whose datagrams are not counted.
    pub link: Option<Link>,
}

impl Incoming {
    /// Data of a machine that reports only its sensors and the state of its load-holding valve.
    pub fn new(measurement: Measurement, valve: Option<ValveState>) -> Self {
        Self { measurement, valve, status: None, link: None }
    }
}

/// Losses and delays of the connection to a machine.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Link {
    /// Number of measurements that were sent by the machine and lost, since the session began.
    pub lost: u64,
    /// Number of datagrams that were received and rejected, since the session began.
    pub dropped: u64,
    /// Measured delays; none before a command has acted.
    pub delay: Option<Delay>,
    /// Whether commands do not reach the machine, or the connection has stopped it because commands were missing.
    pub commands_lost: bool,
}

/// Delays between controller and machine, means over about a quarter of a second \[cycles\].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Delay {
    /// Delay from sampling to sending of the measurement \[cycles\].
    pub measurement: f64,
    /// Delay from sampling to actuation \[cycles\]: 0 if the command that answers a measurement acts before the next
    /// sampling.
    pub total: f64,
}

impl Delay {
    /// Delays of measurement and command \[cycles\], rounded; their sum is the rounded total. A negative or NaN delay
    /// counts as 0.
    pub fn cycles(&self) -> [usize; 2] {
        // a negative or NaN delay counts as zero
        let whole = |cycles: f64| cycles.max(0.0).round() as usize;
        let (total, measurement) = (whole(self.total), whole(self.measurement));
        [measurement.min(total), total.saturating_sub(measurement)]
    }
}

/// Command to a machine in one control period, with the enabling of its drives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outgoing {
    /// Commands of drives and valves: motor speeds \[rev/s\] and load-holding valves.
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

    /// Output for a decision of the supervisor.
    pub fn of(decision: &Decision) -> Self {
        Self { command: Command { axes: [decision.command] }, is_enabled: decision.is_enabled() }
    }

    /// Whether all motors are commanded to zero and all loads to be held, with drives enabled or not. A NaN is not
    /// safe.
    pub fn is_safe(&self) -> bool {
        self.command == Self::SAFE.command
    }
}

/// Sensors and actuators of a machine, real or virtual. The real-time cycle calls both functions: they must not
/// allocate, lock or wait.
pub trait Machine: Send {
    /// Newest data; none before the first measurement.
    fn read(&mut self) -> Option<Incoming>;
    /// Sends a command with its sequence number, which increases with every command.
    fn write(&mut self, sequence: u64, outgoing: &Outgoing);
    /// Sends nothing to the machine until the next command, so that its own watchdog acts. Used by commissioning
    /// only.
    fn withhold(&mut self) {}
    /// Resets a fault that the attachment keeps, after a person has removed its cause and confirmed that. A program
    /// never calls it by itself.
    fn reset_by_a_person(&mut self) {}
    /// Begin of the control period that is due at a time of the monotonic clock \[ns\]. It differs from
    /// that time, by half a period at most, if the machine samples by a clock of its own that control has
    /// to follow.
    fn release(&self, due: u64) -> u64 {
        due
    }
}
