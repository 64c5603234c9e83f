//! What a machine is allowed to do, and what is observed of it in a control period.

use super::drive_monitor::DriveMonitor;
use super::flow_monitor::FlowMonitor;
use super::release::Release;
use super::supervisor::CONTROLLED_RAMP;
use crate::measurement::AxisSignals;
use core::f64::consts::TAU;

/// What is allowed, and the numbers of the monitors: all from a crane file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Control period \[s\].
    pub period: f64,
    /// Length of the stroke \[m\].
    pub stroke: f64,
    /// Distance from the end stops that a moving piston keeps \[m\].
    pub margin: f64,
    /// Largest speed of the piston \[m/s\].
    pub speed: f64,
    /// Piston speed for each motor speed \[m/rev\].
    pub speed_per_motor_speed: f64,
    /// Largest pressure \[Pa\].
    pub pressure: f64,
    /// Largest movement of a held load \[m\].
    pub creep: f64,
    /// Largest motor speed \[rev/s\].
    pub motor_speed: f64,
    /// Largest motor slew \[rev/s²\].
    pub motor_slew: f64,
    /// Duration of a controlled stop \[s\].
    pub stop_time: f64,
    /// Time without a command after which the drive stops by itself and the valve shuts \[s\].
    pub watchdog: f64,
    /// A load is still once its piston has been slower than this \[m/s\] for so long \[s\], a period
    /// of the load mode.
    pub still: (f64, f64),
    /// Time for which a state waits for what it needs before it gives up \[s\].
    pub wait_time: f64,
    /// Age of the newest reading \[s\] that is too old.
    pub stale: f64,
    /// A signal that repeats itself to the last bit for so long is stuck \[s\]; zero where sensors have
    /// no noise.
    pub stuck: f64,
    /// Largest scatter from one reading to the next, RMS over 64 of them: of position \[m\], of a
    /// pressure \[Pa\].
    pub scatter: (f64, f64),
    /// Largest step from one reading to the next of a pressure \[Pa\].
    pub pressure_step: f64,
    /// Largest disagreement of pump-side and cylinder pressure behind an open valve \[Pa\], and for
    /// how long \[s\].
    pub pressure_agreement: (f64, f64),
    /// Missed periods within the deadline monitor's window that are too many.
    pub missed: u32,
    /// Time from the valve's command until it has switched at the latest \[s\].
    pub valve_time: f64,
    /// The drive's monitor.
    pub drive: DriveMonitor<f64>,
    /// The monitor of position against delivered flow.
    pub flow: FlowMonitor,
    /// The release of the load.
    pub release: Release<f64>,
}

impl Limits {
    /// Distance from an end stop \[m\] at which a piston that moves towards it with `velocity` \[m/s\] has to
    /// be stopped: a controlled stop ends before it.
    pub fn end_margin(&self, velocity: f64) -> f64 {
        self.margin.max(velocity.abs() * self.stopping_time())
    }

    /// Way of a controlled stop for each speed \[s\]: half of its ramp, the drive and the readings at the latest, and what
    /// a stopped load swings on, v/ω of its mode.
    pub fn stopping_time(&self) -> f64 {
        0.5 * CONTROLLED_RAMP * self.stop_time + self.watchdog + self.still.1 / TAU
    }
}

/// State of the load-holding valve, where a machine can read it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ValveState {
    /// The load is held.
    Shut,
    /// The load is released.
    Open,
}

/// State that a machine reports of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MachineStatus {
    /// Nothing is known of it.
    Absent,
    /// It starts.
    Starting,
    /// It measures, and its drives are without torque.
    Ready,
    /// Its drives follow commands.
    Enabled,
    /// A fault, which a person resets at the machine.
    Fault {
        /// The machine's code of it.
        code: u16,
    },
}

impl MachineStatus {
    /// Name in logs and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Absent => "absent",
            Self::Starting => "starting",
            Self::Ready => "ready",
            Self::Enabled => "enabled",
            Self::Fault { .. } => "fault",
        }
    }
}

/// What the supervisor observes in a control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Time since the last executed period, by the machine's clock \[s\].
    pub elapsed: f64,
    /// Newest reading.
    pub reading: AxisSignals<f64>,
    /// State of the load-holding valve, as read; none where the machine cannot read it.
    pub valve: Option<ValveState>,
    /// State that the machine reports; none where it reports none.
    pub machine: Option<MachineStatus>,
    /// Age of the reading \[s\].
    pub age: f64,
    /// Readings that were made since the one seen last: one in good times, none where nothing came, more
    /// where some were missed.
    pub new_readings: u32,
    /// Measurements that were sent since the one seen last and never arrived.
    pub lost_readings: u32,
    /// Whether commands do not reach the machine, or its attachment has stopped it for want of commands.
    pub commands_lost: bool,
    /// Reference position \[m\]; the position of the start before the course begins.
    pub reference: f64,
    /// Largest tracking error under the strategy at work \[m\].
    pub tracking: f64,
    /// Motor speed that the controller asks for \[rev/s\].
    pub wanted: f64,
    /// Whether the course is over.
    pub course_over: bool,
    /// Periods missed since the last executed one.
    pub missed: u32,
    /// Whether an operator is present.
    pub attended: bool,
    /// Whether the clock went back, or far ahead.
    pub clock_jumped: bool,
}
