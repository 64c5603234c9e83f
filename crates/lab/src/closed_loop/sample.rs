//! Record of one control period of a closed loop, for observers.

use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::AxisSignals;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_virtual_crane::Truth;

/// One control period of a run.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Time \[s\].
    pub time: f64,
    /// Set point of the piston.
    pub reference: SetPoint<f64>,
    /// Measured signals of the plant.
    pub signals: AxisSignals<f64>,
    /// Whether the payload changed at this time.
    pub load_changed: bool,
    /// True state of the plant.
    pub truth: Truth,
    /// Command for the next period.
    pub command: AxisCommand<f64>,
    /// Control periods so far without a solution, in which an earlier command was repeated.
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
