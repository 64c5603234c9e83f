//! `hydroboom export c`

use super::{File, warn_of_unstable, write_files};
use crate::crane_file::CraneFile;
use crate::paths::OutputFolder;
use clap::Args;
use hydroboom_export::c::{Precision, Prefix, prefixed_files};
use hydroboom_export::{
    blocks, controller, crane_model, scheduled_lqr_controller, simulation_feedforward,
};
use miette::{IntoDiagnostic, Result};

/// Write C99: a header and a source with the crane (whole, and as hydraulics and boom) and the controllers.
/// These are the benchmark, simulation feedforward with its simulated crane, and the scheduled LQR with its
/// state estimator.
#[derive(Args)]
#[command(
    after_help = "Example: hydroboom export c --out generated && cc -std=c99 -O2 -ffp-contract=off -c generated/hydroboom.c\n\
    docs/how-to/export-c.md shows how it is used"
)]
pub struct C {
    #[command(flatten)]
    crane: CraneFile,
    /// Folder to write to.
    #[arg(long, value_name = "DIR")]
    out: OutputFolder,
    /// Single precision (float): results then differ from those of Rust.
    #[arg(long)]
    single: bool,
    /// Prefix of all names in the header, and of the files if it is not hb_. Several cranes with different prefixes
    /// fit into one program.
    #[arg(long, value_name = "NAME", default_value = "hb_", value_parser = prefix)]
    prefix: Prefix,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl C {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If the crane file is invalid, or the crane cannot be exported.
    pub fn run(self) -> Result<()> {
        let crane = self.crane.read()?;
        warn_of_unstable(&crane)?;
        let model = crane_model(&crane).into_diagnostic()?;
        let [hydraulics, boom] = blocks(&crane).into_diagnostic()?;
        let benchmark = controller(&crane).into_diagnostic()?;
        let feedforward = simulation_feedforward(&crane).into_diagnostic()?;
        let lqr = scheduled_lqr_controller(&crane).into_diagnostic()?;
        let all = [model, hydraulics, boom, benchmark, feedforward, lqr];
        let precision = if self.single { Precision::Single } else { Precision::Double };
        let name = match self.prefix == Prefix::default() {
            true => "hydroboom".into(),
            false => format!("{}hydroboom", self.prefix.as_str()),
        };
        let made = prefixed_files(&all, &name, precision, &self.prefix).into_diagnostic()?;
        let files = [
            File { name: format!("{name}.h"), content: made.header },
            File { name: format!("{name}.c"), content: made.source },
        ];
        write_files(&self.out, &files, &all, self.json)
    }
}

/// Parses a prefix of names in C.
fn prefix(text: &str) -> Result<Prefix, String> {
    Prefix::new(text).map_err(|e| e.to_string())
}
