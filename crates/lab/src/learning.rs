//! What a cycle teaches of a machine, and what open loop is worth with it.

use crate::LabError;
use crate::amended::amended;
use crate::closed_loop::scenario::{Course, CourseChoice};
use crate::following::Following;
use crate::hindsight::{Log, fitted};
use crate::interruptible::as_long_as;
use crate::open_loop::{OpenLoop, at_rest};
use crate::rehearsal::Rehearsal;
use crate::stand_in::StandIn;
use hydroboom_control::command::AxisCommand;
use hydroboom_control::learner::{Balances, Known, Learner};
use hydroboom_control::measurement::AxisSignals;
use hydroboom_description::Description;
use hydroboom_design::{balances, overrides, schedule};
use hydroboom_virtual_crane::VirtualCrane;
use serde::Serialize;

/// A cycle under model following.
pub(crate) struct Cycle {
    /// What it has taught.
    pub learner: Learner,
    /// What the machine was told, each control period.
    pub told: Vec<AxisCommand<f64>>,
    /// What was read of it at the beginning of each.
    pub read: Vec<AxisSignals<f64>>,
    /// The machine, where the cycle has left it.
    pub machine: VirtualCrane,
}

impl Cycle {
    /// Model following leads a crane along a course.
    pub(crate) fn of(
        model: &Description,
        crane: &Description,
        course: &dyn Course,
    ) -> Result<Self, LabError> {
        let start = course.reference(0.0).position;
        let mut machine = at_rest(crane, course)?;
        let mut following = Following::new(model, &machine.signals(), start)?;
        let period = model.numbers.control_period;
        let periods = (course.duration() / period).round() as u64;
        let mut told = Vec::with_capacity(periods as usize);
        let mut read = Vec::with_capacity(periods as usize);
        for k in 0..periods {
            let ahead = |after: f64| course.reference(k as f64 * period + after);
            let reading = machine.signals();
            let command = following.command(&ahead, course.speed(), &reading)?;
            machine.advance(&command).map_err(LabError::during("the cycle that teaches"))?;
            told.push(command);
            read.push(reading);
        }
        Ok(Self { learner: *following.learner(), told, read, machine })
    }
}

/// Tracking errors \[m\] of a machine that was read each period \[s\] of a course.
fn errors_of_read(read: &[AxisSignals<f64>], period: f64, course: &dyn Course) -> Vec<f64> {
    let reference = |k: usize| course.reference(k as f64 * period).position;
    read.iter().enumerate().map(|(k, at)| at.stroke - reference(k)).collect()
}

/// Tracking errors \[m\] of a machine that is told what led one through the cycle and not looked at.
fn errors_of_told(
    told: &[AxisCommand<f64>],
    machine: &mut VirtualCrane,
    course: &dyn Course,
) -> Result<Vec<f64>, LabError> {
    let period = machine.period();
    let mut errors = Vec::with_capacity(told.len());
    for (k, command) in told.iter().enumerate() {
        let reference = course.reference(k as f64 * period);
        errors.push(machine.signals().stroke - reference.position);
        machine.advance(command).map_err(LabError::during("the cycle once more"))?;
    }
    Ok(errors)
}

