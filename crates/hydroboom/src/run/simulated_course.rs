//! Course of a run in simulated time, before it is run in real time: both results are reported side by side.

use super::attendant::RunAttendant;
use super::control_setup;
use super::course_plan::{CoursePlan, StrategyChange};
use super::course_result::CourseResult;
use super::requested_course::RequestedCourse;
use crate::machine_choice::MachineChoice;
use hydroboom_realtime::desk::Desk;
use hydroboom_realtime::lockstep::{self, Pace};
use hydroboom_realtime::session::{Ending, Lookout, Session};
use miette::{IntoDiagnostic, Result};
use std::sync::Arc;

/// Longest course that is simulated before it is run \[s\].
const LONGEST_COURSE: f64 = 120.0;

/// Result of a course on the virtual crane in simulated time; none for a course longer than two minutes.
///
/// # Errors
///
/// If a crane has no state of rest, or the simulation of the machine fails.
pub fn simulate(
    cranes: &MachineChoice,
    course: &RequestedCourse,
    change: StrategyChange,
) -> Result<Option<CourseResult>> {
    if course.path.duration() > LONGEST_COURSE {
        return Ok(None);
    }
    let desk = Arc::new(Desk::new(change.first));
    let session = Session::new(&cranes.model);
    let plan = CoursePlan { remaining: 1, resets_faults: false, waits_for_operator: false };
    let mut attendant = RunAttendant::new(session, Arc::clone(&desk), course.clone())
        .with_strategy_change(change)
        .with_plan(plan);
    let lookout = Lookout { desk: &desk, attendant: &mut attendant, ending: Ending::OnceClosed };
    let run = control_setup::lockstep(cranes, change.first)?;
    lockstep::run(run, &cranes.machine, lookout, Pace::Free).into_diagnostic()?;
    Ok(attendant.results.pop())
}
