//! Assessment of all cycles together: completeness, stability, and whether the identified parameters may be used.

use hydroboom_lab::cycle_learning::experiment::CycleReport;
use miette::{Result, bail};

/// Number of cycles in which all methods were run.
pub fn complete_count(reports: &[CycleReport]) -> usize {
    reports.iter().filter(|report| report.whole).count()
}

/// Checks that all requested cycles are complete; the results so far are printed by then.
///
/// # Errors
///
/// If the command was interrupted before, with the number of complete cycles.
pub fn check_completeness(reports: &[CycleReport], requested: usize) -> Result<()> {
    let complete = complete_count(reports);
    match complete == requested {
        true => Ok(()),
        false => bail!("interrupted: {complete} of {requested} cycles are complete"),
    }
}

/// Whether the closed loops of all cycles are stable; none if none is known to be unstable, and some were not
/// judged.
pub fn stability(reports: &[CycleReport], requested: usize) -> Option<bool> {
    let judged = |is: bool| reports.iter().filter(|report| report.stable == Some(is)).count();
    match (judged(false), judged(true)) {
        (0, stable) => (stable == requested).then_some(true),
        _ => Some(false),
    }
}

/// Whether the parameters that were identified from a log may be used after all its cycles, and the first reason why
/// not.
pub fn usability(reports: &[CycleReport]) -> (bool, Option<String>) {
    let refused = reports.iter().find_map(|report| report.unusable_because.clone());
    match reports.is_empty() {
        true => (false, Some("no cycle was run with it".into())),
        false => (refused.is_none(), refused),
    }
}
