//! `hydroboom machine`

use crate::crane_file::CraneFile;
use clap::Args;
use hydroboom_description::Description;
use hydroboom_realtime::host::host;
use hydroboom_realtime::shared::Shared;
use hydroboom_virtual_crane::VirtualCrane;
use miette::{IntoDiagnostic, Result, WrapErr};
use std::path::PathBuf;

/// Play the machine: the virtual crane in real time, in a process of its own (`run` starts it).
#[derive(Args)]
pub struct Machine {
    #[command(flatten)]
    crane: CraneFile,
    /// Memory shared with the executive, which makes it.
    #[arg(long, value_name = "FILE")]
    shared: PathBuf,
}

impl Machine {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let crane = self.crane.read_or(Description::uia_virtual)?;
        let shared = Shared::open(&self.shared)
            .into_diagnostic()
            .wrap_err_with(|| self.shared.display().to_string())?;
        // the load held, the pump without pressure
        let mut start = crane.start(crane.numbers.motion_start);
        start.preload = 0.0;
        let machine = VirtualCrane::new(&crane, &start).into_diagnostic()?;
        let end = host(machine, &crane, &shared).into_diagnostic();
        // who made it has gone without a word, or has removed it
        let _ = std::fs::remove_file(&self.shared);
        end
    }
}
