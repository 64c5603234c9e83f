//! A controller of one's own on the virtual crane: velocity feedforward with a proportional position loop.
//!
//! ```sh
//! cargo run --release -p hydroboom-lab --example first_controller                    # the paper's virtual crane
//! cargo run --release -p hydroboom-lab --example first_controller -- my-crane.toml   # that of a crane file
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

/// Model for the controller, and virtual crane: of a crane file, or the paper's without one. Equipment that the file
/// omits has typical values, which are printed.
fn model_and_crane(file: Option<&str>) -> Result<[Description; 2], Box<dyn std::error::Error>> {
    let Some(file) = file else {
        return Ok([Description::uia_single_boom()?, Description::uia_virtual()?]);
    };
    let text = std::fs::read_to_string(file).map_err(|error| format!("{file}: {error}"))?;
    let model = Description::parse(file, &text)?;
    let (crane, filled_in) = model.virtual_crane();
    for typical in &filled_in {
        println!("typical: {typical}");
    }
    Ok([model, crane])
}

/// RMS of the true tracking error \[m\] of a virtual crane along the motion of the model's file, at its fast speed.
fn rms_error_on(
    model: &Description,
    crane: &Description,
    gain: f64,
) -> Result<f64, Box<dyn std::error::Error>> {
    let revolutions_per_metre = model.benchmark().revolutions_per_metre;
    let controller = Box::new(PositionController { revolutions_per_metre, gain });
    let course = model.motion(model.numbers.fast);
    let (mut sum, mut count) = (0.0, 0.0);
    simulate_controller(model, crane, ("my controller", controller), &course, |sample| {
        sum += sample.true_error().powi(2);
        count += 1.0;
        Ok::<(), LabError>(())
    })?;
    Ok(f64::sqrt(sum / count))
}

/// The same on the paper's virtual crane.
#[allow(dead_code, reason = "a test compares it with the paper's velocity feedforward")]
pub fn rms_error(gain: f64) -> Result<f64, Box<dyn std::error::Error>> {
    let [model, crane] = model_and_crane(None)?;
    rms_error_on(&model, &crane, gain)
}

/// Compared gains \[1/s\].
pub const GAINS: [f64; 4] = [0.0, 0.5, 1.0, 2.0];

/// Printed line of a gain \[1/s\] with its error \[m\].
pub fn line(gain: f64, rms_error: f64) -> String {
    format!("gain {gain} 1/s: true RMS error {:.2} mm\n", 1e3 * rms_error)
}

#[allow(dead_code, reason = "a test takes the rest of this file")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = std::env::args().nth(1);
    let [model, crane] = model_and_crane(file.as_deref())?;
    for gain in GAINS {
        print!("{}", line(gain, rms_error_on(&model, &crane, gain)?));
    }
    Ok(())
}
