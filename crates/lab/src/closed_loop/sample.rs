//! Record of one control period of a closed loop, for observers.

use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::AxisSignals;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_virtual_crane::Truth;

/// One control period of a closed-loop simulation: reference, measurement, true state and command.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Time since the start of the course \[s\].
    pub time: f64,
    /// Reference position \[m\] and velocity \[m/s\] of the piston.
    pub reference: SetPoint<f64>,
    /// Measured signals of the crane, as the controller receives them.
    pub signals: AxisSignals<f64>,
    /// Whether the payload changed in this period.
    pub load_changed: bool,
    /// True state of the crane, without sensor errors and delays.
    pub truth: Truth,
    /// Command of the controller: motor speed \[rev/s\] and load-holding valve.
    pub command: AxisCommand<f64>,
    /// Number of control periods so far in which no solution was found and an earlier command was repeated.
    pub periods_without_solution: u64,
}

impl Sample {
    /// Measured tracking error x − x_ref \[m\].
    pub fn error(&self) -> f64 {
        self.signals.stroke - self.reference.position
    }

    /// True tracking error x − x_ref \[m\].
    pub fn true_error(&self) -> f64 {
        self.truth.outputs.stroke - self.reference.position
    }
}
