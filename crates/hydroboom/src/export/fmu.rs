//! `hydroboom export fmu`

use super::{flops, warn_of_unstable};
use crate::crane_file::CraneFile;
use crate::output;
use crate::paths::OutputFile;
use clap::{Args, ValueEnum};
use hydroboom_export::fmi::{System, Version, archive, binary, twincat_settings, unit};
use hydroboom_export::{
    controller, crane_model, scheduled_lqr_controller, simulation_feedforward, slopes,
};
use hydroboom_measurement::digest_of;
use miette::{IntoDiagnostic, Result};
use serde_json::json;

/// Content of an FMU.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum FmuContent {
    /// Crane: inputs motor speed and valve; outputs position, pressures and forces.
    Model,
    /// The same under another name: a controlled plant that differs from the model.
    Plant,
    /// Benchmark controller: inputs reference and measurements; output motor speed.
    Controller,
    /// The same with the simulated crane, whose motor speed is the feedforward.
    SimulationFeedforward,
    /// Scheduled LQR with its state estimator; a preview of the reference is a further input.
    ScheduledLqr,
    /// Refused: it is exported no more.
    #[value(hide = true)]
    ModelFollowing,
}

impl FmuContent {
    /// Names of all contents that are exported, separated by commas.
    fn exported() -> String {
        let all = Self::value_variants().iter().filter_map(Self::to_possible_value);
        let shown = all.filter(|value| !value.is_hide_set());
        let names: Vec<String> = shown.map(|value| value.get_name().to_string()).collect();
        names.join(", ")
    }
}

/// Write an FMU for co-simulation (FMI 2.0 or 3.0) with its C source and a binary for Linux, and one for Windows if
/// MinGW is installed.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom export fmu --what model --out crane.fmu\n  hydroboom export fmu --what plant \
    --set payload.mass_kg=340 --out plant.fmu\n  docs/how-to/export-fmi.md shows how it is used"
)]
pub struct Fmu {
    #[command(flatten)]
    crane: CraneFile,
    /// Content of the FMU.
    #[arg(long, value_enum)]
    what: FmuContent,
    /// Version of FMI.
    #[arg(long, value_parser = ["2", "3"], default_value = "2")]
    fmi: String,
    /// File to write.
    #[arg(long, value_name = "FILE")]
    out: OutputFile,
    /// Settings for TwinCAT's FMI target (TE1420), which compiles the FMU's source: a file for its folder.
    #[arg(long, value_name = "FILE")]
    twincat_settings: Option<OutputFile>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Fmu {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If the crane file is invalid, the crane cannot be exported, or a C compiler fails.
    pub fn run(self) -> Result<()> {
        let crane = self.crane.read()?;
        warn_of_unstable(&crane)?;
        let (block, slopes) = match self.what {
            FmuContent::Controller => (controller(&crane).into_diagnostic()?, None),
            FmuContent::SimulationFeedforward => {
                (simulation_feedforward(&crane).into_diagnostic()?, None)
            }
            FmuContent::ScheduledLqr => (scheduled_lqr_controller(&crane).into_diagnostic()?, None),
            FmuContent::ModelFollowing => miette::bail!(
                "--what model-following: model following has been replaced by scheduled-lqr; today --what is one of {}",
                FmuContent::exported()
            ),
            FmuContent::Model | FmuContent::Plant => {
                let mut block = crane_model(&crane).into_diagnostic()?;
                if self.what == FmuContent::Plant {
                    block.name = "plant".into();
                }
                let slopes = slopes(&crane, &block).into_diagnostic()?;
                (block, Some(slopes))
            }
        };
        let version = if self.fmi == "3" { Version::Three } else { Version::Two };
        let unit = unit(&block, slopes.as_ref(), &crane, version).into_diagnostic()?;
        let folder = std::env::temp_dir().join(format!("hydroboom-fmu-{}", std::process::id()));
        let binaries = System::ALL
            .into_iter()
            .filter_map(|system| {
                let library = binary(&unit, system, &folder.join(system.name())).transpose()?;
                Some(library.map(|library| (system, library)))
            })
            .collect::<Result<Vec<_>, _>>();
        // an error of the removal has no consequence
        let _ = std::fs::remove_dir_all(&folder);
        let binaries = binaries.into_diagnostic()?;
        let bytes = archive(&unit, &binaries).into_diagnostic()?;
        let systems: Vec<&str> = binaries.iter().map(|(system, _)| system.name()).collect();
        output::file(&self.out, &bytes);
        let mut files = vec![(self.out.clone(), bytes)];
        if let Some(path) = self.twincat_settings {
            let settings = twincat_settings().into_bytes();
            output::file(&path, &settings);
            files.push((path, settings));
        }
        let flops = flops(&[block]).into_diagnostic()?;
        if self.json {
            return output::json(&json!({
                "files": files.iter().map(|(file, bytes)| {
                    json!({ "file": file, "bytes": bytes.len(), "sha256": digest_of(bytes) })
                }).collect::<Vec<_>>(),
                "model_identifier": unit.identifier, "fmi": format!("{}.0", self.fmi), "binaries": systems,
                "flops": flops.iter().map(|(name, flops)| json!({ "entry": name, "flops": flops })).collect::<Vec<_>>(),
            }));
        }
        let content = match systems.is_empty() {
            false => format!("its source and a binary for {}", systems.join(" and ")),
            true => "its source; no C compiler (cc) was found for a binary".into(),
        };
        output::text(&format!(
            "{}: {} bytes, {} of FMI {}.0 with {content}",
            self.out.display(),
            files[0].1.len(),
            unit.identifier,
            self.fmi
        ))
    }
}
