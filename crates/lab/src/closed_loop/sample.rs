//! A control period of a closed loop, for whoever looks on.

use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::AxisSignals;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_virtual_crane::Truth;

/// One control period of a run.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Time \[s\].
    pub time: f64,
    /// Where the piston should be.
    pub reference: SetPoint<f64>,
    /// What was measured of the plant.
    pub signals: AxisSignals<f64>,
    /// Whether another payload was hung on at this time.
    pub load_changed: bool,
    /// The plant itself.
    pub truth: Truth,
    /// The command for the next period.
    pub command: AxisCommand<f64>,
    /// Control periods so far in which the controller could compute no command, and took one of before.
    pub periods_without_solution: u64,
}

impl Sample {
    /// Tracking error x − x_ref \[m\], as the controller sees it.
    pub fn error(&self) -> f64 {
        self.signals.stroke - self.reference.position
    }

    /// True tracking error x − x_ref \[m\], of the piston itself.
    pub fn true_error(&self) -> f64 {
        self.truth.outputs.stroke - self.reference.position
    }
}
