//! `hydroboom linearise`

use crate::number;
use crate::paths::OutputFolder;
use crate::{crane_file::CraneFile, output};
use clap::Args;
use hydroboom_description::Description;
use hydroboom_lab::mat_file::{Matrix, mat_file};
use hydroboom_lab::{Plant, linearise, plant, report};
use hydroboom_model::{Input, Outputs, Scheme};
use miette::{IntoDiagnostic, Result};
use serde_json::json;
use std::fmt::Write;

/// Linearise the crane at an operating point: A, B, C, D, poles and frequency responses, with exact
/// derivatives.
#[derive(Args)]
#[command(
    after_help = "Example: hydroboom linearise --stroke-mm 200 --motor-speed-rpm 600 --out lin"
)]
pub struct Linearise {
    #[command(flatten)]
    crane: CraneFile,
    /// Piston position, before the crane moves: 0 to 20000 mm.
    #[arg(long, default_value_t = 250.0, value_parser = number::within(number::STROKE, "mm"))]
    stroke_mm: f64,
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

/// Outputs in the frequency responses: label, name, and the displayed unit in SI units.
const SHOWN: [(&str, &str, f64); 4] = [
    ("v_cyl [mm/s]", "velocity", 1e3),
    ("p_A [bar]", "pressure_a", 1e-5),
    ("p_PA [bar]", "pressure_pump_a", 1e-5),
    ("tip deflection [mm]", "tip_deflection", 1e3),
];

/// Parses a valve position.
pub fn valve(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|v| (0.0..=1.0).contains(v))
        .ok_or_else(|| format!("the valve is 0 (load held) to 1 (energised), not {text}"))
}

