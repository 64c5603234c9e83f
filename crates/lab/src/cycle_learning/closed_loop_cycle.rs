//! Closed-loop cycle under the scheduled LQR, from which a machine is identified.

use super::drive_delay::with_drive_delay;
use super::record::Record;
use super::replay::{Errors, at_rest};
use super::stages::Stages;
use crate::LabError;
use crate::closed_loop::metrics::SustainedOscillation;
use crate::closed_loop::scenario::Course;
use crate::closed_loop::simulation::{Loop, Now};
use hydroboom_control::supervision::oscillation_detector::OscillationState;
use hydroboom_description::Description;
use hydroboom_design::scheduled_lqr::{known_delay, scheduled_lqr_controller};
use hydroboom_virtual_crane::VirtualCrane;

/// Cycle under the scheduled LQR.
pub(crate) struct Cycle {
    /// Model with the estimated payload and transition pressure (means over the second half), and the
    /// estimated drive lag at the end.
    pub estimated: Description,
    /// Commands and measurements of the cycle.
    pub record: Record,
    /// Tracking errors of the cycle, true and measured.
    pub errors: Errors,
    /// The simulated machine at the end of the cycle.
    pub machine: VirtualCrane,
}

impl Cycle {
    /// Runs a cycle.
    ///
    /// # Errors
    ///
    /// [`LabError::Plant`] if the crane has no state of rest at the start; [`LabError::Design`] if the scheduled LQR
    /// cannot be designed for the model. [`LabError::Simulation`] if the state leaves the model's range of validity;
    /// [`LabError::Stopped`] on request.
    pub(crate) fn run(
        model: &Description,
        crane: &Description,
        course: &dyn Course,
        stages: &Stages<'_>,
    ) -> Result<Self, LabError> {
        let mut machine = at_rest(crane, course)?;
        let controller = Box::new(scheduled_lqr_controller(model)?);
        let mut controlled =
            Loop::start(model, controller, known_delay(model), course, &machine.measurement())?;
        let period = model.numbers.control_period;
        let periods = (course.duration() / period).round() as u64;
        let (mut record, mut errors) = (Record::new(period), Errors::default());
        let mut estimated = model.clone();
        let [mut payload, mut transition, mut count] = [0.0; 3];
        let mut drive_delay = model.numbers.tuning.estimator_drive_lag;
        for number in 0..periods {
            stages.within_run(number as usize, periods as usize)?;
            let measurement = machine.measurement();
            errors.push(&machine, course.reference(number as f64 * period).position);
            let now = Now { course, period, number };
            let [command] = controlled.command(now, &measurement)?.axes;
            machine.advance(&command).map_err(LabError::during("the closed-loop cycle"))?;
            record.push(command, measurement.axes[0].signals);
            if let (Some(of), true) = (controlled.controller.estimated(), 2 * number >= periods) {
                payload += of.filter.estimate.payload;
                transition += of.filter.estimate.transition_pressure;
                count += 1.0;
                drive_delay = of.drive.time_constant(period);
            }
        }
        stages.done(1.0);
        if count > 0.0 {
            estimated.numbers.payload = payload / count;
            estimated.numbers.transition = transition / count;
        }
        let estimated = with_drive_delay(&estimated, drive_delay);
        Ok(Self { estimated, record, errors, machine })
    }
}

/// Largest sustained oscillation of tracking errors \[m\], one per period \[s\], while the reference rests.
pub(crate) fn oscillation(
    errors: &[f64],
    period: f64,
    course: &dyn Course,
) -> Option<SustainedOscillation> {
    let mut state = OscillationState::default();
    let rests = |k: usize| course.reference(k as f64 * period).velocity == 0.0;
    let each = errors
        .iter()
        .enumerate()
        .filter_map(|(k, error)| SustainedOscillation::after(&mut state, *error, rests(k), period));
    each.max_by(|a, b| a.amplitude_mm.total_cmp(&b.amplitude_mm))
}

#[cfg(test)]
mod tests {
    use super::super::replay::{replayed, rms};
    use super::*;
    use crate::closed_loop::monte_carlo::member;
    use crate::closed_loop::scenario::CourseChoice;

    /// Precondition for a replay without reset.
    #[test]
    fn the_same_commands_from_the_same_rest_lead_to_the_same_state() {
        let model = Description::uia_single_boom().unwrap();
        let crane = Description::uia_virtual().unwrap();
        let course = CourseChoice::Motion(model.numbers.fast).of(&crane).unwrap();
        let go_on = |_: f64| true;
        let stages = Stages::new(2, &go_on);
        let cycle = Cycle::run(&model, &crane, course.as_ref(), &stages).unwrap();
        let Cycle { record, machine, .. } = cycle;
        let mut another = at_rest(&crane, course.as_ref()).unwrap();
        replayed(&record.commands, &mut another, course.as_ref(), &stages).unwrap();
        let [one, other] = [&machine, &another].map(|m| (m.truth().outputs, m.signals()));
        assert_eq!(one, other);
    }
    /// A cylinder at rest can hold any pressure within its friction. With soft oil this corresponds to
    /// millimetres of compression, by which a repeated cycle deviates. With stiff oil the cycle repeats
    /// itself.
    #[test]
    fn repeatability_depends_on_the_oils_stiffness_at_rest() {
        let model = Description::uia_single_boom().unwrap();
        let nominal = Description::uia_virtual().unwrap();
        let go_on = |_: f64| true;
        let [soft, stiff] = [16, 20].map(|number| {
            let crane = member(&nominal, 1, number).unwrap().crane;
            let course = CourseChoice::Motion(model.numbers.fast).of(&crane).unwrap();
            let stages = Stages::new(2, &go_on);
            let cycle = Cycle::run(&model, &crane, course.as_ref(), &stages).unwrap();
            let Cycle { record, mut machine, .. } = cycle;
            let again = replayed(&record.commands, &mut machine, course.as_ref(), &stages);
            1e3 * rms(&again.unwrap().1.true_error)
        });
        assert!(stiff < 0.5 && soft > 5.0, "{stiff} mm, {soft} mm");
    }
}
