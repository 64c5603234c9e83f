//! Limits of a machine, and observations of a control period for the supervisor.

use super::drive_monitor::DriveMonitor;
use super::flow_monitor::FlowMonitor;
use super::release::Release;
use super::supervisor::CONTROLLED_RAMP;
use crate::measurement::AxisSignals;
use core::f64::consts::TAU;

/// Limits of a machine and settings of its monitors, from a crane file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Control period \[s\].
    pub period: f64,
    /// Length of the stroke \[m\].
    pub stroke: f64,
    /// Smallest distance of a moving piston from the end stops \[m\].
    pub margin: f64,
    /// Largest speed of the piston \[m/s\].
    pub speed: f64,
    /// Piston speed per motor speed, D/A \[m/rev\].
    pub speed_per_motor_speed: f64,
    /// Largest pressure of a node, gauge \[Pa\].
    pub pressure: f64,
    /// Largest displacement of a held load \[m\].
    pub creep: f64,
    /// Largest motor speed \[rev/s\].
    pub motor_speed: f64,
    /// Largest acceleration of the motor \[rev/s²\].
    pub motor_slew: f64,
    /// Duration of a controlled stop \[s\].
    pub stop_time: f64,
    /// Watchdog time \[s\]: without a command for longer the drive stops and the valve shuts by themselves.
    pub watchdog: f64,
    /// Condition for a load at rest: piston speed below the first number \[m/s\] for the second \[s\], a period of
    /// the load mode.
    pub still: (f64, f64),
    /// Longest time for which a state waits for its conditions \[s\].
    pub wait_time: f64,
    /// Largest age of the newest measurement \[s\].
    pub stale: f64,
    /// Time after which a signal that repeats itself to the last bit counts as stuck \[s\]; zero where sensors have
    /// no noise.
    pub stuck: f64,
    /// Largest scatter between measurements, RMS over 64 of them: of the position \[m\], of a pressure \[Pa\].
    pub scatter: (f64, f64),
    /// Largest step of a pressure between two measurements \[Pa\].
    pub pressure_step: f64,
    /// Largest disagreement of pump-side and cylinder pressure behind an open valve \[Pa\], and its duration until it
    /// is a fault \[s\].
    pub pressure_agreement: (f64, f64),
    /// Largest number of missed control periods, or of lost measurements, in the deadline monitor's window.
    pub missed: u32,
    /// Longest time from the valve's command until it has switched \[s\].
    pub valve_time: f64,
    /// Monitor of the drive.
    pub drive: DriveMonitor<f64>,
    /// Monitor of position against delivered flow.
    pub flow: FlowMonitor,
    /// Release of the load.
    pub release: Release<f64>,
}

impl Limits {
    /// Distance from an end stop \[m\] at which a controlled stop has to begin, for a piston that approaches it with
    /// `velocity` \[m/s\].
    ///
    /// It is |`velocity`| times the [`stopping_time`](Self::stopping_time), and [`margin`](Self::margin) at least.
    pub fn end_margin(&self, velocity: f64) -> f64 {
        self.margin.max(velocity.abs() * self.stopping_time())
    }

    /// Stopping distance of a controlled stop per piston speed \[s\].
    ///
    /// It is the sum of half the motor's ramp, the watchdog time, and the oscillation v/ω of the stopped load in its
    /// mode.
    pub fn stopping_time(&self) -> f64 {
        0.5 * CONTROLLED_RAMP * self.stop_time + self.watchdog + self.still.1 / TAU
    }
}

/// State of the load-holding valve by its position switch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ValveState {
    /// Shut: the load is held.
    Shut,
    /// Open: the load is released.
    Open,
}

/// State that a machine reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MachineStatus {
    /// No report.
    Absent,
    /// Starting up.
    Starting,
    /// Measuring, with its drives without torque.
    Ready,
    /// Drives follow commands.
    Enabled,
    /// Fault, to be reset by a person at the machine.
    Fault {
        /// Code of the fault, defined by the machine.
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

/// Inputs of the supervisor in a control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Time since the last executed period, by the machine's clock \[s\]. Where it is not positive and finite, the
    /// clock counts as jumped.
    pub elapsed: f64,
    /// Newest measurement.
    pub reading: AxisSignals<f64>,
    /// State of the load-holding valve; `None` if the machine has no position switch.
    pub valve: Option<ValveState>,
    /// Reported state of the machine; `None` if it reports none.
    pub machine: Option<MachineStatus>,
    /// Age of the measurement \[s\].
    pub age: f64,
    /// Number of measurements since the last control period: normally one, zero if none arrived, more if some were
    /// missed.
    pub new_readings: u32,
    /// Number of measurements that were sent since the last control period and never arrived.
    pub lost_readings: u32,
    /// Whether commands do not reach the machine, or its watchdog has stopped it.
    pub commands_lost: bool,
    /// Reference position \[m\]; before a course begins, its start position. NaN is a tracking error while the
    /// controller is active.
    pub reference: f64,
    /// Largest tracking error of the active strategy \[m\].
    pub tracking: f64,
    /// Motor speed requested by the controller \[rev/s\]. A value that is not finite is a fault while the controller
    /// is active.
    pub wanted: f64,
    /// Whether the course has ended.
    pub course_over: bool,
    /// Number of missed control periods since the last executed one.
    pub missed: u32,
    /// Whether an operator is present.
    pub attended: bool,
    /// Whether the clock went backwards, or far ahead.
    pub clock_jumped: bool,
}
