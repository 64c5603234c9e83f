//! Keys of a crane file that only a controller uses, and that therefore have no effect on a virtual crane.

use crate::crane_file::CraneFile;
use hydroboom_description::Description;
use miette::Result;

/// Sections of the crane file that only a controller uses.
const SECTIONS: [&str; 2] = ["estimator", "scheduled_lqr"];

/// Refuses such keys for the virtual crane: overrides, and, if the controller's model has no file of its own, entries
/// of the crane file.
///
/// # Errors
///
/// If there is one, with the option that applies it to the controller.
pub fn refuse(file: &CraneFile, crane: &Description, has_model_file: bool) -> Result<()> {
    if let Some(assignment) = file.overrides().iter().find(|a| is_of_controller(a)) {
        miette::bail!(
            help = format!("--model-set {assignment}"),
            "--set {assignment}: --set changes the machine, and this is what its controller knows"
        );
    }
    if let (Some(path), false) = (file.path(), has_model_file)
        && let Some(key) = controller_key(crane)
    {
        miette::bail!(
            help = format!("--model {} makes the controller know this file", path.display()),
            "{} has {key}, which is of the controller, and --crane is the machine: without --model the controller knows the paper's crane",
            path.display()
        );
    }
    Ok(())
}

/// Path of the first key in a crane file that only a controller uses.
fn controller_key(crane: &Description) -> Option<String> {
    let mut entries = crane.entries();
    let entry =
        entries.find(|(key, _, origin)| SECTIONS.contains(&key.section) && origin.line.is_some());
    entry.map(|(key, ..)| key.path())
}

/// Whether an override sets a key that only a controller uses.
fn is_of_controller(assignment: &str) -> bool {
    let section = assignment.trim().split('.').next();
    section.is_some_and(|section| SECTIONS.contains(&section))
}
