//! `hydroboom export st`

use super::{File, warn_of_unstable, write_files};
use crate::crane_file::CraneFile;
use crate::paths::OutputFolder;
use clap::Args;
use hydroboom_export::structured_text::{Unit, in_single_precision, plcopen, twincat, units};
use hydroboom_export::{
    blocks, controller, scheduled_lqr_controller, simulation_feedforward_controller,
};
use miette::{IntoDiagnostic, Result};

/// Write IEC 61131-3 Structured Text: function blocks of hydraulics, boom, simulated crane and controllers
/// (benchmark, simulation feedforward, scheduled LQR), with two tasks. It is written as plain text, TwinCAT
/// 3 files and PLCopen XML.
#[derive(Args)]
#[command(after_help = "Example: hydroboom export st --crane my-crane.toml --out generated\n\
    docs/how-to/export-twincat.md shows how it gets into TwinCAT 3")]
pub struct St {
    #[command(flatten)]
    crane: CraneFile,
    /// Folder to write to.
    #[arg(long, value_name = "DIR")]
    out: OutputFolder,
    /// Single precision: `REAL` for `LREAL`, for controllers without double precision; without the test bench.
    #[arg(long)]
    single: bool,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl St {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If the crane file is invalid, or the crane cannot be exported.
    pub fn run(self) -> Result<()> {
        let crane = self.crane.read()?;
        warn_of_unstable(&crane)?;
        let mut units = units(&crane).into_diagnostic()?;
        if self.single {
            units = in_single_precision(units).into_diagnostic()?;
        }
        let mut files = Vec::new();
        for unit in &units {
            files.push(File { name: unit.file_name(), content: unit.text() });
            let (name, content) = twincat::file(unit);
            files.push(File { name, content });
        }
        let all: Vec<String> = units.iter().map(Unit::text).collect();
        files.push(File { name: "hydroboom.st".into(), content: all.join("\n") });
        files.push(File { name: "hydroboom.xml".into(), content: plcopen::project(&units) });
        let [hydraulics, boom] = blocks(&crane).into_diagnostic()?;
        let recorded = [
            hydraulics,
            boom,
            controller(&crane).into_diagnostic()?,
            simulation_feedforward_controller(&crane).into_diagnostic()?,
            scheduled_lqr_controller(&crane).into_diagnostic()?,
        ];
        write_files(&self.out, &files, &recorded, self.json)
    }
}
