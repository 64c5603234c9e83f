//! Sustained oscillation during a course, and after its end if it may have begun there.

use crate::LabError;
use crate::closed_loop::controller_choice::ControllerChoice;
use crate::closed_loop::metrics::{Metrics, SustainedOscillation};
use crate::closed_loop::sample::Sample;
use crate::closed_loop::scenario::{Course, Load};
use crate::closed_loop::simulation::simulate_closed_loop;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::reference::trajectory::Trajectory;
use hydroboom_description::Description;

/// Time for which a crane that may oscillate is simulated beyond the end of its course \[s\].
const LONGER: f64 = 5.0;

/// Course with a rest appended.
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

/// Sustained oscillation of a crane while its reference rested, given the metrics of its course. If one may
/// have begun at the end of the course, the course is repeated with five seconds of rest appended.
///
/// # Errors
///
/// [`LabError::Simulation`] if the state leaves the model's range of validity in that repetition; otherwise see
/// [`simulate_closed_loop`].
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

/// Whether [`sustained_oscillation`] finds one, or its repetition of the course fails: an unknown end counts as
/// oscillation.
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

    /// The same metrics, which end in an oscillation of 3 mm, for two cranes. The crane on soft oil
    /// oscillates under the benchmark controller, the other one does not.
    #[test]
    fn an_oscillation_at_the_end_is_sustained_only_if_it_does_not_decay() {
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
