//! Open loop by rehearsal: the scheduled LQR leads a model that stands in for the machine, and what that was commanded, amended, is commanded of the machine.

use crate::LabError;
use crate::amended::amended;
use crate::closed_loop::scenario::Course;
use crate::closed_loop::simulation::{Loop, Now};
use crate::hindsight::Log;
use crate::stand_in::StandIn;
use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::{AxisSignals, Measurement};
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::reference::trajectory::Trajectory;
use hydroboom_description::Description;
use hydroboom_design::scheduled_lqr::scheduled_lqr_controller;

/// Commands \[rev/s\] for a machine along a course, each control period. `model` stands in for the machine, which is read to be at `stroke` \[m\], and was
/// commanded `came` since it rested where the course begins.
///
/// The loop on the model is as good as the loop on the machine, and no better: its error there is known, and amended.
///
/// # Errors
///
/// [`LabError`] when there is no scheduled LQR for the model, or the model has no rest there, or cannot go the way.
pub(crate) fn rehearsed(
    model: &Description,
    course: &dyn Course,
    came: &[AxisCommand<f64>],
    stroke: f64,
) -> Result<Vec<AxisCommand<f64>>, LabError> {
    let here = moved(model, came, course.reference(0.0).position)?;
    // by how much the machine is farther out than what stands in for it
    let farther = stroke - here.signals().stroke;
    let told = led(model, here.clone(), farther, course)?;
    let mut read = Vec::with_capacity(told.len());
    let mut stand_in = here.clone();
    for command in &told {
        read.push(read_of(&stand_in, farther));
        stand_in.advance(command).map_err(LabError::during("the rehearsal once more"))?;
    }
    amended(&here, &Log { told: &told, read: &read }, course)
}

/// The model where it has come to from its rest at `start` \[m\]: the pressure that friction holds there depends on how it came.
fn moved(model: &Description, came: &[AxisCommand<f64>], start: f64) -> Result<StandIn, LabError> {
    let mut stand_in = StandIn::new(model, start)?;
    let during = LabError::during("what came before the rehearsal");
    came.iter().try_for_each(|command| stand_in.advance(command)).map_err(during)?;
    Ok(stand_in)
}

/// Commands of the scheduled LQR along the course. The dead time is left out of the loop and the reference taken as much earlier, since it is known.
fn led(
    model: &Description,
    stand_in: StandIn,
    farther: f64,
    course: &dyn Course,
) -> Result<Vec<AxisCommand<f64>>, LabError> {
    let earlier = Earlier { course, time: stand_in.motor().dead_time() };
    let mut machine = stand_in.without_dead_time();
    let period = machine.motor().period();
    let measured = |number: u64, machine: &StandIn| {
        let time = number as f64 * period;
        Measurement::new(number + 1, time, [read_of(machine, farther)])
    };
    let controller = Box::new(scheduled_lqr_controller(model)?);
    let mut controlled = Loop::start(model, controller, 0, &earlier, &measured(0, &machine))?;
    let periods = (course.duration() / period).round() as u64;
    let command = |number: u64| {
        let now = Now { course: &earlier, period, number };
        let [command] = controlled.command(now, &measured(number, &machine))?.axes;
        machine.advance(&command).map_err(LabError::during("the rehearsal"))?;
        Ok(command)
    };
    (0..periods).map(command).collect()
}

/// A course some time earlier.
struct Earlier<'a> {
    course: &'a dyn Course,
    /// By how much \[s\].
    time: f64,
}

impl Trajectory for Earlier<'_> {
    fn reference(&self, t: f64) -> SetPoint<f64> {
        self.course.reference(t + self.time)
    }
    fn duration(&self) -> f64 {
        self.course.duration() - self.time
    }
    fn speed(&self) -> f64 {
        self.course.speed()
    }
}

impl Course for Earlier<'_> {
    fn name(&self) -> String {
        self.course.name()
    }
}

/// What would be read of a machine that is so much farther out than what stands in for it \[m\].
fn read_of(stand_in: &StandIn, farther: f64) -> AxisSignals<f64> {
    let mut reading = stand_in.signals();
    reading.stroke += farther;
    reading
}
