//! `hydroboom eigen`

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
    /// Piston positions.
    #[arg(long, value_delimiter = ',', default_values_t = paper::EIGEN_STROKE_MM)]
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
            false => output::text(&table(&rows)),
        }
    }
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
