//! A controller of one's own on the virtual crane: velocity feedforward with a proportional position loop.
//!
//! ```sh
//! cargo run --release -p hydroboom-lab --example first_controller
//! ```

use hydroboom_control::command::Command;
use hydroboom_control::controller::{Controller, ControllerStatus, SimulatedState};
use hydroboom_control::measurement::Measurement;
use hydroboom_control::reference::preview::Preview;
use hydroboom_description::Description;
use hydroboom_lab::LabError;
use hydroboom_lab::closed_loop::simulation::simulate_controller;

/// Velocity feedforward with a proportional position loop.
struct PositionController {
    /// Pump revolutions per metre of piston travel \[rev/m\].
    revolutions_per_metre: f64,
    /// Gain: piston velocity per position error \[1/s\].
    gain: f64,
}

impl Controller for PositionController {
    fn start(&mut self, _: &Measurement, _: u32) {}

    fn update(
        &mut self,
        measurement: &Measurement,
        preview: &Preview<f64>,
        _: Option<&SimulatedState>,
    ) -> Command {
        let reference = preview.now();
        let error = reference.position - measurement.axes[0].signals.stroke;
        let velocity = reference.velocity + self.gain * error;
        Command::released([self.revolutions_per_metre * velocity])
    }

    fn status(&self) -> ControllerStatus {
        ControllerStatus { is_closed_loop: self.gain > 0.0, ..ControllerStatus::default() }
    }
}

/// RMS of the true tracking error \[m\] on the virtual crane, at the fast speed of its file.
pub fn rms_error(gain: f64) -> Result<f64, Box<dyn std::error::Error>> {
    let (model, crane) = (Description::uia_single_boom()?, Description::uia_virtual()?);
    let revolutions_per_metre = model.benchmark().revolutions_per_metre;
    let controller = Box::new(PositionController { revolutions_per_metre, gain });
    let course = model.motion(model.numbers.fast);
    let (mut sum, mut count) = (0.0, 0.0);
    simulate_controller(&model, &crane, ("my controller", controller), &course, |sample| {
        sum += sample.true_error().powi(2);
        count += 1.0;
        Ok::<(), LabError>(())
    })?;
    Ok(f64::sqrt(sum / count))
}

/// Compared gains \[1/s\].
pub const GAINS: [f64; 4] = [0.0, 0.5, 1.0, 2.0];

/// Printed line of a gain \[1/s\] with its error \[m\].
pub fn line(gain: f64, rms_error: f64) -> String {
    format!("gain {gain} 1/s: true RMS error {:.2} mm\n", 1e3 * rms_error)
}

#[allow(dead_code, reason = "a test takes the rest of this file")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    for gain in GAINS {
        print!("{}", line(gain, rms_error(gain)?));
    }
    Ok(())
}
