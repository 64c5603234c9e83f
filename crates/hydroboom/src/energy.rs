//! `hydroboom energy`

use crate::{crane_file::CraneFile, output};
use clap::Args;
use hydroboom_lab::energy_audit::{Audit, audit};
use hydroboom_lab::study::IMPLICIT_STEP;
use hydroboom_model::Scheme;
use miette::{IntoDiagnostic, Result};
use serde_json::json;

/// Audit the energy of a fast motion cycle: change = work - losses + mass defects.
#[derive(Args)]
#[command(after_help = "Example: hydroboom energy --step-us 500,250")]
pub struct Energy {
    #[command(flatten)]
    crane: CraneFile,
    /// Steps of the linearly implicit scheme.
    #[arg(long, value_delimiter = ',', default_values_t = [4.0 * IMPLICIT_STEP * 1e6, 2.0 * IMPLICIT_STEP * 1e6, IMPLICIT_STEP * 1e6])]
    step_us: Vec<f64>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Energy {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let description = self.crane.read()?;
        let audits: Vec<Audit> = self
            .step_us
            .iter()
            .map(|us| audit(&description, Scheme::LinearlyImplicit, us * 1e-6).into_diagnostic())
            .collect::<Result<_>>()?;
        match self.json {
            true => output::json(&json!({ "energy": audits })),
            false => output::text(&table(&audits)),
        }
    }
}

/// The audits as a table.
pub fn table(audits: &[Audit]) -> String {
    let rows: Vec<Vec<String>> = audits
        .iter()
        .map(|a| {
            vec![
                format!("{:.0}", a.step_us),
                format!("{:.3}", a.change_j),
                format!("{:.3}", a.work_j),
                format!("{:.3}", a.losses_j),
                format!("{:.3}", a.defects_j),
                format!("{:.1}", a.exchanged_j),
                format!("{:.2e}", a.relative_residual),
            ]
        })
        .collect();
    let header = [
        "step [us]",
        "change [J]",
        "work [J]",
        "losses [J]",
        "defects [J]",
        "exchanged [J]",
        "residual/exchanged",
    ];
    format!("Energy over one fast cycle\n{}", output::table(&header, &rows))
}
