//! What a trial may come to at most, computed from the crane file's limits.

use super::case::{Bad, Case, Moment};
use super::trial::Outcome;
use hydroboom_control::supervision::fault::{Cause, Severity};
use hydroboom_control::supervision::frame::{FrameInput, STATUS_FAULT, frame_phase};
use hydroboom_control::supervision::supervisor::CONTROLLED_RAMP;
use hydroboom_description::Description;
use hydroboom_design::{DesignError, limits};
use std::f64::consts::TAU;

/// Movement that engaging, a hold or one wrong sample may cost \[m\].
const BUMPLESS: f64 = 1e-3;
/// Periods until an input that is wrong is found: the one that is borne, the next, and one more.
const FOUND_AFTER: f64 = 3.0;

/// Bounds of a trial.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Largest lift while the balance is proven \[m\].
    pub lifted: f64,
    /// Largest drop \[m\].
    pub dropped: f64,
    /// Largest movement as the controller engages \[m\].
    pub engaged: f64,
    /// Largest distance to the reference until a stop \[m\].
    pub strayed: f64,
    /// Largest way of a stop \[m\].
    pub stopped: f64,
    /// Largest difference to the undisturbed course, where the controller goes on \[m\].
    pub off: f64,
    /// Largest motor speed \[rev/s\] and change of it \[rev/s²\].
    pub motor: (f64, f64),
}

/// Bounds of a trial on a crane, beside the undisturbed one.
///
/// # Errors
///
/// [`DesignError`] where there are no limits for the crane.
pub fn bounds(
    model: &Description,
    case: &Case,
    undisturbed: &Outcome,
    outcome: &Outcome,
) -> Result<Bounds, DesignError> {
    let n = &model.numbers;
    let l = limits(model, n.fast)?;
    // a piston that is misled is as fast as its motor can drive it
    let fastest = l.motor_speed * l.speed_per_motor_speed;
    let is_frozen = case.disturbed.is_some_and(|d| d.bad == Bad::Frozen);
    let moves = case.disturbed.map(|d| d.moment).or(case.gain.map(|(_, when)| when))
        == Some(Moment::Motion);
    let speed = match (is_frozen, moves) {
        (true, _) => fastest,
        (false, true) => n.fast,
        (false, false) => 0.0,
    };
    // a command in single precision is rounded
    let rounding = f64::from(f32::EPSILON) * l.motor_speed / n.control_period;
    // what a stop leaves swings on by v/ω of the load mode
    let swings = speed * l.still.1 / TAU;
    // asked to hold, and for the milder causes
    let cause = Cause::from_number(outcome.status - STATUS_FAULT);
    let is_controlled = cause.is_none_or(|cause| cause.severity() == Severity::Controlled);
    let stopping = match is_controlled {
        true => 0.5 * CONTROLLED_RAMP * l.stop_time + l.valve_time,
        false => l.valve_time + l.motor_speed / l.motor_slew,
    };
    let goes_astray = match (case.disturbed, is_frozen) {
        (Some(d), true) if d.input == reference() => fastest * f64::from(d.periods) * l.period,
        // the velocity feedforward is off by the whole velocity, and feedback makes up for it
        (Some(_), true) => (fastest * l.stuck).max(n.fast / n.proportional),
        (Some(_), false) => speed * FOUND_AFTER * l.period,
        (None, _) => l.creep,
    };
    Ok(Bounds {
        lifted: l.creep,
        dropped: BUMPLESS,
        engaged: BUMPLESS,
        strayed: undisturbed.error + goes_astray + BUMPLESS,
        stopped: speed * stopping + swings + BUMPLESS,
        off: match case.disturbed {
            Some(d) if d.periods == 1 => BUMPLESS,
            _ => undisturbed.error + goes_astray,
        },
        motor: (l.motor_speed, l.motor_slew + rounding),
    })
}

/// Place of the reference's position in the input.
fn reference() -> usize {
    FrameInput::NAMES.iter().position(|name| *name == "reference_position").unwrap_or_default()
}

impl Bounds {
    /// What of an outcome is beyond its bound, in words; nothing where all is within.
    pub fn beyond(
        &self,
        case: &Case,
        undisturbed: &Outcome,
        outcome: &Outcome,
    ) -> Vec<&'static str> {
        // another load's course is no measure
        let is_changed = case.disturbed.is_some() || case.gain.is_some();
        let goes_on = case.moves && is_changed && outcome.status == frame_phase::CONTROLLING;
        // rounding of a command that is at its limit
        let above = |value: f64, bound: f64| value > bound * (1.0 + 1e-9);
        // one sample stops nothing, but for what asks for a stop
        let asks = ["enable", "hold", "valve_state"];
        let is_sample = case
            .disturbed
            .is_some_and(|d| d.periods == 1 && !asks.contains(&FrameInput::NAMES[d.input]));
        let has_stopped = outcome.status != frame_phase::CONTROLLING;
        let all = [
            (outcome.broke.is_some(), "the machine broke"),
            (is_sample && has_stopped, "stopped by one sample"),
            (outcome.is_not_finite, "an output is not finite"),
            (above(outcome.lifted, self.lifted), "lift"),
            (above(outcome.dropped, self.dropped), "drop"),
            (above(outcome.engaged, self.engaged), "engaging"),
            (above(outcome.strayed, self.strayed), "distance to the reference"),
            (above(outcome.stopped_in, self.stopped), "way of the stop"),
            (goes_on && above(outcome.off(undisturbed), self.off), "difference to the course"),
            (above(outcome.motor_speed, self.motor.0), "motor speed"),
            (above(outcome.motor_slew, self.motor.1), "change of motor speed"),
        ];
        all.into_iter().filter(|(is, _)| *is).map(|(_, what)| what).collect()
    }
}
