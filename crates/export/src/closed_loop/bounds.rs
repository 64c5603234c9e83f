//! Bounds on the outcome of a trial, computed from the crane file's limits.

use super::case::{Bad, Case, Moment};
use super::trial::Outcome;
use hydroboom_control::supervision::fault::{Cause, Severity};
use hydroboom_control::supervision::frame::{FrameInput, STATUS_FAULT, frame_phase};
use hydroboom_control::supervision::supervisor::CONTROLLED_RAMP;
use hydroboom_description::Description;
use hydroboom_design::{DesignError, limits};
use std::f64::consts::TAU;

/// Movement allowed for engagement, a hold or one wrong sample \[m\].
const BUMPLESS: f64 = 1e-3;
/// Periods until a wrong input is detected: one tolerated, the second, and one more for the reaction.
const FOUND_AFTER: f64 = 3.0;

/// Bounds on the true motion of the machine in one trial, from the limits of the crane file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Largest lift during the balance test \[m\].
    pub lifted: f64,
    /// Largest drop below the held position \[m\]: 1 mm, the largest step of a bumpless transfer.
    pub dropped: f64,
    /// Largest movement during engagement of the controller \[m\]: 1 mm.
    pub engaged: f64,
    /// Largest deviation from the reference until a stop \[m\].
    pub strayed: f64,
    /// Largest stopping distance \[m\].
    pub stopped: f64,
    /// Largest difference to the undisturbed course if control continues \[m\].
    pub off: f64,
    /// Largest motor speed \[rev/s\] and its largest slew rate \[rev/s²\].
    pub motor: (f64, f64),
}

/// Bounds of a trial on a crane. `model` is the crane that the controller was designed for. `undisturbed` is the
/// outcome of the trial without disturbance. `outcome` is that of the trial, whose fault decides how it may stop.
///
/// # Errors
///
/// [`DesignError`] if no limits can be derived for the crane.
pub fn bounds(
    model: &Description,
    case: &Case,
    undisturbed: &Outcome,
    outcome: &Outcome,
) -> Result<Bounds, DesignError> {
    let n = &model.numbers;
    let l = limits(model, n.fast)?;
    // with a wrong measurement the piston may reach the speed of the motor's limit
    let fastest = l.motor_speed * l.speed_per_motor_speed;
    let is_frozen = case.disturbed.is_some_and(|d| d.bad == Bad::Frozen);
    let moves = case.disturbed.map(|d| d.moment).or(case.gain.map(|(_, when)| when))
        == Some(Moment::Motion);
    let speed = match (is_frozen, moves) {
        (true, _) => fastest,
        (false, true) => n.fast,
        (false, false) => 0.0,
    };
    // rounding of a command in single precision
    let rounding = f64::from(f32::EPSILON) * l.motor_speed / n.control_period;
    // residual oscillation after a stop: amplitude v/ω of the load mode
    let swings = speed * l.still.1 / TAU;
    // a commanded hold, and faults that decelerate instead of closing the valve at once
    let cause = Cause::from_number(outcome.status - STATUS_FAULT);
    let is_controlled = cause.is_none_or(|cause| cause.severity() == Severity::Controlled);
    let stopping = match is_controlled {
        true => 0.5 * CONTROLLED_RAMP * l.stop_time + l.valve_time,
        false => l.valve_time + l.motor_speed / l.motor_slew,
    };
    let deviation = match (case.disturbed, is_frozen) {
        (Some(d), true) if d.input == reference() => fastest * f64::from(d.periods) * l.period,
        // the velocity feedforward is wrong by the whole velocity, which position feedback compensates
        (Some(_), true) => (fastest * l.stuck).max(n.fast / n.proportional),
        (Some(_), false) => speed * FOUND_AFTER * l.period,
        (None, _) => l.creep,
    };
    Ok(Bounds {
        lifted: l.creep,
        dropped: BUMPLESS,
        engaged: BUMPLESS,
        strayed: undisturbed.error + deviation + BUMPLESS,
        stopped: speed * stopping + swings + BUMPLESS,
        off: match case.disturbed {
            Some(d) if d.periods == 1 => BUMPLESS,
            _ => undisturbed.error + deviation,
        },
        motor: (l.motor_speed, l.motor_slew + rounding),
    })
}

/// Index of the position reference among the inputs.
fn reference() -> usize {
    FrameInput::NAMES.iter().position(|name| *name == "reference_position").unwrap_or_default()
}

impl Bounds {
    /// Names of the outcomes that exceed their bounds; empty if none does.
    pub fn beyond(
        &self,
        case: &Case,
        undisturbed: &Outcome,
        outcome: &Outcome,
    ) -> Vec<&'static str> {
        // with a changed load or gain the undisturbed course is no reference
        let is_changed = case.disturbed.is_some() || case.gain.is_some();
        let goes_on = case.moves && is_changed && outcome.status == frame_phase::CONTROLLING;
        // tolerance for the rounding of a command at its limit
        let above = |value: f64, bound: f64| value > bound * (1.0 + 1e-9);
        // one wrong sample must not cause a stop, except in inputs that command one
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
