//! `hydroboom eigen`

use crate::number;
use crate::{crane_file::CraneFile, output};
use clap::Args;
use hydroboom_lab::{eigenfrequency, paper};
use miette::{IntoDiagnostic, Result};
use serde_json::json;

/// Eigenfrequencies with the load held: oscillation test and linearised crane, beside Table 5.
#[derive(Args)]
#[command(after_help = "Example: hydroboom eigen --stroke-mm 100,200,400 --set boom.segments=10")]
pub struct Eigen {
    #[command(flatten)]
    crane: CraneFile,
    /// Piston positions: 0 to 20000 mm.
    #[arg(long, value_delimiter = ',', default_values_t = paper::EIGEN_STROKE_MM, allow_negative_numbers = true, value_parser = number::within(number::STROKE, "mm"))]
    stroke_mm: Vec<f64>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Eigen {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let description = self.crane.read()?;
        let rows: Vec<eigenfrequency::Row> = self
            .stroke_mm
            .iter()
            .map(|stroke| eigenfrequency::row(&description, stroke * 1e-3).into_diagnostic())
            .collect::<Result<_>>()?;
        match self.json {
            true => output::json(&json!({ "eigenfrequency": rows })),
            false => {
                output::text(&format!("{}\n\n{}\n\n{}", table(&rows), DIFFERENCE, shapes(&rows)))
            }
        }
    }
}

/// Why the columns differ.
const DIFFERENCE: &str = "\
Without friction, oscillation and linearisation are the same thing seen twice. With it, the oscillation
dies out within a few periods, while the linearisation sees the smoothed friction law as it is at rest: a
stiff damper that all but locks the piston, so that only the boom bends.";

/// Every oscillatory mode with its shape.
fn shapes(rows: &[eigenfrequency::Row]) -> String {
    let cells: Vec<Vec<String>> = rows
        .iter()
        .flat_map(|row| row.modes.iter().map(move |shaped| (row.stroke_mm, shaped)))
        .map(|(stroke, shaped)| {
            let angles: Vec<String> = shaped.angles.iter().map(|a| format!("{a:.2}")).collect();
            vec![
                format!("{stroke:.0}"),
                format!("{:.3}", shaped.mode.frequency_hz),
                format!("{:.5}", shaped.mode.damping_ratio),
                format!("{:.2}", shaped.pressure_a_bar_per_deg),
                angles.join(" "),
            ]
        })
        .collect();
    let header = ["x_cyl [mm]", "f [Hz]", "damping", "p_A [bar/deg]", "segments' angles"];
    format!(
        "Modes of the linearised crane, friction off; swings relative to the outermost segment's angle\n{}",
        output::table(&header, &cells)
    )
}

/// Table 5, "paper | here".
pub fn table(rows: &[eigenfrequency::Row]) -> String {
    let cells: Vec<Vec<String>> = rows
        .iter()
        .map(|r| {
            vec![
                format!("{:.0}", r.stroke_mm),
                output::optional(r.paper_measured_hz, 2),
                output::optional(r.paper_simulated_hz, 2),
                format!("{:.3}", r.linearised_hz),
                format!("{:.3}", r.frictionless_hz),
                format!("{:.3}", r.oscillation_hz),
                format!("{:.3}", r.linearised_with_friction_hz),
            ]
        })
        .collect();
    let header = [
        "x_cyl [mm]",
        "paper measured",
        "paper simulated",
        "linearised",
        "oscillation",
        "osc. with friction",
        "lin. with friction",
    ];
    format!(
        "Table 5: eigenfrequencies [Hz], load held; friction off unless said\n{}",
        output::table(&header, &cells)
    )
}
