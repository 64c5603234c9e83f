//! What a cycle teaches of a machine, and what open loop is worth with it.

use crate::LabError;
use crate::following::Following;
use crate::open_loop::OpenLoop;
use crate::scenario::{Course, CourseChoice};
use hydroboom_control::{Balances, Known};
use hydroboom_description::Description;
use hydroboom_design::{balances, overrides, schedule};
use hydroboom_virtual_crane::VirtualCrane;
use rayon::prelude::*;
use serde::Serialize;

/// What model following has learned of a crane once it has led it along a course.
///
/// # Errors
///
/// [`LabError`] when a crane cannot be built or simulated.
fn learned(
    model: &Description,
    crane: &Description,
    course: &dyn Course,
) -> Result<Known, LabError> {
    let start = course.reference(0.0).position;
    let mut machine = VirtualCrane::new(crane, &crane.start(start))?;
    let mut following = Following::new(model, &machine.reading(), &machine.measured(), start)?;
    let period = model.numbers.control_period;
    for k in 0..(course.duration() / period).round() as u64 {
        let reference = course.reference(k as f64 * period);
        let command = following.command(&reference, &machine.reading(), &machine.measured())?;
        machine.advance(&command).map_err(LabError::during("the cycle that teaches"))?;
    }
    Ok(following.known())
}

/// What a cycle under model following is worth for one crane.
#[derive(Clone, Debug, Serialize)]
pub struct Taught {
    /// Its name.
    pub crane: String,
    /// The course, of which one cycle taught.
    pub course: String,
    /// RMS error in open loop, the model as it is; none where it could not be run.
    pub before_mm: Option<f64>,
    /// The same with what was learned.
    pub after_mm: Option<f64>,
    /// What was learned, as overrides of the model's crane file.
    pub set: Vec<String>,
}

/// One cycle of each course on each crane, then the same in open loop, on all cores; `progress` is told of each.
///
/// # Errors
///
/// [`LabError`] when a crane cannot be built.
pub fn taught(
    model: &Description,
    cranes: &[(String, Description)],
    courses: &[CourseChoice],
    progress: &(dyn Fn() + Sync),
) -> Result<Vec<Taught>, LabError> {
    let jobs: Vec<_> =
        cranes.iter().flat_map(|crane| courses.iter().map(move |course| (crane, course))).collect();
    let one = |((name, crane), choice): &(&(String, Description), &CourseChoice)| {
        let taught = cycle(model, crane, name, choice.of(crane)?.as_ref());
        progress();
        taught
    };
    jobs.par_iter().map(one).collect()
}

fn cycle(
    model: &Description,
    crane: &Description,
    name: &str,
    course: &dyn Course,
) -> Result<Taught, LabError> {
    // a crane that cannot be steered so has no error to show
    let rms = |open: &OpenLoop| {
        let errors = open.errors(crane, course).ok()?;
        let square: f64 = errors.iter().map(|error| error * error).sum();
        Some(1e3 * (square / errors.len() as f64).sqrt())
    };
    let before = OpenLoop::new(model, &believed(model)?)?;
    let informed = match learned(model, crane, course) {
        Ok(known) => Some(OpenLoop::new(model, &known)?),
        Err(_) => None,
    };
    Ok(Taught {
        crane: name.into(),
        course: course.name(),
        before_mm: rms(&before),
        after_mm: informed.as_ref().and_then(rms),
        set: informed.map_or(Vec::new(), |open| overrides(model, open.informed())),
    })
}

/// What the model has before anything is learned.
fn believed(model: &Description) -> Result<Known, LabError> {
    let Balances { flow, lag, .. } = balances(model, &schedule(model)?);
    let payload = model.numbers.payload;
    let (balance, lag) = (flow.before, lag.before);
    Ok(Known { weighed: payload, payload, friction: [1.0; 2], balance, lag })
}
