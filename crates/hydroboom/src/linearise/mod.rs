//! `hydroboom linearise`

mod operating_point;
mod state_space;

use crate::crane_file::CraneFile;
use crate::number;
use crate::output;
use crate::paths::OutputFolder;
use clap::Args;
use hydroboom_description::Description;
use hydroboom_lab::{linearise, plant, report};
use hydroboom_model::{Input, Outputs, Scheme};
use miette::{IntoDiagnostic, Result};
use operating_point::{OperatingPoint, settle};
use serde_json::json;
use state_space::StateSpace;

/// Linearise the crane at an operating point: A, B, C, D, poles and frequency responses, with exact
/// derivatives.
#[derive(Args)]
#[command(
    after_help = "Example: hydroboom linearise --stroke-mm 200 --motor-speed-rpm 600 --out lin"
)]
pub struct Linearise {
    #[command(flatten)]
    crane: CraneFile,
    /// Piston position, before the crane moves; mid-stroke when not given: 0 to 20000 mm.
    #[arg(long, value_parser = number::within(number::STROKE, "mm"))]
    stroke_mm: Option<f64>,
    /// Motor speed: -20000 to 20000 rpm.
    #[arg(long, default_value_t = 0.0, value_parser = number::within(number::MOTOR_SPEED, "rpm"))]
    motor_speed_rpm: f64,
    /// Duration of motion under the motor speed before the operating point. Default: 1 s; 0 at zero motor speed.
    #[arg(long, value_parser = number::within(0.0..=3600.0, "s"))]
    settle_s: Option<f64>,
    /// 3/2 valve: 1 energised, 0 load held.
    #[arg(long, default_value_t = 1.0, value_parser = valve)]
    valve: f64,
    /// Write A, B, C and D as CSV and as crane.mat (MATLAB, Octave, SciPy), and bode.html, into this
    /// folder.
    #[arg(long, value_name = "DIR")]
    out: Option<OutputFolder>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Outputs in the frequency responses: label, name, and factor from SI to the unit of display.
const BODE_OUTPUTS: [(&str, &str, f64); 4] = [
    ("v_cyl [mm/s]", "velocity", 1e3),
    ("p_A [bar]", "pressure_a", 1e-5),
    ("p_PA [bar]", "pressure_pump_a", 1e-5),
    ("tip deflection [mm]", "tip_deflection", 1e3),
];

/// Parses the state of the 3/2 valve: 0 (load held) to 1 (energised).
pub fn valve(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|v| (0.0..=1.0).contains(v))
        .ok_or_else(|| format!("the valve is 0 (load held) to 1 (energised), not {text}"))
}

/// Growth rate from which a real pole is no integrator \[1/s\].
const GROWING: f64 = 1e-3;

impl Linearise {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If the crane file is invalid, the crane has no state of rest, its motion cannot be simulated, or its eigenvalues
    /// cannot be computed.
    pub fn run(self) -> Result<()> {
        let description = self.crane.read()?;
        let n = &description.numbers;
        let stroke = self.stroke_mm.map_or(0.5 * n.stroke, |mm| mm * 1e-3);
        let start = description.start(stroke);
        let mut crane = plant(&description, &start, Scheme::Implicit, 1e-3).into_diagnostic()?;
        let input = Input { pump_speed: self.motor_speed_rpm / 60.0, holding_valve: self.valve };
        // a speed equal to the limit but for the rounding of its unit is not beyond it
        if input.pump_speed.abs() > n.motor_speed * (1.0 + 1e-9) {
            output::warn(&format!(
                "--motor-speed-rpm {} is beyond motor.max_speed_rpm = {:.0}: the motor does not reach this operating \
                 point",
                self.motor_speed_rpm,
                n.motor_speed * 60.0
            ));
        }
        let settle_s = self.settle_s.unwrap_or(if self.motor_speed_rpm == 0.0 { 0.0 } else { 1.0 });
        let point = settle(crane.as_mut(), &input, (settle_s * 1e3).round() as u32)?;
        let (a, b) = crane.jacobian(&input);
        let c = crane.output_jacobian();
        let system = StateSpace::new(crane.state_names(), &a, &b, &c);
        let modes = linearise::modes(&a).into_diagnostic()?;
        let in_dead_band = self.valve > 0.0 && linearise::in_dead_band(&a, &system.states);
        let mut remarks = Vec::new();
        if in_dead_band {
            remarks.push(self.remark_on_dead_band(&description, stroke));
            remarks.extend(remark_on_leakage(&modes));
        }
        remarks.extend(point.remark_on_oscillation());
        if let Some(folder) = &self.out {
            output::folder(folder);
            system.write(folder);
            let title = format!(
                "{}: frequency responses at {:.0} mm, {:.0} rpm, valve {}",
                description.name,
                point.stroke_mm(),
                self.motor_speed_rpm,
                self.valve
            );
            let page = report::bode_page(&title, &a, &b, &c, &bode_outputs(), &modes);
            output::page_in_folder(folder, "bode", &page.into_diagnostic()?, None);
        }
        if self.json {
            return output::json(&json!({
                "states": system.states, "outputs": system.outputs, "input": StateSpace::INPUT,
                "A": system.a, "B": system.b, "C": system.c, "D": system.d,
                "modes": modes, "in_dead_band": in_dead_band,
                "stroke_mm": point.stroke_mm(), "piston_velocity_mm_s": point.outputs.velocity * 1e3,
                "pressure_a_bar": point.outputs.pressure_a * 1e-5, "pressure_change_bar": point.pressure_change * 1e-5,
                "remark": (!remarks.is_empty()).then(|| remarks.join("\n")),
            }));
        }
        output::text(&self.text(&point, &modes, &remarks))
    }