/// What a cycle under model following is worth for one crane.
#[derive(Clone, Debug, Serialize)]
pub struct Taught {
    /// Its name.
    pub crane: String,
    /// The course, of which one cycle taught.
    pub course: String,
    /// RMS error in closed loop, in the cycle that taught; none where it could not be run.
    pub closed_loop_mm: Option<f64>,
    /// RMS error in open loop, the model as it is; none where it could not be run.
    pub before_mm: Option<f64>,
    /// The same with what was learned on the way.
    pub after_mm: Option<f64>,
    /// The same with that fitted in hindsight, until the model goes through the cycle as the machine went.
    pub in_hindsight_mm: Option<f64>,
    /// A machine that rests as it did and is told what led it through the cycle, amended by what that model says it takes to be where the reference is. Of all
    /// in open loop it hangs least on the model, and most on the rest.
    pub amended_mm: Option<f64>,
    /// The same as in hindsight straight on: from where the cycle has left the machine, in place of the rest that it began from. The model goes on from where the cycle
    /// has left the model.
    pub straight_on_mm: Option<f64>,
    /// What comes of it, straight on, if the machine is told the very motor speed once more that led it through the cycle: as a model that
    /// knows the machine perfectly, but not in what state the cycle has left it.
    pub told_again_mm: Option<f64>,
    /// What was learned on the way, as overrides of the model's crane file.
    pub set: Vec<String>,
    /// The same in hindsight: it suits the course of the cycle.
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
    let before = OpenLoop::new(model, &believed(model)?)?;
    let mut taught = Taught {
        crane: name.into(),
        course: course.name(),
        closed_loop_mm: None,
        before_mm: rms_mm(before.errors(crane, course)),
        after_mm: None,
        in_hindsight_mm: None,
        amended_mm: None,
        straight_on_mm: None,
        told_again_mm: None,
        set: Vec::new(),
        set_in_hindsight: Vec::new(),
    };
    if let Ok(Cycle { learner, told, read, mut machine }) = Cycle::of(model, crane, course) {
        taught.closed_loop_mm = rms_mm(Ok(errors_of_read(&read, machine.period(), course)));
        let known = learner.known();
        // a crane for which no state feedback can be designed has nothing to show, and the others have
        if let Ok(learned) = OpenLoop::new(model, &known) {
            taught.after_mm = rms_mm(learned.errors(crane, course));
            taught.set = overrides(model, learned.informed());
        }
        let log = Log { told: &told, read: &read };
        let fitted = fitted(model, &known, &log)?;
        taught.set_in_hindsight = overrides(model, &fitted);
        let begun = read.first().map_or(0.0, |reading| reading.stroke);
        let amended = StandIn::new(&fitted, begun).and_then(|begun| amended(&begun, &log, course));
        taught.amended_mm = told_rms_mm(amended, &mut at_rest(crane, course)?, course);
        let rehearsal = Rehearsal { model, learner: &learner, machine: &fitted };
        let in_hindsight = rehearsal.told(course, &[], begun);
        taught.in_hindsight_mm = told_rms_mm(in_hindsight, &mut at_rest(crane, course)?, course);
        // told the same from the same rest, another is left in the same state
        let mut another = at_rest(crane, course)?;
        if errors_of_told(&told, &mut another, course).is_ok() {
            let straight_on = rehearsal.told(course, &told, another.signals().stroke);
            taught.straight_on_mm = told_rms_mm(straight_on, &mut another, course);
        }
        taught.told_again_mm = rms_mm(errors_of_told(&told, &mut machine, course));
    }
    Ok(taught)
}

/// Root of the mean square \[mm\]; a crane that cannot be steered so has no error to show.
fn rms_mm(errors: Result<Vec<f64>, LabError>) -> Option<f64> {
    let errors = errors.ok()?;
    let square: f64 = errors.iter().map(|error| error * error).sum();
    Some(1e3 * (square / errors.len() as f64).sqrt())
}

/// The same of a machine that is told so and not looked at.
fn told_rms_mm(
    told: Result<Vec<AxisCommand<f64>>, LabError>,
    machine: &mut VirtualCrane,
    course: &dyn Course,
) -> Option<f64> {
    rms_mm(told.and_then(|told| errors_of_told(&told, machine, course)))
}

/// What the model has before anything is learned.
pub(crate) fn believed(model: &Description) -> Result<Known, LabError> {
    let Balances { flow, lag, .. } = balances(model, &schedule(model)?);
    let payload = model.numbers.payload;
    let (balance, lag) = (flow.before, lag.before);
    Ok(Known { weighed: payload, payload, friction: [1.0; 2], balance, lag })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::closed_loop::monte_carlo::member;

    /// An empty boom whose pressure has to fall by 11 bar on oil an eightieth as stiff as it gets, as it starts down: where feedback may ask for no more of
    /// the motor than on stiff oil it is 2 mm off, and no model amends that.
    #[test]
    fn a_light_crane_on_soft_oil_is_within_a_millimetre_in_closed_loop() {
        let model = Description::uia_single_boom().unwrap();
        let nominal = Description::uia_virtual().unwrap();
        let crane = member(&nominal, 1, 134).unwrap().crane;
        let course = CourseChoice::Motion(model.numbers.fast).of(&crane).unwrap();
        let Cycle { read, .. } = Cycle::of(&model, &crane, course.as_ref()).unwrap();
        let errors = errors_of_read(&read, model.numbers.control_period, course.as_ref());
        let closed_loop = rms_mm(Ok(errors)).unwrap();
        assert!(closed_loop < 1.0, "{closed_loop} mm");
    }

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
