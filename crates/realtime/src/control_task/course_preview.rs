//! Preview of the course: set points ahead of the present time.

use super::ControlTask;
use hydroboom_control::reference::preview::{PERIODS_AHEAD, Preview};
use std::cell::Cell;

impl ControlTask {
    /// Fills the preview at the start of the course. Times ahead are summed period by period, as the course
    /// time is. A set point is then bit-identical in the preview and at its own period.
    pub(super) fn begin_preview(&mut self) {
        let (course, period, begin) =
            (&self.course, self.benchmark.period, -self.course.approach());
        let clock = Cell::new((0.0, begin));
        let time = |after: f64| {
            let periods = after / period;
            if periods < 0.5 {
                return begin + after;
            }
            let (mut counted, mut time) = match clock.get() {
                (counted, time) if counted < periods => (counted, time),
                _ => (0.0, begin),
            };
            while counted + 0.5 < periods {
                (counted, time) = (counted + 1.0, time + period);
            }
            clock.set((counted, time));
            time
        };
        self.preview = Preview::new(period, |after| course.reference(time(after)));
        self.preview_end = time(PERIODS_AHEAD as f64 * period);
    }

    /// Shifts the preview by one period.
    pub(super) fn advance_preview(&mut self) {
        let (course, now, period) = (&self.course, self.course_time, self.benchmark.period);
        self.preview_end += period;
        let (end, ahead) = (self.preview_end, PERIODS_AHEAD as f64 * period);
        self.preview.advance(|after| match (after - ahead).abs() < 0.5 * period {
            true => course.reference(end),
            false => course.reference(now + after),
        });
    }
}
