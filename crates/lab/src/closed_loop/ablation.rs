//! Ablation study of the scheduled LQR on cranes of a family: each mechanism is switched off in turn by
//! keys of the controller's crane file.

use crate::LabError;
use crate::closed_loop::monte_carlo::{family, members};
use crate::closed_loop::scenario::CourseChoice;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::schema::Numbers;
use hydroboom_description::{Description, Difference};
use serde::Serialize;

const BAR: f64 = 1e5;

/// Mechanism of the scheduled LQR, and the change of keys that switches it off.
#[derive(Clone, Copy, Debug)]
pub struct Mechanism {
    /// Name of the mechanism in tables.
    pub name: &'static str,
    /// Change of the controller's crane file; that of the machine is unchanged.
    switch_off: fn(&mut Numbers<f64>),
}

/// Mechanisms of estimator and control law that the study switches off in turn.
pub const MECHANISMS: [Mechanism; 11] = [
    Mechanism {
        name: "transition pressure estimated",
        switch_off: |n| {
            n.tuning.estimator_lowest_transition = n.transition;
            n.tuning.estimator_highest_transition = n.transition;
        },
    },
    Mechanism {
        name: "process noise of the transition pressure only in motion",
        switch_off: |n| n.tuning.estimator_excitation_velocity = 0.0,
    },
    Mechanism {
        name: "unknown force estimated",
        switch_off: |n| {
            n.tuning.estimator_disturbance_drift = 1e-3 * BAR;
            n.tuning.estimator_initial_disturbance = 1e-3 * BAR;
        },
    },
    Mechanism {
        name: "unknown flow estimated",
        switch_off: |n| {
            n.tuning.estimator_flow_drift = 1e-3 / 60.0;
            n.tuning.estimator_largest_flow = 1e-4;
        },
    },
    Mechanism {
        name: "drive lag identified",
        switch_off: |n| {
            n.tuning.estimator_speed_noise = 1000.0 / 60.0;
            n.tuning.estimator_drive_memory = 1000.0;
        },
    },
    Mechanism {
        name: "smoothing of the reference",
        switch_off: |n| {
            n.tuning.lqr_shortest_window = 2e-3;
            n.tuning.lqr_longest_window = 10e-3;
        },
    },
    Mechanism { name: "reference governor", switch_off: |n| n.tuning.lqr_governor_error = 10.0 },
    Mechanism {
        name: "limit of feedback",
        switch_off: |n| {
            n.tuning.lqr_feedback = 1.0;
            n.tuning.lqr_position_feedback = 1.0;
        },
    },
    Mechanism {
        name: "nested saturation",
        switch_off: |n| n.tuning.lqr_position_feedback = n.tuning.lqr_feedback,
    },
    Mechanism { name: "rollout", switch_off: |n| n.tuning.lqr_rollout_improvement = 1.0 },
    Mechanism {
        name: "payload hypothesis of the rollout",
        switch_off: |n| n.tuning.lqr_payload_probability = 0.0,
    },
];

impl Mechanism {
    /// Crane file of the controller with the mechanism switched off.
    pub fn without(&self, model: &Description) -> Description {
        let mut without = model.clone();
        (self.switch_off)(&mut without.numbers);
        without
    }
}

/// True RMS errors without a mechanism, relative to those of the complete controller on the same cranes and course.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Name of the mechanism.
    pub mechanism: &'static str,
    /// Keys of the controller's crane file that switch it off, as `section.key=value`.
    pub overrides: Vec<String>,
    /// Name of the course.
    pub course: String,
    /// Number of simulated cranes.
    pub cranes: usize,
    /// Geometric mean over the cranes of the ratio of RMS errors \[-\]; above 1 the mechanism reduces the error.
    /// Cranes that did not finish the course are left out; 1 if none finished it.
    pub mean_ratio: f64,
    /// Largest ratio of RMS errors \[-\] of the cranes that finished the course; 0 if none did.
    pub largest_ratio: f64,
    /// Number of cranes in sustained oscillation, or stopped, without the mechanism.
    pub oscillating: usize,
}

/// Ablation study on cranes 0 to `count` - 1 of a seed. `go_on` receives the share done and returns whether
/// to continue; otherwise the mechanisms completed so far are returned.
///
/// # Errors
///
/// [`LabError::Description`] if a crane of the family cannot exist; [`LabError::Scenario`] if a course has an unknown
/// name. A crane that cannot finish a course counts as oscillating.
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
        let without = mechanism.without(model);
        let overrides: Vec<String> =
            model.differences(&without).iter().map(Difference::assignment).collect();
        let done = run(&without, (k + 1) as f64)?;
        if done.len() < whole.len() {
            break;
        }
        for (c, course) in courses.iter().enumerate() {
            let pairs = || whole.iter().zip(&done).map(move |((_, a), (_, b))| (a[0][c], b[0][c]));
            let ratios = || {
                pairs()
                    .map(|(a, b)| b.error.rms_true_mm / a.error.rms_true_mm)
                    .filter(|r| r.is_finite())
            };
            let logs: f64 = ratios().map(f64::ln).sum();
            rows.push(Row {
                mechanism: mechanism.name,
                overrides: overrides.clone(),
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Independent of the limits in the crane file, each switch changes at least one number and gives a
    /// valid file.
    #[test]
    fn every_mechanism_can_be_switched_off_by_keys_of_a_crane_file() {
        let as_published = Description::uia_single_boom().unwrap();
        let mut tuned = as_published.clone();
        for assignment in [
            "scheduled_lqr.feedback_percent=30",
            "estimator.highest_transition_bar=30",
            "oil.transition_bar=20",
        ] {
            tuned.set(assignment).unwrap();
        }
        for model in [as_published, tuned] {
            for mechanism in MECHANISMS {
                let mut without = mechanism.without(&model);
                assert!(!model.differences(&without).is_empty(), "{}", mechanism.name);
                let name = without.name.clone();
                without.set(&format!("crane.name={name}")).unwrap();
            }
        }
    }
}
