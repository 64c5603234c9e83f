//! `hydroboom linearise`

use crate::{crane_file::CraneFile, output};
use clap::Args;
use hydroboom_lab::{linearise, plant};
use hydroboom_model::{Input, Outputs, Scheme};
use miette::{IntoDiagnostic, Result};
use serde_json::json;
use std::fmt::Write;
use std::path::PathBuf;

/// Linearise the crane at an operating point: A, B, C, D and poles, with exact derivatives.
#[derive(Args)]
#[command(after_help = "Example: hydroboom linearise --stroke-mm 200 --valve 0 --out lin")]
pub struct Linearise {
    #[command(flatten)]
    crane: CraneFile,
    /// Piston position.
    #[arg(long, default_value_t = 250.0)]
    stroke_mm: f64,
    /// Motor speed.
    #[arg(long, default_value_t = 0.0, allow_hyphen_values = true)]
    motor_speed_rpm: f64,
    /// 3/2 valve: 1 energised, 0 load held.
    #[arg(long, default_value_t = 1.0, value_parser = valve)]
    valve: f64,
    /// Write A.csv, B.csv, C.csv and D.csv into this folder.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// A valve position from the command line.
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
        let crane = plant(&description, &start, Scheme::Implicit, 1e-3).into_diagnostic()?;
        let input = Input { pump_speed: self.motor_speed_rpm / 60.0, holding_valve: self.valve };
        let (a, b) = crane.jacobian(&input);
        let c = crane.output_jacobian();
        let states = crane.state_names();
        let outputs = Outputs::NAMES.map(String::from);
        let modes = linearise::modes(&a).into_diagnostic()?;
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
            std::fs::create_dir_all(folder).into_diagnostic()?;
            for (name, rows, row_names, columns) in &matrices {
                let mut csv = format!("row,{}\n", columns.join(","));
                for (row, label) in rows.iter().zip(row_names.iter()) {
                    let cells: Vec<String> = row.iter().map(|v| format!("{v:e}")).collect();
                    // a String takes every write
                    let _ = writeln!(csv, "{label},{}", cells.join(","));
                }
                output::file(&folder.join(format!("{name}.csv")), csv.as_bytes())?;
            }
        }
        if self.json {
            return output::json(&json!({
                "states": states, "outputs": outputs, "input": "pump_speed_rev_s",
                "A": matrices[0].1, "B": matrices[1].1, "C": matrices[2].1, "D": matrices[3].1,
                "modes": modes,
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
        output::text(&format!(
            "Poles at {:.0} mm, slowest first\n{}",
            self.stroke_mm,
            output::table(&["real [1/s]", "imag [rad/s]", "f [Hz]", "damping"], &rows)
        ))
    }
}
