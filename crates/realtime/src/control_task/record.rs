//! Inputs of a control period, and its record for the log.

use crate::conditions::Conditions;
use crate::machine::{Incoming, Link};
use crate::simulation_task::Simulated;
use hydroboom_control::estimation::reduced_model::MachineState;
use hydroboom_control::estimation::retained_parameters::RetainedParameters;
use hydroboom_control::estimation::tip::TipEstimate;
use hydroboom_control::measurement::{AxisSignals, Measurement};
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::limits::MachineStatus;
use hydroboom_control::supervision::supervisor::{Decision, Request};

/// Inputs of one control period.
#[derive(Clone, Copy, Debug)]
pub struct Period {
    /// Time since the last executed period, by the machine's clock \[s\].
    pub elapsed: f64,
    /// Newest data from the machine; none before the first measurement.
    pub incoming: Option<Incoming>,
    /// State of the simulated crane; none if there is no simulation.
    pub simulated: Option<Simulated>,
    /// Request of the operator to the supervisor.
    pub request: Request,
    /// Requested control strategy.
    pub strategy: Strategy,
    /// Number of control periods missed since the last executed one.
    pub missed: u32,
    /// Whether an operator is present; without one no motion may start.
    pub attended: bool,
    /// Whether the machine's clock jumped backwards or far ahead.
    pub clock_jumped: bool,
    /// Timing of the real-time tasks, which is passed on to the record; none in simulated time.
    pub deadlines: Option<Deadlines>,
}

/// Record of one control period for the log: measurement, estimates, reference, decision and command.
#[derive(Clone, Copy, Debug)]
pub struct Record {
    /// Time since the executive began \[s\].
    pub time: f64,
    /// Time of the course \[s\], negative during the approach to its start; none while the controller's command does
    /// not act on the machine.
    pub course_time: Option<f64>,
    /// Largest reference speed of the course \[m/s\].
    pub course_speed: f64,
    /// Reference position \[m\] and velocity \[m/s\] of the piston.
    pub reference: SetPoint<f64>,
    /// Part of the reference position that is the decaying offset at the start \[m\].
    pub start_offset: f64,
    /// Newest measurement of the machine.
    pub measurement: Measurement,
    /// State that the machine reports; none if it reports none.
    pub status: Option<MachineStatus>,
    /// State of the connection to the machine; none for a machine whose datagrams are not counted.
    pub link: Option<Link>,
    /// State of the simulated crane; none if there is no simulation.
    pub simulated: Option<Simulated>,
    /// Decision of the supervisor, which includes the command that was sent.
    pub decision: Decision,
    /// Active control strategy.
    pub strategy: Strategy,
    /// Reason why the benchmark controller took over; none while the requested strategy is active.
    pub fallback: Option<Fallback>,
    /// Outputs of the state estimator; none before the first measurement and for a crane without a
    /// scheduled LQR.
    pub estimates: Option<Estimates>,
    /// Payload and oil of the simulated crane.
    pub conditions: Conditions,
    /// Timing of the real-time tasks; none in simulated time.
    pub deadlines: Option<Deadlines>,
}

/// Reason why the benchmark controller takes over from another strategy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fallback {
    /// The simulation differs too much from the machine, is delayed, or failed.
    Simulation,
    /// The state estimator diverged, or an estimate is not finite.
    Estimator,
    /// The strategy's command is not finite.
    Command,
    /// There is no scheduled LQR for this crane.
    NoDesign,
}

impl Fallback {
    /// Name in logs and messages, as a short text.
    pub fn name(self) -> &'static str {
        match self {
            Self::Simulation => "simulation-drifted",
            Self::Estimator => "estimator-diverged",
            Self::Command => "command-not-finite",
            Self::NoDesign => "no-design",
        }
    }
}

/// Estimates of the state estimator at the time of the measurement, with their standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimates {
    /// Estimated state, disturbances and parameters, in the units of the record's fields.
    pub state: MachineState<f64>,
    /// Standard deviations of the estimates, in the same units.
    pub deviation: MachineState<f64>,
    /// Estimated parameters with their covariance, with which a later run may start.
    pub parameters: RetainedParameters<f64>,
    /// Innovations of position \[m\] and load pressure \[Pa\].
    pub innovation: [f64; 2],
    /// Standard deviations of the innovations by the filter; NaN where an innovation is zero, as while the
    /// load is held.
    pub innovation_deviation: [f64; 2],
    /// Mean normalised innovation squared (NIS) \[-\]; 1 for a consistent filter.
    pub mean_nis: f64,
    /// Identified time constant of the drive's lag \[s\].
    pub drive_lag: f64,
    /// Estimated position of the boom's tip; none for a crane whose tip is not estimated.
    pub tip: Option<TipEstimate<f64>>,
}

/// Release delays and execution times of the real-time tasks, as the control task reads them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deadlines {
    /// Delay of the control task's last release \[ns\].
    pub control_late: u64,
    /// Execution time of the control task's last period \[ns\].
    pub control_execution: u64,
    /// Number of missed releases of the control task since the start.
    pub control_missed: u64,
    /// Largest release delay of the simulation over about one control period \[ns\].
    pub simulation_late: u64,
    /// Longest execution time of a simulation step over about one control period \[ns\].
    pub simulation_execution: u64,
    /// Number of missed releases of the simulation since the start.
    pub simulation_missed: u64,
}

impl Record {
    /// Measured signals of the axis in the newest measurement.
    pub fn signals(&self) -> &AxisSignals<f64> {
        &self.measurement.axes[0].signals
    }

    /// Measured tracking error x − x_ref \[m\] during the course; none during the approach to its start.
    pub fn error(&self) -> Option<f64> {
        self.course_time
            .filter(|time| *time >= 0.0)
            .map(|_| self.signals().stroke - self.reference.position)
    }
}
