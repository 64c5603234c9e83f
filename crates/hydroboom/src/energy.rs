//! `hydroboom energy`

use crate::number;
use crate::{crane_file::CraneFile, output};
use clap::Args;
use hydroboom_lab::energy_audit::{Audit, PUMP_WORK, audit};
use hydroboom_lab::numerical_damping::{NumericalDamping, numerical_damping};
use hydroboom_lab::study::IMPLICIT_STEP;
use hydroboom_model::Scheme;
use miette::{IntoDiagnostic, Result};
use serde_json::json;

/// Check the energy balance of a fast motion cycle (change = pump work - losses + mass defects), and measure the
/// numerical damping of the integration schemes.
#[derive(Args)]
#[command(after_help = "Example: hydroboom energy --step-us 500,250")]
pub struct Energy {
    #[command(flatten)]
    crane: CraneFile,
    /// Steps of the implicit scheme: 0.1 to 100000 us.
    #[arg(long, value_delimiter = ',', default_values_t = [2.0 * IMPLICIT_STEP * 1e6, IMPLICIT_STEP * 1e6, 0.5 * IMPLICIT_STEP * 1e6], value_parser = number::within(number::STEP, "us"))]
    step_us: Vec<f64>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Energy {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If the crane file is invalid, or a simulation fails.
    pub fn run(self) -> Result<()> {
        let description = self.crane.read()?;
        let audits: Vec<Audit> = self
            .step_us
            .iter()
            .map(|us| audit(&description, Scheme::Implicit, us * 1e-6).into_diagnostic())
            .collect::<Result<_>>()?;
        let damping = numerical_damping(&description).into_diagnostic()?;
        match self.json {
            true => output::json(
                &json!({ "energy": { "audits": audits, "numerical_damping": damping } }),
            ),
            false => output::text(&format!("{}\n\n{}", table(&audits), damping_table(&damping))),
        }
    }
}

/// Table of the energy balances \[J\]: change = pump work − losses + mass defects, and the residual.
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
        "pump work [J]",
        "losses [J]",
        "defects [J]",
        "exchanged [J]",
        "residual/exchanged",
    ];
    format!("Energy over one fast cycle\n{}\n{PUMP_WORK}", output::table(&header, &rows))
}

/// Table of numerical damping \[-\] and order of the schemes.
fn damping_table(schemes: &[NumericalDamping]) -> String {
    let rows: Vec<Vec<String>> = schemes
        .iter()
        .map(|s| {
            vec![
                s.scheme.clone(),
                format!("{:.0}", s.step_us),
                format!("{:.2e}", s.damping_ratio),
                format!("{:.2e}", s.frequency_error),
                output::optional(s.order, 2),
            ]
        })
        .collect();
    let header = ["scheme", "step [us]", "damping ratio", "frequency error", "order"];
    format!(
        "What the time step adds to the lowest mode of a crane without losses, load held\n{}",
        output::table(&header, &rows)
    )
}
