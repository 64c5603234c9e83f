//! `hydroboom machine`

use crate::crane_file::CraneFile;
use clap::Args;
use hydroboom_description::Description;
use hydroboom_realtime::host::host;
use hydroboom_realtime::shared::Shared;
use hydroboom_virtual_crane::VirtualCrane;
use miette::{IntoDiagnostic, Result, WrapErr};
use std::path::PathBuf;

/// Simulate a machine: the virtual crane in real time, in another process (started by `run`).
#[derive(Args)]
pub struct Machine {
    #[command(flatten)]
    crane: CraneFile,
    /// Use the virtual crane of the crane file, with typical drive, valve, sensors and fieldbus where the file has
    /// none.
    #[arg(long = "virtual")]
    is_virtual: bool,
    /// Shared memory, created by the executive.
    #[arg(long, value_name = "FILE")]
    shared: PathBuf,
}

impl Machine {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If the crane file is invalid, the shared memory cannot be opened, or the simulation fails.
    pub fn run(self) -> Result<()> {
        let crane = self.description()?;
        let shared = Shared::open(&self.shared)
            .into_diagnostic()
            .wrap_err_with(|| self.shared.display().to_string())?;
        // load held, pump without pressure
        let mut start = crane.start(crane.numbers.motion_start);
        start.preload = 0.0;
        let machine = VirtualCrane::new(&crane, &start).into_diagnostic()?;
        let end = host(machine, &crane, &shared).into_diagnostic();
        // the creator of the memory has ended without removing it, or has removed it
        let _ = std::fs::remove_file(&self.shared);
        end
    }

    /// Description of the simulated crane.
    fn description(&self) -> Result<Description> {
        let crane = self.crane.read_or(Description::uia_virtual)?;
        Ok(if self.is_virtual { crane.virtual_crane().0 } else { crane })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine_choice::MachineChoice;
    use clap::Parser;

    #[derive(Parser)]
    struct RunOptions {
        #[command(flatten)]
        crane: CraneFile,
        #[arg(long)]
        machine: Option<PathBuf>,
    }

    #[derive(Parser)]
    struct MachineOptions {
        #[command(flatten)]
        machine: Machine,
    }

    #[test]
    fn the_machine_process_simulates_the_chosen_machine() {
        let boom = "../../cranes/uia-single-boom.toml";
        for arguments in [
            vec![],
            vec!["--crane", boom, "--set", "payload.mass_kg=250", "--set", "drive.bandwidth_hz=40"],
            vec!["--machine", boom],
            vec!["--set", "motion.end_mm=320"],
            vec!["--machine", boom, "--set", "motion.end_mm=320"],
        ] {
            let run = RunOptions::parse_from([&["run"], &arguments[..]].concat());
            let choice = MachineChoice::read(&run.crane, run.machine.as_deref()).unwrap();
            let mut options = vec!["machine".into(), "--shared".into(), "nowhere".into()];
            options.extend(choice.arguments().iter().cloned());
            let simulated = MachineOptions::parse_from(options).machine.description().unwrap();
            assert_eq!(simulated.digest(), choice.machine.digest(), "{arguments:?}");
            // model and machine have the same motion for any machine
            assert_eq!(choice.machine.numbers.motion_end, choice.model.numbers.motion_end);
        }
    }
}
