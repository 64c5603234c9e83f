//! Monte Carlo simulation over families of virtual cranes with random parameters.

mod comparison;
mod percentiles;
mod variation;

pub use comparison::{OverLqr, Row, rows};
pub use percentiles::Percentiles;
pub use variation::{
    Member, VARIATIONS, Variation, WIDENED, member, members, variations, widened, worn,
};

use crate::LabError;
use crate::closed_loop::controller_choice::ControllerChoice;
use crate::closed_loop::metrics::{Effort, Metrics, TrackingError};
use crate::closed_loop::scenario::CourseChoice;
use crate::closed_loop::simulation::{Case, WIDTH, simulate_side_by_side};
use crate::closed_loop::sustained_oscillation::has_sustained_oscillation;
use crate::interruptible::as_long_as;
use hydroboom_description::Description;
use serde::Serialize;

/// Result of one controller on one crane along one course.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Outcome {
    /// Tracking error; NaN if the course could not be finished.
    #[serde(flatten)]
    pub error: TrackingError,
    /// Control effort and vibration of the tip.
    #[serde(flatten)]
    pub effort: Effort,
    /// Whether the loop was in sustained oscillation, or the course could not be finished.
    pub unstable: bool,
}

/// Results of one crane: outer index by controller, inner index by course.
pub type Outcomes = Vec<Vec<Outcome>>;

/// Runs all controllers along all courses on cranes of a family, vectorised and on all cores. `go_on`
/// receives the share done and returns whether to continue; otherwise the cranes completed so far are
/// returned.
///
/// # Errors
///
/// [`LabError::Scenario`] if a course has an unknown name. A crane that cannot be built, or cannot finish a course,
/// counts as unstable.
pub fn family(
    model: &Description,
    members: Vec<Member>,
    controllers: &[ControllerChoice],
    courses: &[CourseChoice],
    go_on: &(dyn Fn(f64) -> bool + Sync),
) -> Result<Vec<(Member, Outcomes)>, LabError> {
    let groups: Vec<&[Member]> = members.chunks(WIDTH).collect();
    let jobs: Vec<_> = groups
        .iter()
        .flat_map(|group| {
            controllers.iter().flat_map(move |controller| {
                courses.iter().map(move |course| (*group, *controller, course))
            })
        })
        .collect();
    let share = |done: usize| go_on(done as f64 / jobs.len() as f64);
    let one = |(group, controller, course): &(&[Member], ControllerChoice, &CourseChoice)| {
        simulate_group(model, group, *controller, course)
    };
    let outcomes = as_long_as(&jobs, &share, one)
        .into_iter()
        .map(Option::transpose)
        .collect::<Result<Vec<_>, LabError>>()?;
    let of = |number: usize, s: usize, c: usize| {
        let job = (number / WIDTH * controllers.len() + s) * courses.len() + c;
        outcomes[job].map(|cases| cases[number % WIDTH])
    };
    Ok(members
        .into_iter()
        .enumerate()
        .filter_map(|(number, member)| {
            let along = |s| (0..courses.len()).map(|c| of(number, s, c)).collect();
            let all = (0..controllers.len()).map(along).collect::<Option<Outcomes>>()?;
            Some((member, all))
        })
        .collect())
}

/// One controller along one course on up to [`WIDTH`] cranes.
fn simulate_group(
    model: &Description,
    group: &[Member],
    controller: ControllerChoice,
    choice: &CourseChoice,
) -> Result<[Outcome; WIDTH], LabError> {
    // in a smaller last group its last crane also fills the remaining lanes
    let member = |lane: usize| &group[lane.min(group.len() - 1)].crane;
    let mut courses = Vec::with_capacity(WIDTH);
    for lane in 0..WIDTH {
        courses.push(choice.of(member(lane))?);
    }
    let cases: [Case<'_>; WIDTH] = std::array::from_fn(|lane| Case {
        crane: member(lane),
        controller,
        course: courses[lane].as_ref(),
    });
    let mut scores = cases.map(|_| Metrics::new());
    let ends = simulate_side_by_side(model, &cases, |lane, sample| scores[lane].add(sample));
    Ok(std::array::from_fn(|lane| match &ends[lane] {
        Ok(()) => Outcome {
            error: scores[lane].tracking_error(),
            effort: scores[lane].effort(),
            unstable: has_sustained_oscillation(
                model,
                cases[lane].crane,
                controller,
                cases[lane].course,
                &scores[lane],
            ),
        },
        Err(_) => {
            Outcome { error: TrackingError::UNFINISHED, effort: Effort::UNFINISHED, unstable: true }
        }
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_control::strategy::Strategy;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// On one core a group completes all courses before the next group begins.
    #[test]
    fn an_interrupted_family_contains_complete_cranes_only() {
        let model = Description::uia_single_boom().unwrap();
        let mut nominal = Description::uia_virtual().unwrap();
        let n = &mut nominal.numbers;
        (n.motion_end, n.ramp) = (n.motion_start + 0.1, 0.4);
        (n.dwell, n.rest) = (0.5, 0.5);
        let controllers = [ControllerChoice::Strategy(Strategy::BenchmarkClosedLoop)];
        let courses = [1, 2, 3].map(|_| CourseChoice::Motion(nominal.numbers.fast));
        let cranes = members(&nominal, (3 * WIDTH as u64, 1), false).unwrap();
        let interrupted = |after: usize| {
            let done = AtomicUsize::new(0);
            let go_on = |_| done.fetch_add(1, Ordering::Relaxed) + 1 < after;
            let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
            one_thread
                .install(|| family(&model, cranes.clone(), &controllers, &courses, &go_on))
                .unwrap()
        };
        assert!(interrupted(2).is_empty());
        let left = interrupted(4);
        assert_eq!(left.len(), WIDTH);
        for (number, (left, outcomes)) in left.iter().enumerate() {
            assert_eq!(left.values, member(&nominal, 1, number as u64).unwrap().values);
            assert!(outcomes[0].len() == courses.len() && outcomes[0].iter().all(|o| !o.unstable));
        }
    }
}
