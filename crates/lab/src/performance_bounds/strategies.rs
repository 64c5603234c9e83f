//! Errors of the strategies on the machine, with and without feedback, compared with the bound.

use crate::LabError;
use crate::closed_loop::scenario::CourseChoice;
use crate::interruptible::as_long_as;
use crate::motion_test::{Run, attempted, by_name};
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use serde::Serialize;

/// RMS true error of a strategy, compared with the lower bound.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StrategyError {
    /// Control strategy.
    #[serde(serialize_with = "by_name")]
    pub strategy: Strategy,
    /// RMS true error \[mm\]; none if the loop oscillates or the simulation stopped.
    pub rms_true_mm: Option<f64>,
    /// Ratio of the error to the bound with all limits \[-\]; none without an error.
    pub over_bound: Option<f64>,
    /// Reason why there is no error; none if there is one.
    pub remark: Option<String>,
}

/// All strategies on the machine, with controllers designed for `model`, compared with the bound with all
/// limits \[mm\]. `go_on` receives the number of completed runs and returns whether to continue; runs that
/// were started by then are returned.
///
/// # Errors
///
/// [`LabError::Scenario`] if there is no such course; [`LabError::Plant`] or [`LabError::Design`] if a crane or a
/// controller cannot be built. A stopped run is no error: see [`StrategyError::remark`].
pub fn strategy_errors(
    model: &Description,
    machine: &Description,
    choice: &CourseChoice,
    bound_mm: f64,
    go_on: &(dyn Fn(usize) -> bool + Sync),
) -> Result<Vec<StrategyError>, LabError> {
    let one = |strategy: &Strategy| {
        let course = choice.of(machine)?;
        Ok(beside(bound_mm, &attempted(model, machine, *strategy, course.as_ref())?))
    };
    as_long_as(&Strategy::ALL, go_on, one).into_iter().flatten().collect()
}

/// Result of a run compared with a bound \[mm\].
fn beside(bound_mm: f64, run: &Run) -> StrategyError {
    let error = run.is_stable().then(|| run.metrics().tracking_error().rms_true_mm);
    StrategyError {
        strategy: run.strategy,
        rms_true_mm: error,
        over_bound: error.map(|mm| mm / bound_mm),
        remark: error.is_none().then(|| run.tracking()),
    }
}
