//! `hydroboom simulate`

use crate::number;
use crate::paths::{InputFile, OutputFile};
use crate::{crane_file::CraneFile, linearise::valve, output};
use clap::{Args, ValueEnum};
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use hydroboom_lab::simulate::{Drive, Recording, Settings, simulate};
use hydroboom_lab::study::IMPLICIT_STEP;
use hydroboom_model::{Input, Outputs, Scheme};
use indicatif::ProgressBar;
use miette::{IntoDiagnostic, Result};
use serde_json::json;

#[derive(Clone, Copy, ValueEnum)]
enum SchemeName {
    Published,
    Implicit,
    RungeKutta4,
}

/// Simulate the crane under a motion, a recorded input or a constant one; write a CSV log.
#[derive(Args)]
#[command(after_help = "Examples:\n  hydroboom simulate --speed-mm-s 120 --log out.csv\n  \
    hydroboom simulate --scenario reversal --log out.csv\n  \
    hydroboom simulate --input drive.csv --log out.csv   (columns time_s, motor_speed_rpm, valve)\n  \
    hydroboom simulate --hold-s 3600 --valve 0 --set friction.law=lugre")]
pub struct Simulate {
    #[command(flatten)]
    crane: CraneFile,
    /// Run the crane file's motion at this speed, under velocity feedforward: 0.1 to 10000 mm/s.
    #[arg(long, conflicts_with_all = ["input", "hold_s"], value_parser = number::within(number::SPEED, "mm/s"))]
    speed_mm_s: Option<f64>,
    /// Run a recorded input: CSV with time_s, motor_speed_rpm and optionally valve.
    #[arg(long, value_name = "FILE", conflicts_with = "hold_s")]
    input: Option<InputFile>,
    /// Run a scenario under velocity feedforward; `hydroboom scenarios` lists them.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["speed_mm_s", "input", "hold_s"])]
    scenario: Option<String>,
    /// Duration of a constant input: 0.001 to 1e7 s.
    #[arg(long, value_parser = number::within(number::DURATION, "s"))]
    hold_s: Option<f64>,
    /// Motor speed of --hold-s: -20000 to 20000 rpm.
    #[arg(long, default_value_t = 0.0, requires = "hold_s", value_parser = number::within(number::MOTOR_SPEED, "rpm"))]
    motor_speed_rpm: f64,
    /// 3/2 valve of --hold-s: 1 energised, 0 load held.
    #[arg(long, default_value_t = 1.0, value_parser = valve)]
    valve: f64,
    /// Piston position to start from; the motion's start when not given: 0 to 20000 mm.
    #[arg(long, value_parser = number::within(number::STROKE, "mm"))]
    start_mm: Option<f64>,
    /// Integration scheme.
    #[arg(long, value_enum, default_value = "implicit")]
    scheme: SchemeName,
    /// Step; by default the scheme's own: 0.1 to 100000 us.
    #[arg(long, value_parser = number::within(number::STEP, "us"))]
    step_us: Option<f64>,
    /// CSV log to write.
    #[arg(long, value_name = "FILE")]
    log: Option<OutputFile>,
    /// Interval of the log: 0.001 to 3600000 ms.
    #[arg(long, default_value_t = 10.0, value_parser = number::within(number::LOG_INTERVAL, "ms"))]
    log_ms: f64,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Simulate {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If an input is invalid, or the state leaves the model's range of validity.
    pub fn run(self) -> Result<()> {
        let description = self.crane.read()?;
        let n = &description.numbers;
        let (scheme, default_step) = match self.scheme {
            SchemeName::Published => (Scheme::Published, n.simulation_period),
            SchemeName::Implicit => (Scheme::Implicit, IMPLICIT_STEP),
            SchemeName::RungeKutta4 => (Scheme::RungeKutta4, 10e-6),
        };
        let drive = match (&self.input, self.hold_s) {
            (Some(path), _) => Drive::Recording(Recording::read(path).into_diagnostic()?),
            (None, Some(duration)) => {
                let input =
                    Input { pump_speed: self.motor_speed_rpm / 60.0, holding_valve: self.valve };
                Drive::Constant(input, duration)
            }
            (None, None) => {
                let speed = number::speed_of_motion(&description, self.speed_mm_s)?;
                let choice = match self.scenario {
                    Some(name) => CourseChoice::Scenario(name),
                    None => CourseChoice::Motion(speed),
                };
                Drive::Course(choice.of(&description).into_diagnostic()?)
            }
        };
        let settings = Settings {
            start_stroke: match (self.start_mm, &drive) {
                (Some(mm), _) => mm * 1e-3,
                (None, Drive::Course(course)) => course.reference(0.0).position,
                (None, _) => n.motion_start,
            },
            scheme,
            step: self.step_us.map_or(default_step, |us| us * 1e-6),
            log_interval: self.log_ms * 1e-3,
            preloaded: !matches!(&drive, Drive::Constant(input, _) if input.holding_valve < 0.5),
        };
        let bar = ProgressBar::new(1000);
        let result = simulate(&description, &drive, &settings, self.log.as_deref(), |share| {
            bar.set_position((share * 1000.0) as u64);
        });
        bar.finish_and_clear();
        let result = result.into_diagnostic()?;
        if let Some(path) = &self.log {
            output::written(path, result.log);
        }
        let crane = result.crane;
        let outputs = crane.outputs();
        // a speed equal to the limit but for the rounding of its unit is not beyond it
        if result.largest_motor_speed > n.motor_speed * (1.0 + 1e-9) {
            output::warn(&format!(
                "the motor turns at up to {:.0} rpm, more than motor.max_speed_rpm = {:.0}: a simulation has no \
                 limits of the motor",
                result.largest_motor_speed * 60.0,
                n.motor_speed * 60.0
            ));
        }
        if self.json {
            let values: serde_json::Map<_, _> = Outputs::NAMES
                .iter()
                .zip(Outputs::UNITS)
                .zip(outputs.to_array())
                .map(|((name, unit), v)| (name.to_string(), json!({"value": v, "unit": unit})))
                .collect();
            return output::json(&json!({
                "time_s": crane.time(), "substeps": crane.substeps(), "outputs": values,
                "largest_motor_speed_rpm": result.largest_motor_speed * 60.0,
                "peak_pressure_bar": result.peak_pressure * 1e-5, "log": self.log,
            }));
        }
        let mut text = format!(
            "after {:.3} s (substeps per step: {}): x_cyl {:.3} mm, v_cyl {:.4} mm/s, p_A {:.2} bar, \
             p_B {:.2} bar, p_PA {:.2} bar, p_PB {:.2} bar, p_acc {:.3} bar; largest motor speed {:.0} rpm, \
             peak pressure {:.1} bar",
            crane.time(),
            crane.substeps(),
            outputs.stroke * 1e3,
            outputs.velocity * 1e3,
            outputs.pressure_a * 1e-5,
            outputs.pressure_b * 1e-5,
            outputs.pressure_pump_a * 1e-5,
            outputs.pressure_pump_b * 1e-5,
            outputs.pressure_accumulator * 1e-5,
            result.largest_motor_speed * 60.0,
            result.peak_pressure * 1e-5,
        );
        if outputs.cavity_volume > 0.0 {
            text += &format!("; CAVITATING, {:.3} mL of vapour", outputs.cavity_volume * 1e6);
        }
        if let Some(log) = &self.log {
            text += &output::named("log", log);
        }
        output::text(&text)
    }
}