    /// Table of the poles, and remarks.
    fn text(
        &self,
        point: &OperatingPoint,
        modes: &[linearise::Mode],
        remarks: &[String],
    ) -> String {
        let rows: Vec<Vec<String>> = modes
            .iter()
            .map(|m| {
                vec![
                    format!("{:.4}", m.real),
                    format!("{:.4}", m.imaginary),
                    format!("{:.4}", m.frequency_hz),
                    format!("{:.5}", m.damping_ratio),
                ]
            })
            .collect();
        let remarks: String = remarks.iter().map(|remark| format!("\n\n{remark}")).collect();
        format!(
            "Poles at {:.0} mm, {:.0} rpm, valve {}, p_A = {:.1} bar, piston at {:.1} mm/s; slowest first\n{}{remarks}",
            point.stroke_mm(),
            self.motor_speed_rpm,
            self.valve,
            point.outputs.pressure_a * 1e-5,
            point.outputs.velocity * 1e3,
            output::table(&["real [1/s]", "imag [rad/s]", "f [Hz]", "damping"], &rows)
        )
    }

    /// Remark on an operating point in the dead band, begun at a piston position \[m\], with another point outside it
    /// if there is one.
    fn remark_on_dead_band(&self, description: &Description, stroke: f64) -> String {
        let remark = "This operating point lies in the dead band of the load-holding valve: between cracking and closing no oil passes, and a \
                    small change of the motor's speed moves nothing. The poles are those of a cylinder that is shut.";
        match operating_point::motor_speed_outside_dead_band(description, stroke, self.valve) {
            Some(speed) => format!(
                "{remark}\nWith the valve open: hydroboom linearise{} --stroke-mm {:.0} --motor-speed-rpm {:.0}, after a second of that motion.",
                self.crane.options(),
                stroke * 1e3,
                (60.0 * speed).ceil()
            ),
            None => {
                format!("{remark}\nNo motor speed from this position opens it within a second.")
            }
        }
    }
}

/// Remark on the pole of the accumulator in the dead band; none without a growing real pole.
fn remark_on_leakage(modes: &[linearise::Mode]) -> Option<String> {
    let growing = modes.iter().find(|m| m.imaginary == 0.0 && m.real > GROWING)?;
    Some(format!(
        "The growing real pole of {:.3} 1/s is the accumulator's pressure, which leakage raises while the cylinder is shut.",
        growing.real
    ))
}

/// Outputs of the frequency responses: label, row of the output matrix, and factor to the unit of display per rpm of
/// motor speed.
fn bode_outputs() -> Vec<(&'static str, usize, f64)> {
    BODE_OUTPUTS
        .iter()
        .filter_map(|(label, output, factor)| {
            let row = Outputs::NAMES.iter().position(|known| known == output)?;
            Some((*label, row, factor / 60.0))
        })
        .collect()
}
