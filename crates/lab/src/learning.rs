//! What a cycle under the scheduled LQR tells of a machine, and what open loop is worth with it.

use crate::LabError;
use crate::amended::amended;
use crate::closed_loop::metrics::SustainedOscillation;
use crate::closed_loop::scenario::{Course, CourseChoice};
use crate::closed_loop::simulation::{Loop, Now};
use crate::hindsight::{Log, fitted, overrides};
use crate::interruptible::as_long_as;
use crate::rehearsal::rehearsed;
use crate::stand_in::StandIn;
use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::AxisSignals;
use hydroboom_control::supervision::oscillation_detector::OscillationState;
use hydroboom_description::Description;
use hydroboom_design::scheduled_lqr::{known_delay, scheduled_lqr_controller};
use hydroboom_virtual_crane::VirtualCrane;
use serde::Serialize;

/// A cycle under the scheduled LQR.
struct Cycle {
    /// The model with mean payload and transition pressure of the second half, and the drive's lag at the end, as estimated.
    estimated: Description,
    /// Commands, each control period.
    told: Vec<AxisCommand<f64>>,
    /// Readings at the beginning of each.
    read: Vec<AxisSignals<f64>>,
    /// Tracking error at the beginning of each.
    errors: Vec<Off>,
    /// The machine, where the cycle has left it.
    machine: VirtualCrane,
}

impl Cycle {
    /// The scheduled LQR leads a crane along a course.
    fn of(model: &Description, crane: &Description, course: &dyn Course) -> Result<Self, LabError> {
        let mut machine = at_rest(crane, course)?;
        let controller = Box::new(scheduled_lqr_controller(model)?);
        let mut controlled =
            Loop::start(model, controller, known_delay(model), course, &machine.measurement())?;
        let period = model.numbers.control_period;
        let periods = (course.duration() / period).round() as u64;
        let mut told = Vec::with_capacity(periods as usize);
        let mut read = Vec::with_capacity(periods as usize);
        let mut errors = Vec::with_capacity(periods as usize);
        let mut estimated = model.clone();
        let [mut payload, mut transition, mut count] = [0.0; 3];
        for number in 0..periods {
            let measurement = machine.measurement();
            errors.push(Off::of(&machine, course.reference(number as f64 * period).position));
            let now = Now { course, period, number };
            let [command] = controlled.command(now, &measurement)?.axes;
            machine.advance(&command).map_err(LabError::during("the cycle"))?;
            told.push(command);
            read.push(measurement.axes[0].signals);
            if let (Some(of), true) = (controlled.controller.estimated(), 2 * number >= periods) {
                payload += of.filter.estimate.payload;
                transition += of.filter.estimate.transition_pressure;
                count += 1.0;
                estimated.numbers.tuning.estimator_drive_lag = of.drive.time_constant(period);
            }
        }
        if count > 0.0 {
            estimated.numbers.payload = payload / count;
            estimated.numbers.transition = transition / count;
        }
        Ok(Self { estimated, told, read, errors, machine })
    }
}

/// A crane that has long been at rest where a course begins.
pub(crate) fn at_rest(crane: &Description, course: &dyn Course) -> Result<VirtualCrane, LabError> {
    Ok(VirtualCrane::new(crane, &crane.start(course.reference(0.0).position))?)
}

/// Tracking error of a period \[m\]: of the piston itself, and as its sensor reads it.
#[derive(Clone, Copy, Debug)]
struct Off {
    truth: f64,
    measured: f64,
}

impl Off {
    /// Of a machine from where it should be \[m\].
    fn of(machine: &VirtualCrane, position: f64) -> Self {
        let (truth, measured) = (machine.truth().outputs.stroke, machine.signals().stroke);
        Self { truth: truth - position, measured: measured - position }
    }
}

/// RMS of the tracking error over a course.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Rms {
    /// Of the piston itself.
    pub rms_true_mm: f64,
    /// As its sensor reads it.
    pub rms_measured_mm: f64,
}

/// Tracking errors of a machine that is told what led one through the cycle and not looked at.
fn errors_of_told(
    told: &[AxisCommand<f64>],
    machine: &mut VirtualCrane,
    course: &dyn Course,
) -> Result<Vec<Off>, LabError> {
    let period = machine.period();
    let mut errors = Vec::with_capacity(told.len());
    for (k, command) in told.iter().enumerate() {
        let reference = course.reference(k as f64 * period);
        errors.push(Off::of(machine, reference.position));
        machine.advance(command).map_err(LabError::during("the cycle once more"))?;
    }
    Ok(errors)
}

/// What a cycle under the scheduled LQR is worth for one crane.
#[derive(Clone, Debug, Serialize)]
pub struct Taught {
    /// Its name.
    pub crane: String,
    /// The course, of which one cycle taught.
    pub course: String,
    /// RMS error in closed loop, in the cycle that taught; none where it could not be run.
    pub closed_loop: Option<Rms>,
    /// Whether that loop came to rest where its reference rested: not in a sustained oscillation, and not where the cycle could not be run.
    pub stable: bool,
    /// That oscillation.
    pub sustained_oscillation: Option<SustainedOscillation>,
    /// RMS error in open loop, commanded as the model was in a rehearsal, the model as it is described; none where it could not be run.
    pub before: Option<Rms>,
    /// The same with the model fitted to the cycle in hindsight, until it goes through it as the machine went.
    pub in_hindsight: Option<Rms>,
    /// A machine that rests as it did and is told what led it through the cycle, amended by what that model says it takes to be where the reference is. Of all
    /// in open loop it hangs least on the model, and most on the rest.
    pub amended: Option<Rms>,
    /// The same as in hindsight straight on: from where the cycle has left the machine, in place of the rest that it began from. The model goes on from where the cycle
    /// has left the model.
    pub straight_on: Option<Rms>,
    /// What comes of it, straight on, if the machine is told the very motor speed once more that led it through the cycle: as a model that
    /// knows the machine perfectly, but not in what state the cycle has left it.
    pub told_again: Option<Rms>,
    /// What was fitted in hindsight, as overrides of the model's crane file: it suits the course of the cycle.
    pub set_in_hindsight: Vec<String>,
}

