//! Checks of the strategies of a run before any motion: designs, stability, gains of the benchmark controller.

use super::requested_course::RequestedCourse;
use crate::machine_choice::MachineChoice;
use crate::{benchmark_gains, output};
use hydroboom_control::strategy::Strategy;
use hydroboom_design::scheduled_lqr::scheduled_lqr_controller;
use hydroboom_design::stability::stability_of;
use miette::{IntoDiagnostic, Result};

/// Checks the strategies before and after a change of strategy. Warns of loops that are unstable on the machine, and of
/// benchmark gains that are not tuned for the payloads of the course.
///
/// # Errors
///
/// If a strategy estimates states and there is no scheduled LQR for the model, or a loop cannot be analysed.
pub fn check_strategies(
    cranes: &MachineChoice,
    course: &RequestedCourse,
    strategies: [Strategy; 2],
) -> Result<()> {
    if strategies.iter().any(|strategy| strategy.estimates()) {
        // a crane without this design is refused here, instead of a silent fallback to the benchmark
        scheduled_lqr_controller(&cranes.model).into_diagnostic()?;
    }
    let loops = stability_of(&strategies, &cranes.model, &cranes.machine).into_diagnostic()?;
    for unstable in loops.iter().filter(|of| !of.stable) {
        output::warn(&unstable.to_string());
    }
    let has_benchmark =
        |of: &Strategy| !matches!(of, Strategy::VelocityFeedforward | Strategy::ScheduledLqr);
    if strategies.iter().any(has_benchmark)
        && let Some(remark) =
            benchmark_gains::remark_on_untuned_gains(&cranes.model, course.payload_range(cranes))?
    {
        output::warn(&remark);
    }
    Ok(())
}
