//! `hydroboom check`

mod load_range;
mod rest_remarks;
mod self_contained;
mod valve_controlled;

use crate::crane_file::CraneFile;
use clap::Args;
use hydroboom_description::Description;
use hydroboom_description::schema::CircuitChoice;
use miette::Result;

/// Check a crane file: keys, ranges, geometry, static balance, limits over the range of loads, loops of the
/// controllers, step limits.
#[derive(Args)]
#[command(after_help = "Example: hydroboom check --crane my-crane.toml")]
pub struct Check {
    #[command(flatten)]
    crane: CraneFile,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Shares of the stroke at which the crane is checked at rest \[-\].
const POSITIONS: [f64; 3] = [0.0, 0.5, 1.0];

impl Check {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If the crane file is invalid, or the crane has no state of rest.
    pub fn run(self) -> Result<()> {
        let description = self.crane.read_any()?;
        match (description.choices.circuit, description.segment_shares.len()) {
            (CircuitChoice::SelfContained, _) => self.self_contained(&description),
            (CircuitChoice::ValveControlled, 1) => self.valve_controlled::<1>(&description),
            (CircuitChoice::ValveControlled, 2) => self.valve_controlled::<2>(&description),
            (CircuitChoice::ValveControlled, _) => self.valve_controlled::<3>(&description),
        }
    }
}

/// Warnings of a description and further remarks.
fn warnings(description: &Description, remarks: Vec<String>) -> Vec<String> {
    description.warnings().into_iter().chain(remarks).collect()
}
