//! Plan of the courses that a run starts by itself: their number, resets after faults, and a change of strategy.

use hydroboom_control::strategy::Strategy;

/// Plan of automatic courses.
#[derive(Clone, Copy)]
pub struct CoursePlan {
    /// Number of courses that remain.
    pub remaining: u32,
    /// Whether faults are reset, and the next course is started.
    pub resets_faults: bool,
    /// Whether the first course waits for the operator's release.
    pub waits_for_operator: bool,
}

/// Change of strategy during each course (bumpless transfer).
#[derive(Clone, Copy)]
pub struct StrategyChange {
    /// Strategy before the change.
    pub first: Strategy,
    /// Strategy from the change on.
    pub then: Strategy,
    /// Time of the course at the change \[s\].
    pub at: f64,
}

impl StrategyChange {
    /// Strategy at a time of the course \[s\]; the first one without a course.
    pub fn at_time(&self, course_time: Option<f64>) -> Strategy {
        if course_time.is_some_and(|time| time >= self.at) { self.then } else { self.first }
    }
}