impl Linearise {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let description = self.crane.read()?;
        let start = description.start(self.stroke_mm * 1e-3);
        let mut crane = plant(&description, &start, Scheme::Implicit, 1e-3).into_diagnostic()?;
        let input = Input { pump_speed: self.motor_speed_rpm / 60.0, holding_valve: self.valve };
        let settle = self.settle_s.unwrap_or(if self.motor_speed_rpm == 0.0 { 0.0 } else { 1.0 });
        let swing = settled(crane.as_mut(), &input, (settle * 1e3).round() as u32)?;
        let here = crane.outputs();
        let stroke_mm = here.stroke * 1e3;
        let (a, b) = crane.jacobian(&input);
        let c = crane.output_jacobian();
        let states = crane.state_names();
        let outputs = Outputs::NAMES.map(String::from);
        let modes = linearise::modes(&a).into_diagnostic()?;
        let dead_band = match self.valve > 0.0 && linearise::in_dead_band(&a, &states) {
            true => Some(self.dead_band(&description)),
            false => None,
        };
        let oscillation = (swing > STEADY * here.pressure_a).then(|| {
            format!(
                "The motion is not steady: p_A changes by {:.1} bar within the last half second. The matrices are of one instant of that oscillation, with the \
                 oil's stiffness at {:.1} bar; their damping is not that of a steady motion. --settle-s takes another instant.",
                swing * 1e-5,
                here.pressure_a * 1e-5
            )
        });
        let is_growing = |m: &&linearise::Mode| m.imaginary == 0.0 && m.real > GROWING;
        let filling = dead_band.as_ref().and(modes.iter().find(is_growing)).map(|m| {
            format!(
                "The growing real pole of {:.3} 1/s is the accumulator's pressure, which leakage raises while the cylinder is shut.",
                m.real
            )
        });
        let in_dead_band = dead_band.is_some();
        let remarks: Vec<String> =
            [dead_band, filling, oscillation].into_iter().flatten().collect();
        let rows_of = |m: &dyn Fn(usize, usize) -> f64, rows: usize, columns: usize| {
            (0..rows)
                .map(|i| (0..columns).map(|j| m(i, j)).collect::<Vec<f64>>())
                .collect::<Vec<_>>()
        };
        let n = states.len();
        let matrices = [
            ("A", rows_of(&|i, j| a[(i, j)], n, n), &states[..], &states[..]),
            ("B", rows_of(&|i, j| b[(i, j)], n, 1), &states[..], &["pump_speed_rev_s".into()]),
            ("C", rows_of(&|i, j| c[(i, j)], outputs.len(), n), &outputs[..], &states[..]),
            (
                "D",
                rows_of(&|_, _| 0.0, outputs.len(), 1),
                &outputs[..],
                &["pump_speed_rev_s".into()],
            ),
        ];
        if let Some(folder) = &self.out {
            output::folder(folder);
            for (name, rows, row_names, columns) in &matrices {
                let mut csv = format!("row,{}\n", columns.join(","));
                for (row, label) in rows.iter().zip(row_names.iter()) {
                    let cells: Vec<String> = row.iter().map(|v| format!("{v:e}")).collect();
                    // writing to a String cannot fail
                    let _ = writeln!(csv, "{label},{}", cells.join(","));
                }
                output::file(&folder.join(format!("{name}.csv")), csv.as_bytes());
            }
            let mat: Vec<Matrix<'_>> =
                matrices.iter().map(|(name, rows, ..)| Matrix { name, rows }).collect();
            let input = ["pump_speed_rev_s".to_string()];
            let names =
                [("states", &states[..]), ("outputs", &outputs[..]), ("inputs", &input[..])];
            output::file(&folder.join("crane.mat"), &mat_file(&mat, &names));
            // per rpm of motor speed
            let shown: Vec<(&str, usize, f64)> = SHOWN
                .iter()
                .filter_map(|(name, output, factor)| {
                    let row = Outputs::NAMES.iter().position(|known| known == output)?;
                    Some((*name, row, factor / 60.0))
                })
                .collect();
            let title = format!(
                "{}: frequency responses at {:.0} mm, {:.0} rpm, valve {}",
                description.name, stroke_mm, self.motor_speed_rpm, self.valve
            );
            let page = report::bode_page(&title, &a, &b, &c, &shown, &modes).into_diagnostic()?;
            output::page_in_folder(folder, "bode", &page, None);
        }
        if self.json {
            return output::json(&json!({
                "states": states, "outputs": outputs, "input": "pump_speed_rev_s",
                "A": matrices[0].1, "B": matrices[1].1, "C": matrices[2].1, "D": matrices[3].1,
                "modes": modes, "in_dead_band": in_dead_band,
                "stroke_mm": stroke_mm, "piston_velocity_mm_s": here.velocity * 1e3,
                "pressure_a_bar": here.pressure_a * 1e-5, "pressure_change_bar": swing * 1e-5,
                "remark": (!remarks.is_empty()).then(|| remarks.join("\n")),
            }));
        }
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
        let remark: String = remarks.iter().map(|remark| format!("\n\n{remark}")).collect();
        output::text(&format!(
            "Poles at {stroke_mm:.0} mm, {:.0} rpm, valve {}, p_A = {:.1} bar, piston at {:.1} mm/s; slowest first\n{}{remark}",
            self.motor_speed_rpm,
            self.valve,
            here.pressure_a * 1e-5,
            here.velocity * 1e3,
            output::table(&["real [1/s]", "imag [rad/s]", "f [Hz]", "damping"], &rows)
        ))
    }

    /// Remark on an operating point in the dead band, with another point outside it if there is one.
    fn dead_band(&self, description: &Description) -> String {
        let said = "This operating point lies in the dead band of the load-holding valve: between cracking and closing no oil passes, and a \
                    small change of the motor's speed moves nothing. The poles are those of a cylinder that is shut.";
        let n = &description.numbers;
        let slow = n.slow * description.cylinder().piston_area / (n.displacement * n.flow_gain);
        let speeds = [slow, 2.0 * slow, 4.0 * slow, 0.5 * n.motor_speed, n.motor_speed];
        let moves = |speed: &f64| {
            let start = description.start(self.stroke_mm * 1e-3);
            let mut crane = plant(description, &start, Scheme::Implicit, 1e-3).ok()?;
            let input = Input { pump_speed: *speed, holding_valve: self.valve };
            crane.advance(&input, SETTLING).ok()?;
            let (a, _) = crane.jacobian(&input);
            (!linearise::in_dead_band(&a, &crane.state_names())).then_some(60.0 * speed)
        };
        match speeds.iter().filter(|speed| **speed <= n.motor_speed).find_map(moves) {
            Some(rpm) => format!(
                "{said}\nWith the valve open: hydroboom linearise{} --stroke-mm {:.0} --motor-speed-rpm {:.0}, after a second of that motion.",
                self.crane.options(),
                self.stroke_mm,
                rpm.ceil()
            ),
            None => format!("{said}\nNo motor speed from this position opens it within a second."),
        }
    }
}

/// Duration over which the pressure is watched, at the end of the motion before the operating point \[steps
/// of 1 ms\]: a period of a load at 2 Hz.
const WATCHED: u32 = 500;
/// Interval of that \[steps\].
const INTERVAL: u32 = 10;
/// Largest change of the pressure p_A in a steady motion, as a share of it \[-\].
const STEADY: f64 = 0.02;
/// Growth rate from which a real pole is no integrator \[1/s\].
const GROWING: f64 = 1e-3;

/// Moves the crane for so many steps of 1 ms; returns the change of p_A \[Pa\] towards their end.
fn settled(crane: &mut dyn Plant, input: &Input<f64>, steps: u32) -> Result<f64> {
    let watched = steps.min(WATCHED) / INTERVAL;
    crane.advance(input, steps - watched * INTERVAL).into_diagnostic()?;
    let (mut lowest, mut highest) = (f64::INFINITY, f64::NEG_INFINITY);
    for _ in 0..watched {
        crane.advance(input, INTERVAL).into_diagnostic()?;
        let pressure = crane.outputs().pressure_a;
        (lowest, highest) = (lowest.min(pressure), highest.max(pressure));
    }
    Ok((highest - lowest).max(0.0))
}

/// Duration of the motion before the operating point is taken \[steps of 1 ms\].
const SETTLING: u32 = 1000;
