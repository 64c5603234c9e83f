//! Sustained oscillation over a course, and after its end where it may have begun there.

use crate::motion_test::Sample;
use crate::rivals::Contender;
use crate::scenario::{Course, Load};
use crate::score::Score;
use crate::steering::steer;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::reference::trajectory::Trajectory;
use hydroboom_description::Description;

/// For so long a crane that still swings is steered on \[s\].
const LONGER: f64 = 5.0;

/// A course, and a rest at its end.
struct WithRest<'a>(&'a dyn Course);

impl Trajectory for WithRest<'_> {
    fn reference(&self, t: f64) -> SetPoint<f64> {
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

/// Whether a crane that was steered along a course with the given score was in a sustained oscillation while its reference
/// rested. Where one may have begun as the course ends, it is steered along it once more and held for five seconds longer.
pub fn rings_on(
    model: &Description,
    crane: &Description,
    contender: Contender,
    course: &dyn Course,
    score: &Score,
) -> bool {
    if score.oscillates() {
        return true;
    }
    if !score.may_oscillate() {
        return false;
    }
    let longer = WithRest(course);
    let mut score = Score::new();
    let end = steer(model, crane, contender, &longer, |sample: &Sample| {
        score.add(sample);
        Ok(())
    });
    end.is_err() || score.oscillates()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::family::member;
    use crate::score::tests::score;
    use hydroboom_control::strategy::Strategy;

    /// One score that ends in a swing of 3 mm, for two cranes: the one on soft oil, that the benchmark does swing on, and one that it does not.
    #[test]
    fn what_swings_at_the_end_rings_on_only_where_it_never_comes_to_rest() {
        let model = Description::uia_single_boom().unwrap();
        let course = model.motion(model.numbers.fast);
        let late = |time: f64| if time > 2.0 { 3e-3 * (8.0 * time).sin() } else { 0.0 };
        let swinging = score(late);
        assert!(swinging.may_oscillate());
        let calm = Description::uia_virtual().unwrap();
        let soft = member(&calm, 1, 145).unwrap().crane;
        let benchmark = Contender::from(Strategy::BenchmarkClosedLoop);
        let [soft, calm] =
            [soft, calm].map(|crane| rings_on(&model, &crane, benchmark, &course, &swinging));
        assert!(soft && !calm, "{soft}, {calm}");
    }
}