/// One cycle of each course on each crane, then the same in open loop, on all cores. `go_on` is told of each and says whether to: if not, what
/// is done by then is all there is.
///
/// # Errors
///
/// [`LabError`] when a crane cannot be built.
pub fn taught(
    model: &Description,
    cranes: &[(String, Description)],
    courses: &[CourseChoice],
    go_on: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<Taught>, LabError> {
    let jobs: Vec<_> =
        cranes.iter().flat_map(|crane| courses.iter().map(move |course| (crane, course))).collect();
    let one = |((name, crane), choice): &(&(String, Description), &CourseChoice)| {
        cycle(model, crane, name, choice.of(crane)?.as_ref())
    };
    as_long_as(&jobs, &|_| go_on(), one).into_iter().flatten().collect()
}

fn cycle(
    model: &Description,
    crane: &Description,
    name: &str,
    course: &dyn Course,
) -> Result<Taught, LabError> {
    let start = course.reference(0.0).position;
    let before = rehearsed(model, course, &[], start);
    let mut taught = Taught {
        crane: name.into(),
        course: course.name(),
        closed_loop: None,
        stable: false,
        sustained_oscillation: None,
        before: told_rms(before, &mut at_rest(crane, course)?, course),
        in_hindsight: None,
        amended: None,
        straight_on: None,
        told_again: None,
        set_in_hindsight: Vec::new(),
    };
    if let Ok(Cycle { estimated, told, read, errors, mut machine }) =
        Cycle::of(model, crane, course)
    {
        taught.sustained_oscillation = oscillation(&errors, machine.period(), course);
        taught.stable = taught.sustained_oscillation.is_none();
        taught.closed_loop = rms_of(Ok(errors));
        let log = Log { told: &told, read: &read };
        let fitted = fitted(&estimated, &log)?;
        taught.set_in_hindsight = overrides(model, &fitted);
        let begun = read.first().map_or(0.0, |reading| reading.stroke);
        let amended = StandIn::new(&fitted, begun).and_then(|begun| amended(&begun, &log, course));
        taught.amended = told_rms(amended, &mut at_rest(crane, course)?, course);
        let in_hindsight = rehearsed(&fitted, course, &[], begun);
        taught.in_hindsight = told_rms(in_hindsight, &mut at_rest(crane, course)?, course);
        // told the same from the same rest, another is left in the same state
        let mut another = at_rest(crane, course)?;
        if errors_of_told(&told, &mut another, course).is_ok() {
            let straight_on = rehearsed(&fitted, course, &told, another.signals().stroke);
            taught.straight_on = told_rms(straight_on, &mut another, course);
        }
        taught.told_again = rms_of(errors_of_told(&told, &mut machine, course));
    }
    Ok(taught)
}

/// The largest sustained oscillation of the piston, an error each period \[s\], while the reference rests.
fn oscillation(errors: &[Off], period: f64, course: &dyn Course) -> Option<SustainedOscillation> {
    let mut state = OscillationState::default();
    let rests = |k: usize| course.reference(k as f64 * period).velocity == 0.0;
    let each = errors.iter().enumerate().filter_map(|(k, error)| {
        SustainedOscillation::after(&mut state, error.truth, rests(k), period)
    });
    each.max_by(|a, b| a.amplitude_mm.total_cmp(&b.amplitude_mm))
}

/// Root of the mean square; a crane that cannot be steered so has no error to show.
fn rms_of(errors: Result<Vec<Off>, LabError>) -> Option<Rms> {
    let errors = errors.ok()?;
    let of = |error: fn(&Off) -> f64| {
        let square: f64 = errors.iter().map(|at| error(at).powi(2)).sum();
        1e3 * (square / errors.len() as f64).sqrt()
    };
    Some(Rms { rms_true_mm: of(|at| at.truth), rms_measured_mm: of(|at| at.measured) })
}

/// The same of a machine that is told so and not looked at.
fn told_rms(
    told: Result<Vec<AxisCommand<f64>>, LabError>,
    machine: &mut VirtualCrane,
    course: &dyn Course,
) -> Option<Rms> {
    rms_of(told.and_then(|told| errors_of_told(&told, machine, course)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is measured straight on rests on it.
    #[test]
    fn told_the_same_from_the_same_rest_a_machine_does_the_same() {
        let model = Description::uia_single_boom().unwrap();
        let crane = Description::uia_virtual().unwrap();
        let course = CourseChoice::Motion(model.numbers.fast).of(&crane).unwrap();
        let Cycle { told, machine, .. } = Cycle::of(&model, &crane, course.as_ref()).unwrap();
        let mut another = at_rest(&crane, course.as_ref()).unwrap();
        errors_of_told(&told, &mut another, course.as_ref()).unwrap();
        let [one, other] = [&machine, &another].map(|m| (m.truth().outputs, m.signals()));
        assert_eq!(one, other);
    }
}
