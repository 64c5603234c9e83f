//! `hydroboom check`

use crate::{crane_file::CraneFile, output};
use clap::Args;
use hydroboom_lab::plant;
use hydroboom_model::Scheme;
use miette::{IntoDiagnostic, Result};
use serde_json::json;

/// Check a crane file: keys, ranges, geometry, static balance, step limits.
#[derive(Args)]
#[command(after_help = "Example: hydroboom check --crane my-crane.toml")]
pub struct Check {
    #[command(flatten)]
    crane: CraneFile,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Check {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let description = self.crane.read()?;
        let numbers = &description.numbers;
        let mut rows = Vec::new();
        let mut values = Vec::new();
        for share in [0.0, 0.5, 1.0] {
            let start = description.start(share * numbers.stroke);
            let crane = plant(&description, &start, Scheme::Implicit, 1e-3).into_diagnostic()?;
            let (outputs, limit) = (crane.outputs(), crane.step_limit());
            rows.push(vec![
                format!("{:.0}", outputs.stroke * 1e3),
                format!("{:.1}", outputs.pressure_a * 1e-5),
                format!("{:.2}", outputs.cylinder_force * 1e-3),
                format!("{:.1}", outputs.tip_deflection * 1e3),
                format!("{:.1}", limit.bending * 1e6),
                format!("{:.1}", limit.friction * 1e6),
                format!("{:.1}", limit.chatter * 1e6),
            ]);
            values.push(json!({
                "stroke_mm": outputs.stroke * 1e3,
                "pressure_a_bar": outputs.pressure_a * 1e-5,
                "cylinder_force_n": outputs.cylinder_force,
                "tip_deflection_mm": outputs.tip_deflection * 1e3,
                "step_limit_us": {
                    "bending": limit.bending * 1e6,
                    "friction": limit.friction * 1e6,
                    "chatter": limit.chatter * 1e6,
                },
            }));
        }
        if self.json {
            return output::json(&json!({
                "crane": description.name,
                "warnings": description.warnings(),
                "at_rest": values,
            }));
        }
        let header = [
            "stroke [mm]",
            "p_A [bar]",
            "F_cyl [kN]",
            "tip [mm]",
            "bending [us]",
            "friction [us]",
            "chatter [us]",
        ];
        output::text(&format!(
            "{}: no errors. At rest, and the published scheme's step limits:\n{}",
            description.name,
            output::table(&header, &rows)
        ))
    }
}
