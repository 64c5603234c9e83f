//! `hydroboom doctor`

mod bus;
mod computer;

use crate::crane_file::CraneFile;
use crate::paths::InputFile;
use clap::Args;
use miette::Result;

/// Check whether this computer is suited for real time; or, with --bus, why an EtherCAT bus does not run.
///
/// With --bus the devices at a network interface are compared with their table and brought to SAFEOP, where 500 cycles
/// of frames are exchanged. Outputs stay safe and drives without torque; their supply stays live. The devices are in
/// INIT afterwards. The table's start-up SDOs, PDOs and watchdogs are written, as `run` writes them. Each finding is
/// one sentence with what to do: errors first, in the order of stages, causes before their effects
/// (docs/how-to/diagnose-a-bus.md).
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom doctor\n  hydroboom doctor --bus eth1 --table bus.toml\n  \
    hydroboom doctor --bus eth1 --crane my-crane.toml\n\n\
    With --bus the exit status is 1 where something prevents operation."
)]
pub struct Doctor {
    /// Diagnose the EtherCAT devices at this network interface.
    #[arg(long, value_name = "INTERFACE")]
    bus: Option<String>,
    /// Table of the devices, the file that `run` has as --bus FILE (docs/reference/ethercat-table.md). Default: the
    /// table [machine.ethercat] of the crane file.
    #[arg(long, value_name = "FILE", requires = "bus")]
    table: Option<InputFile>,
    #[command(flatten)]
    crane: CraneFile,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Doctor {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        match &self.bus {
            Some(interface) => {
                bus::examine(interface, self.table.as_deref(), &self.crane, self.json)
            }
            None => computer::examine(self.json),
        }
    }
}
