//! Consistency of the state estimator on virtual cranes: whether its innovations and errors agree with its
//! covariance.
//!
//! The estimator is that of the scheduled LQR, designed for the model's crane file alone. It runs beside
//! any controller that moves a crane of the family in closed loop. Its inputs are the measurements and the
//! commands. Its estimates are compared with the true state at the time of the measurement, which the
//! crane's fieldbus delays by some control periods. Outputs that are not states get their standard
//! deviation from the covariance P by first-order propagation, σ² = ∇h P ∇hᵀ. The derivatives are exact
//! (dual numbers).

mod quantity;
mod recorder;

pub use quantity::Quantity;
pub use recorder::Phase;

use crate::LabError;
use crate::closed_loop::consistency_statistics::{ErrorSummary, Errors, InnovationSummary};
use crate::closed_loop::controller_choice::ControllerChoice;
use crate::closed_loop::monte_carlo::{Member, member};
use crate::closed_loop::scenario::CourseChoice;
use crate::closed_loop::simulation::{Case, WIDTH, simulate_cases};
use crate::interruptible::as_long_as;
use hydroboom_control::feedback::scheduled_lqr_controller::ScheduledLqrController;
use hydroboom_description::Description;
use hydroboom_design::scheduled_lqr::scheduled_lqr_controller;
use recorder::{ConsistencyRecorder, Run};
use serde::Serialize;
use std::ops::Range;

/// Measured signals of the estimator, in the order of its innovations.
pub const MEASURED: [&str; 2] = ["position", "load pressure"];

/// Statistics of the innovations of one measured signal, along one course or all.
#[derive(Clone, Debug, Serialize)]
pub struct InnovationRow {
    /// Name of the measured signal, of [`MEASURED`].
    pub measured: &'static str,
    /// Name of the course; none for all courses together.
    pub course: Option<String>,
    /// Statistics of the normalised innovations.
    #[serde(flatten)]
    pub summary: InnovationSummary,
    /// Lag of the autocorrelation of largest magnitude \[ms\].
    pub largest_at_lag_ms: f64,
    /// Whether the innovations agree with their covariance.
    pub is_consistent: bool,
}

/// Statistics of the estimation errors of one quantity, along one course or all, in one phase or all.
#[derive(Clone, Debug, Serialize)]
pub struct ErrorRow {
    /// Estimated quantity.
    pub quantity: Quantity,
    /// Display unit of the errors.
    pub unit: &'static str,
    /// Name of the course; none for all courses together.
    pub course: Option<String>,
    /// Phase of the course; none for all phases except the 0.5 s after a load change.
    pub phase: Option<&'static str>,
    /// Statistics of the estimation errors.
    #[serde(flatten)]
    pub summary: ErrorSummary,
    /// Whether coverage and standard deviation agree with the errors; none for too few instants.
    pub is_consistent: Option<bool>,
}

/// Longest time of inconsistent innovations along a course, to which the divergence test of the estimator is set.
#[derive(Clone, Debug, Serialize)]
pub struct InconsistentTime {
    /// Name of the course.
    pub course: String,
    /// Longest time over all cranes in which the mean NIS exceeds its limit \[s\].
    pub longest_s: f64,
}

/// Result of the consistency study of the state estimator over a family of cranes.
#[derive(Clone, Debug, Serialize)]
pub struct Consistency {
    /// Numbers of those cranes in the family that completed all courses.
    pub cranes: Vec<u64>,
    /// Cranes and courses that could not be completed, with the reason; they do not count.
    pub failed: Vec<String>,
    /// Longest time for which the mean NIS exceeded `estimator.nis_inconsistent`, by course.
    /// `estimator.divergence_time_s` must be longer.
    pub inconsistent: Vec<InconsistentTime>,
    /// Statistics of the innovations: over all courses, then by course.
    pub innovations: Vec<InnovationRow>,
    /// Statistics of the estimation errors: over all courses, by phase, and by course.
    pub errors: Vec<ErrorRow>,
}

