//! Sustained oscillation over a course, and after its end where it may have begun there.

use crate::LabError;
use crate::closed_loop::controller_choice::ControllerChoice;
use crate::closed_loop::metrics::{Metrics, SustainedOscillation};
use crate::closed_loop::sample::Sample;
use crate::closed_loop::scenario::{Course, Load};
use crate::closed_loop::simulation::simulate_closed_loop;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::reference::trajectory::Trajectory;
use hydroboom_description::Description;

/// Time for which a crane that may oscillate is controlled beyond the end of its course \[s\].
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
    fn is_known_ahead(&self) -> bool {
        self.0.is_known_ahead()
    }
}

/// The sustained oscillation that a crane, which followed a course with the given metrics, was in while its reference rested.
/// Where one may have begun as the course ends, the course is simulated once more and held for five seconds longer.
///
/// # Errors
///
/// [`LabError`] when the crane cannot be held so long: it leaves what the model holds for.
pub fn sustained_oscillation(
    model: &Description,
    crane: &Description,
    controller: ControllerChoice,
    course: &dyn Course,
    metrics: &Metrics,
) -> Result<Option<SustainedOscillation>, LabError> {
    let limits = model.benchmark().limits;
    if metrics.oscillates() || !metrics.may_oscillate() {
        return Ok(metrics.sustained_oscillation(&limits));
    }
    let longer = WithRest(course);
    let mut metrics = Metrics::new();
    simulate_closed_loop(model, crane, controller, &longer, |sample: &Sample| {
        metrics.add(sample);
        Ok(())
    })?;
    Ok(metrics.sustained_oscillation(&limits))
}

/// Whether it was in one, or cannot be held.
pub fn has_sustained_oscillation(
    model: &Description,
    crane: &Description,
    controller: ControllerChoice,
    course: &dyn Course,
    metrics: &Metrics,
) -> bool {
    !matches!(sustained_oscillation(model, crane, controller, course, metrics), Ok(None))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::closed_loop::metrics::tests::metrics;
    use crate::closed_loop::monte_carlo::member;
    use hydroboom_control::strategy::Strategy;

    /// One score that ends in a swing of 3 mm, for two cranes: the one on soft oil, that the benchmark does swing on, and one that it does not.
    #[test]
    fn what_swings_at_the_end_rings_on_only_where_it_never_comes_to_rest() {
        let model = Description::uia_single_boom().unwrap();
        let course = model.motion(model.numbers.fast);
        let late = |time: f64| if time > 2.0 { 3e-3 * (8.0 * time).sin() } else { 0.0 };
        let swinging = metrics(late);
        assert!(swinging.may_oscillate());
        let calm = Description::uia_virtual().unwrap();
        let soft = member(&calm, 1, 145).unwrap().crane;
        let benchmark = ControllerChoice::from(Strategy::BenchmarkClosedLoop);
        let [soft, calm] = [soft, calm]
            .map(|crane| has_sustained_oscillation(&model, &crane, benchmark, &course, &swinging));
        assert!(soft && !calm, "{soft}, {calm}");
    }
}
