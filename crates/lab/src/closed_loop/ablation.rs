//! Ablation of the scheduled LQR: each mechanism switched off by keys of the controller's crane file, one at a time, on cranes of a family.

use crate::LabError;
use crate::closed_loop::monte_carlo::{family, members};
use crate::closed_loop::scenario::CourseChoice;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use serde::Serialize;

/// A mechanism, and what switches it off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Mechanism {
    /// Its name.
    pub name: &'static str,
    /// Overrides of the controller's crane file, that of the machine staying as it is.
    pub overrides: &'static [&'static str],
}

/// Mechanisms of estimator and law.
pub const MECHANISMS: [Mechanism; 11] = [
    Mechanism {
        name: "transition pressure estimated",
        overrides: &["estimator.lowest_transition_bar=35", "estimator.highest_transition_bar=35"],
    },
    Mechanism {
        name: "transition pressure frozen at rest",
        overrides: &["estimator.excitation_velocity_mm_s=0"],
    },
    Mechanism {
        name: "unknown force estimated",
        overrides: &[
            "estimator.disturbance_drift_bar=0.001",
            "estimator.initial_disturbance_bar=0.001",
        ],
    },
    Mechanism {
        name: "unknown flow estimated",
        overrides: &["estimator.flow_drift_rpm=0.001", "estimator.largest_flow_percent=0.01"],
    },
    Mechanism {
        name: "drive lag identified",
        overrides: &["estimator.speed_noise_rpm=1000", "estimator.drive_memory_s=1000"],
    },
    Mechanism {
        name: "smoothing of the reference",
        overrides: &["scheduled_lqr.shortest_window_ms=2", "scheduled_lqr.longest_window_ms=10"],
    },
    Mechanism { name: "reference governor", overrides: &["scheduled_lqr.governor_error_mm=10000"] },
    Mechanism {
        name: "limit of feedback",
        overrides: &[
            "scheduled_lqr.feedback_percent=100",
            "scheduled_lqr.position_feedback_percent=100",
        ],
    },
    Mechanism {
        name: "nested saturation",
        overrides: &["scheduled_lqr.position_feedback_percent=40"],
    },
    Mechanism { name: "rollout", overrides: &["scheduled_lqr.rollout_improvement_percent=100"] },
    Mechanism {
        name: "payload hypothesis of the rollout",
        overrides: &["scheduled_lqr.payload_probability_percent=0"],
    },
];

/// True RMS error without a mechanism over that of the whole law on the same crane and course.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The mechanism.
    #[serde(flatten)]
    pub mechanism: Mechanism,
    /// Course.
    pub course: String,
    /// Cranes.
    pub cranes: usize,
    /// Geometric mean of the ratios.
    pub mean_ratio: f64,
    /// Largest ratio.
    pub largest_ratio: f64,
    /// Cranes in sustained oscillation, or stopped, without it.
    pub oscillating: usize,
}

/// The ablation on cranes 0 to `count` - 1 of a seed. `go_on` is told the share done and says whether to; if not, those mechanisms that are done are all
/// there is.
///
/// # Errors
///
/// [`LabError`] when a crane cannot be built or an override is refused.
pub fn ablation(
    model: &Description,
    nominal: &Description,
    courses: &[CourseChoice],
    count: u64,
    seed: u64,
    go_on: &(dyn Fn(f64) -> bool + Sync),
) -> Result<Vec<Row>, LabError> {
    let controller = [Strategy::ScheduledLqr.into()];
    let cranes = members(nominal, (count, seed), false)?;
    let parts = (MECHANISMS.len() + 1) as f64;
    let run = |model: &Description, part: f64| {
        let share = |share: f64| go_on((part + share) / parts);
        family(model, cranes.clone(), &controller, courses, &share)
    };
    let whole = run(model, 0.0)?;
    let mut rows = Vec::new();
    for (k, mechanism) in MECHANISMS.into_iter().enumerate() {
        let mut without = model.clone();
        for assignment in mechanism.overrides {
            without.set(assignment)?;
        }
        let done = run(&without, (k + 1) as f64)?;
        if done.len() < whole.len() {
            break;
        }
        for (c, course) in courses.iter().enumerate() {
            let pairs = || whole.iter().zip(&done).map(move |((_, a), (_, b))| (a[0][c], b[0][c]));
            let ratios =
                || pairs().map(|(a, b)| b.true_rms_mm / a.true_rms_mm).filter(|r| r.is_finite());
            let logs: f64 = ratios().map(f64::ln).sum();
            rows.push(Row {
                mechanism,
                course: course.of(nominal)?.name(),
                cranes: done.len(),
                mean_ratio: (logs / ratios().count().max(1) as f64).exp(),
                largest_ratio: ratios().fold(0.0, f64::max),
                oscillating: pairs().filter(|(_, b)| b.unstable).count(),
            });
        }
    }
    Ok(rows)
}
