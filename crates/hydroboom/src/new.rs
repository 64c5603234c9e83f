//! `hydroboom new`

use crate::benchmark_gains::tuned_text;
use crate::output;
use crate::paths::OutputFile;
use clap::Args;
use clap::ValueEnum;
use hydroboom_description::{Description, PATU_LIFT, as_placeholders};
use miette::Result;
use std::path::Path;

/// Circuit described by the crane file.
#[derive(Clone, Copy, ValueEnum)]
enum Circuit {
    /// A pump of its own: the paper's crane.
    SelfContained,
    /// A 4/3 valve on a supply, and a boom of links: the lift of a forestry crane.
    ValveControlled,
}

/// Comment above the sections that the published crane omits.
const EQUIPMENT: &str = "\
# Drive, switching valve, sensors and fieldbus of the machine: not published, typical values. The model
# has none of these; the machine that stands in for the real one (hydroboom run, motion --plant virtual)
# has them all.
";

/// Source of the values filled in for a self-contained crane.
const PAPERS_CRANE: &str = "the paper's crane";
/// Source of the values filled in for a valve-controlled crane.
const PATU_CRANE: &str = "a PATU forestry crane";

/// Comment at the top: meaning of the provenance of values filled in from a source.
fn head_comment(source: &str) -> String {
    format!(
        "# provenance \"placeholder\": the number is that of {source} and not yet of your machine; once its value is edited it counts as given.\n"
    )
}

/// Comment above the supervision limits.
const SUPERVISION: &str = "\
# Limits of the supervision; `hydroboom supervision` shows what else follows from this file.
# holding_valve.check_function = \"none\": a shut load-holding valve blocks flow in both directions.
# switching_valve.position_switch = \"fitted\": its state is measured.
";

/// Write a complete crane file to start from: the paper's crane, or one on a proportional valve.
#[derive(Args)]
#[command(
    after_help = "Example: hydroboom new my-crane.toml\n  hydroboom new my-lift.toml --circuit valve-controlled"
)]
pub struct New {
    /// File to write; it must not exist.
    file: OutputFile,
    /// Circuit that moves the cylinder.
    #[arg(long, value_enum, default_value = "self-contained")]
    circuit: Circuit,
    /// Print what was written as JSON.
    #[arg(long)]
    json: bool,
}

/// Hint on the benchmark's gains: how to design them for the described crane. The file contains those
/// for its filled-in values.
fn gains_hint(circuit: Circuit, name: &str) -> String {
    match circuit {
        Circuit::SelfContained => format!(
            "\nIts benchmark has gains for the numbers in it; those for your crane: hydroboom design --benchmark --crane {name} --crane-out {}",
            Path::new(name).with_extension("gains.toml").display()
        ),
        // there is no controller for it
        Circuit::ValveControlled => String::new(),
    }
}

impl New {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If the file exists, or the design of its benchmark gains fails.
    pub fn run(self) -> Result<()> {
        if self.file.exists() {
            miette::bail!(
                help = "choose another name, or remove it first",
                "{} exists already",
                self.file.display()
            );
        }
        let text = match self.circuit {
            Circuit::SelfContained => {
                let crane = Description::uia_single_boom()?;
                let (equipment, supervision) = (crane.equipment_text(), crane.supervision_text());
                let filled_in = as_placeholders(&tuned_text(&crane)?, PAPERS_CRANE);
                format!(
                    "{}{filled_in}\n{EQUIPMENT}{equipment}\n{SUPERVISION}{supervision}",
                    head_comment(PAPERS_CRANE)
                )
            }
            Circuit::ValveControlled => {
                format!("{}{}", head_comment(PATU_CRANE), as_placeholders(PATU_LIFT, PATU_CRANE))
            }
        };
        if !output::file(&self.file, text.as_bytes()) {
            return Ok(());
        }
        let name = self.file.display().to_string();
        match self.json {
            true => output::json(&serde_json::json!({ "written": name })),
            false => output::text(&format!(
                "wrote {name}; edit it, then: hydroboom check --crane {name}{}",
                gains_hint(self.circuit, &name)
            )),
        }
    }
}