/// Runs the estimator beside a controller on cranes of a family along all courses. `go_on` receives the
/// share done and returns whether to continue; otherwise the cranes completed so far count.
///
/// # Errors
///
/// [`LabError::Description`] if a crane of the family cannot exist; [`LabError::Scenario`] if a course has an unknown
/// name; [`LabError::Design`] if the estimator cannot be designed for the model.
pub fn consistency(
    model: &Description,
    nominal: &Description,
    controller: ControllerChoice,
    courses: &[CourseChoice],
    (cranes, seed): (Range<u64>, u64),
    go_on: &(dyn Fn(f64) -> bool + Sync),
) -> Result<Consistency, LabError> {
    let names = courses
        .iter()
        .map(|course| course.of(nominal).map(|course| course.name()))
        .collect::<Result<Vec<_>, _>>()?;
    let numbers: Vec<u64> = cranes.collect();
    let members = numbers
        .iter()
        .map(|number| member(nominal, seed, *number))
        .collect::<Result<Vec<_>, _>>()?;
    let estimator = scheduled_lqr_controller(model)?;
    let groups: Vec<&[Member]> = members.chunks(WIDTH).collect();
    let jobs: Vec<_> = groups
        .iter()
        .flat_map(|group| courses.iter().map(move |course| (*group, course)))
        .collect();
    let share = |done: usize| go_on(done as f64 / jobs.len() as f64);
    let one = |(group, course): &(&[Member], &CourseChoice)| {
        simulate_group(model, &estimator, controller, group, course)
    };
    let done = as_long_as(&jobs, &share, one)
        .into_iter()
        .map(Option::transpose)
        .collect::<Result<Vec<_>, LabError>>()?;
    let mut by_course: Vec<Vec<Run>> = vec![Vec::new(); courses.len()];
    let (mut finished, mut failed) = (Vec::new(), Vec::new());
    for (group, runs) in numbers.chunks(WIDTH).zip(done.chunks(courses.len())) {
        // only cranes that completed all courses
        let Some(runs) = runs.iter().cloned().collect::<Option<Vec<_>>>() else { continue };
        finished.extend_from_slice(group);
        for ((runs, name), of_course) in runs.into_iter().zip(&names).zip(&mut by_course) {
            for (run, number) in runs.into_iter().zip(group) {
                match run {
                    Ok(run) => of_course.push(run),
                    Err(error) => failed.push(format!("crane {number}, {name}: {error}")),
                }
            }
        }
    }
    let period = model.numbers.control_period;
    let inconsistent = names
        .iter()
        .zip(&by_course)
        .map(|(name, runs)| InconsistentTime {
            course: name.clone(),
            longest_s: runs.iter().map(|run| run.longest_inconsistent).fold(0.0, f64::max),
        })
        .collect();
    Ok(Consistency {
        inconsistent,
        cranes: finished,
        failed,
        innovations: innovation_rows(&names, &by_course, period),
        errors: error_rows(&names, &by_course),
    })
}

/// One course on up to [`WIDTH`] cranes. Returns the statistics of each, or the reason of its failure.
fn simulate_group(
    model: &Description,
    estimator: &ScheduledLqrController,
    controller: ControllerChoice,
    group: &[Member],
    choice: &CourseChoice,
) -> Result<Vec<Result<Run, String>>, LabError> {
    let courses =
        group.iter().map(|member| choice.of(&member.crane)).collect::<Result<Vec<_>, _>>()?;
    let lanes = || group.iter().zip(&courses);
    let cases: Vec<Case<'_>> = lanes()
        .map(|(member, course)| Case { crane: &member.crane, controller, course: course.as_ref() })
        .collect();
    let period = model.numbers.control_period;
    let mut recorders: Vec<ConsistencyRecorder<'_>> = lanes()
        .map(|(member, course)| {
            ConsistencyRecorder::new(*estimator, period, &member.crane, course.as_ref())
        })
        .collect();
    let ends = simulate_cases(model, &cases, |lane, sample| recorders[lane].record(sample));
    Ok(recorders
        .into_iter()
        .zip(ends)
        .map(|(observer, end)| end.map(|()| observer.run).map_err(|error| error.to_string()))
        .collect())
}

fn innovation_rows(names: &[String], by_course: &[Vec<Run>], period: f64) -> Vec<InnovationRow> {
    let row = |k: usize, course: Option<&String>, runs: &mut dyn Iterator<Item = &Run>| {
        let summary = InnovationSummary::of(runs.map(|run| &run.innovations[k]))?;
        Some(InnovationRow {
            measured: MEASURED[k],
            course: course.cloned(),
            largest_at_lag_ms: summary.largest_at_lag as f64 * period * 1e3,
            is_consistent: summary.is_consistent(),
            summary,
        })
    };
    let measured = 0..MEASURED.len();
    let all = measured.clone().filter_map(|k| row(k, None, &mut by_course.iter().flatten()));
    let each = names.iter().zip(by_course).flat_map(|(name, runs)| {
        measured.clone().filter_map(move |k| row(k, Some(name), &mut runs.iter()))
    });
    all.chain(each).collect()
}

