//! Whether a crane that still swings at the end of a course comes to rest afterwards.

use crate::motion_test::Sample;
use crate::rivals::Contender;
use crate::scenario::{Course, Load};
use crate::score::Score;
use crate::steering::steer;
use hydroboom_control::{Path, Reference};
use hydroboom_description::Description;

/// For so long a crane that still swings is steered on \[s\].
const LONGER: f64 = 5.0;

/// A course, and a rest at its end.
struct WithRest<'a>(&'a dyn Course);

impl Path for WithRest<'_> {
    fn reference(&self, t: f64) -> Reference<f64> {
        self.0.reference(t.min(self.0.duration()))
    }
    fn duration(&self) -> f64 {
        self.0.duration() + LONGER
    }
    fn speed(&self) -> f64 {
        self.0.speed()
    }
}

impl Course for WithRest<'_> {
    fn name(&self) -> String {
        self.0.name()
    }
    fn loads(&self) -> &[Load] {
        self.0.loads()
    }
}

/// Whether a crane that was steered along a course with the given score rings on. Where it still swings when the course ends, it is
/// steered along it once more and held for five seconds longer: what dies out by then does not ring on.
pub(crate) fn rings_on(
    model: &Description,
    crane: &Description,
    contender: Contender,
    course: &dyn Course,
    score: &Score,
) -> bool {
    if !score.still_swings() {
        return false;
    }
    let longer = WithRest(course);
    let mut score = Score::new(longer.duration());
    let end = steer(model, crane, contender, &longer, |sample: &Sample| {
        score.add(sample);
        Ok(())
    });
    end.is_err() || score.still_swings()
}
