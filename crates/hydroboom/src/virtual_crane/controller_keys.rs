//! Keys of a crane file that only a controller uses, and that therefore have no effect on a virtual crane.

use crate::crane_file::CraneFile;
use miette::Result;

/// Sections of the crane file that only a controller uses.
const SECTIONS: [&str; 2] = ["estimator", "scheduled_lqr"];

/// Refuses overrides of such keys for the virtual crane.
///
/// # Errors
///
/// If there is one, with the option that applies it to the controller.
pub fn refuse(file: &CraneFile) -> Result<()> {
    if let Some(assignment) = file.overrides().iter().find(|a| is_of_controller(a)) {
        miette::bail!(
            help = format!("--model-set {assignment}"),
            "--set {assignment}: --set changes the machine, and this is what its controller knows"
        );
    }
    Ok(())
}

/// Whether an override sets a key that only a controller uses.
fn is_of_controller(assignment: &str) -> bool {
    let section = assignment.trim().split('.').next();
    section.is_some_and(|section| SECTIONS.contains(&section))
}