fn error_rows(names: &[String], by_course: &[Vec<Run>]) -> Vec<ErrorRow> {
    let without_change = &Phase::ALL[1..];
    let mut rows = Vec::new();
    let mut add = |course: Option<&String>, phase: Option<Phase>, runs: &[&Run]| {
        for quantity in Quantity::ALL {
            let mut errors = Errors::default();
            for run in runs {
                let those = phase.as_ref().map_or(without_change, std::slice::from_ref);
                for phase in those {
                    errors.merge(&run.errors[*phase as usize][quantity as usize]);
                }
            }
            let (unit, size) = quantity.unit();
            rows.extend(errors.summary(size).map(|summary| ErrorRow {
                quantity,
                unit,
                course: course.cloned(),
                phase: phase.map(Phase::name),
                is_consistent: summary.is_consistent(),
                summary,
            }));
        }
    };
    let all: Vec<&Run> = by_course.iter().flatten().collect();
    add(None, None, &all);
    for phase in Phase::ALL {
        add(None, Some(phase), &all);
    }
    for (name, runs) in names.iter().zip(by_course) {
        add(Some(name), None, &runs.iter().collect::<Vec<_>>());
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_control::strategy::Strategy;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// The estimate is compared with the true state at the time of the measurement. One period of error
    /// would shift the position by 0.12 mm at 120 mm/s.
    #[test]
    fn estimates_are_compared_with_the_crane_as_it_was_measured() {
        let model = Description::uia_single_boom().unwrap();
        let nominal = Description::uia_virtual().unwrap();
        let beside = |strategy: Strategy| {
            let course = [CourseChoice::Motion(nominal.numbers.fast)];
            consistency(&model, &nominal, strategy.into(), &course, (0..1, 7), &|_| true).unwrap()
        };
        for strategy in [Strategy::BenchmarkClosedLoop, Strategy::ScheduledLqr] {
            let found = beside(strategy);
            assert_eq!((found.cranes.len(), found.failed.len()), (1, 0));
            let row = |quantity: Quantity, phase: Option<Phase>| {
                let name = phase.map(Phase::name);
                let mut rows = found.errors.iter();
                rows.find(|r| r.quantity == quantity && r.phase == name).unwrap().summary
            };
            let position = row(Quantity::Position, Some(Phase::Motion));
            assert!(position.rms_error < 0.05, "{}: {position:?}", strategy.name());
            // 0.05 bar of sensor noise, and 0.08 bar of unmodelled pressure
            let pressure = row(Quantity::LoadPressure, None);
            assert!(pressure.rms_error < 0.2, "{}: {pressure:?}", strategy.name());
            assert_eq!(position.instants, row(Quantity::Payload, Some(Phase::Motion)).instants);
        }
    }

    #[test]
    fn a_load_change_has_rows_of_its_own() {
        let model = Description::uia_single_boom().unwrap();
        let nominal = Description::uia_virtual().unwrap();
        let course = [CourseChoice::Scenario("payload-change".into())];
        let controller = Strategy::ScheduledLqr.into();
        let found =
            consistency(&model, &nominal, controller, &course, (0..1, 7), &|_| true).unwrap();
        let payload = |phase: Option<Phase>| {
            let name = phase.map(Phase::name);
            let mut rows = found.errors.iter();
            let of = |r: &&ErrorRow| r.quantity == Quantity::Payload && r.phase == name;
            rows.find(of).unwrap().summary
        };
        let after = payload(Some(Phase::AfterLoadChange));
        // three changes with ten instants each; directly after a change the payload error is its size
        assert_eq!(after.instants, 30);
        assert!(after.rms_error > 2.0 * payload(None).rms_error, "{after:?}");
    }

    #[test]
    fn an_interrupted_evaluation_contains_complete_cranes_only() {
        let model = Description::uia_single_boom().unwrap();
        let nominal = Description::uia_virtual().unwrap();
        let courses = ["small-moves", "reversal"].map(|s| CourseChoice::Scenario(s.into()));
        let done = AtomicUsize::new(0);
        let go_on = |_| done.fetch_add(1, Ordering::Relaxed) + 1 < 3;
        let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let controller = Strategy::BenchmarkClosedLoop.into();
        let range = (3..3 + 2 * WIDTH as u64, 1);
        let found = one_thread
            .install(|| consistency(&model, &nominal, controller, &courses, range, &go_on))
            .unwrap();
        assert_eq!(found.cranes, [3, 4, 5, 6]);
    }
}
