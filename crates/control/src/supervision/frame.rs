//! The frame around a controller that runs without the supervisor: on a PLC, in C, as an FMU.
//!
//! It holds the load, releases it by proof of balance, lets the controller move it, and stops it. It is
//! the supervisor's release, monitors and limits as one function of numbers: called once a control
//! period, generic over `Real`, its states are numbers and its branches `select`, so that it can be
//! recorded for export.
//!
//! ```text
//! idle -enable-> holding -start-> releasing -proven-> opening -valve time-> controlling
//!   controlling -hold-> stopping -> holding
//!   any fault -> fault -reset, all well-> holding;   not enabled -> idle, valve shut at once
//! ```
//!
//! What it cannot know without a clock, an operator or a second channel the supervisor has beside it:
//! lost periods, somebody who attends, position against delivered flow.

mod limits;
mod memory;
mod monitors;
mod plausibility;
mod signals;

pub use limits::FrameLimits;
pub use memory::{FrameMemory, FrameState, frame_phase};
pub use signals::{FrameInput, FrameOutput, STATUS_FALLBACK, STATUS_FAULT};

use super::drive_monitor::DriveMonitor;
use super::fault::{Cause, is_held_at_once};
use super::limits::Limits;
use super::oscillation_detector::OscillationDetector;
use super::release::{Release, ReleaseInput, ReleaseState, phase};
use super::supervisor::CONTROLLED_RAMP;
use crate::reference::profile::SetPoint;
use hydroboom_math::Real;
use monitors::Wrong;

/// Share of the reference's velocity by which an offset of the reference is taken back.
const OFFSET_SHARE: f64 = 0.1;
/// Time that a controller has until it could take over, before the pump turns \[s\].
const READY_TIME: f64 = 20.0;
/// Reference velocity below which the reference rests \[m/s\].
const RESTS: f64 = 1e-6;
/// Motor speed \[rev/s\] that stands for "no command": beyond any motor, as not every language has NaN.
pub const NO_COMMAND: f64 = 1e6;
/// Slack for rounding in what a reference does within a period \[m\].
const REFERENCE_SLACK: f64 = 1e-4;

/// Frame around an exported controller: release, monitors and limits. Its state is a [`FrameState`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame<T> {
    /// Limits of motion, pressures and times.
    pub limits: FrameLimits<T>,
    /// Monitor of the drive.
    pub drive: DriveMonitor<T>,
    /// Release of the load.
    pub release: Release<T>,
    /// Detector of sustained oscillation.
    pub oscillation: OscillationDetector<T>,
}

/// Inputs of the controller within the frame, and its tasks in this control period.
#[derive(Clone, Copy, Debug)]
pub struct Directive<T: Real> {
    /// Piston position \[m\], as measured, or the last plausible one.
    pub stroke: T,
    /// Gauge pressure on the piston side \[Pa\], as measured, or the last plausible one.
    pub pressure_a: T,
    /// Gauge pressure on the rod side \[Pa\], as measured, or the last plausible one.
    pub pressure_b: T,
    /// Motor speed \[rev/s\], as measured, or the last plausible one.
    pub motor_speed_read: T,
    /// Whether the position is a plausible measurement, not a substitute.
    pub position_is_good: T::Mask,
    /// Whether the pressures are plausible measurements, not substitutes.
    pub pressure_is_good: T::Mask,
    /// Followed reference, which starts where the piston was released.
    pub reference: SetPoint<T>,
    /// Offset of the followed reference from the given one \[m\].
    pub offset: T,
    /// Motor speed commanded in the period before \[rev/s\].
    pub motor_speed: T,
    /// Whether the controller starts in this period: bumpless transfer from that motor speed.
    pub begins: T::Mask,
    /// Whether the controller is active, from the period in which it starts.
    pub controls: T::Mask,
    /// Whether the controller has to use its fallback gains.
    pub falls_back: T::Mask,
}

impl Frame<f64> {
    /// Frame from a crane's limits, for a controller with a largest tracking error \[m\].
    pub fn new(limits: &Limits, tracking: f64) -> Self {
        let fastest = limits.speed.max(limits.motor_speed * limits.speed_per_motor_speed);
        Self {
            limits: FrameLimits {
                period: limits.period,
                stroke: limits.stroke,
                end_margin: limits.margin,
                speed: fastest,
                pressure: limits.pressure,
                creep: limits.creep,
                tracking,
                motor_speed: limits.motor_speed,
                motor_slew: limits.motor_slew,
                stop_time: limits.stop_time,
                stopping_time: limits.stopping_time(),
                wait_time: limits.wait_time,
                still_time: limits.still.1,
                still_speed: limits.still.0,
                stuck: limits.stuck,
                position_step: 6.0 * limits.scatter.0,
                pressure_step: limits.pressure_step,
                pressure_agreement: limits.pressure_agreement.0,
                agreement_time: limits.pressure_agreement.1,
                valve_time: limits.valve_time + limits.stale,
            },
            drive: limits.drive,
            release: limits.release,
            oscillation: OscillationDetector::POSITIONING,
        }
    }

    /// Converts every setting to another number type.
    pub fn over<T: Real>(&self) -> Frame<T> {
        Frame {
            limits: self.limits.map(T::lit),
            drive: self.drive.map(T::lit),
            release: self.release.map(T::lit),
            oscillation: self.oscillation.map(T::lit),
        }
    }
}

/// Whether a number is 1 and not 0; NaN is not.
fn is_set<T: Real>(value: T) -> T::Mask {
    T::lit(0.5).lt(value)
}

/// The phase before, one mask for each.
struct Phases<T: Real> {
    idle: T::Mask,
    holding: T::Mask,
    releasing: T::Mask,
    opening: T::Mask,
    controlling: T::Mask,
    stopping: T::Mask,
    fault: T::Mask,
}

impl<T: Real> Phases<T> {
    fn of(phase: T) -> Self {
        let is = |value: f64| T::lit(value - 0.5).lt(phase) & phase.lt(T::lit(value + 0.5));
        Self {
            idle: is(frame_phase::IDLE),
            holding: is(frame_phase::HOLDING),
            releasing: is(frame_phase::RELEASING),
            opening: is(frame_phase::OPENING),
            controlling: is(frame_phase::CONTROLLING),
            stopping: is(frame_phase::STOPPING),
            fault: is(frame_phase::FAULT),
        }
    }
}

/// Conditions of the transitions from one phase to the next.
struct Transitions<T: Real> {
    /// Measurements are plausible.
    is_plausible: T::Mask,
    /// A start is asked for.
    starts: T::Mask,
    /// The release has proven that the pump carries the load.
    proven: T::Mask,
    /// The valve has had its time to open: the controller begins.
    begins: T::Mask,
    /// A controlled stop is under way.
    stops: T::Mask,
    /// The load is to be held.
    holds: T::Mask,
    /// A fault is left by a reset.
    leaves: T::Mask,
    /// The drive is switched on.
    enabled: T::Mask,
    /// A fault occurs, or a more severe one.
    fails: T::Mask,
}

impl<T: Real> Transitions<T> {
    /// The next phase: progress, then what is asked for, then what is wrong.
    fn next_phase(&self, at: &Phases<T>, phase: T) -> T {
        let Self { is_plausible, starts, proven, begins, stops, holds, leaves, enabled, fails } =
            *self;
        let to = |is: T::Mask, phase: f64, next: T| T::select(is, T::lit(phase), next);
        let mut next = phase;
        next = to(at.idle & is_plausible, frame_phase::HOLDING, next);
        next = to(at.holding & starts, frame_phase::RELEASING, next);
        next = to(proven, frame_phase::OPENING, next);
        next = to(begins, frame_phase::CONTROLLING, next);
        next = to(at.stopping & !stops, frame_phase::HOLDING, next);
        next = to((at.holding | at.releasing) & holds, frame_phase::HOLDING, next);
        next = to((at.opening | at.controlling) & holds, frame_phase::STOPPING, next);
        next = to(leaves, frame_phase::HOLDING, next);
        next = to(!enabled & (!at.fault | leaves), frame_phase::IDLE, next);
        next = to(fails, frame_phase::FAULT, next);
        next
    }
}

impl<T: Real> Frame<T> {
    /// One control period.
    ///
    /// `ready` says whether the controller could start. `law` is the controller, called once in every period and
    /// phase: from the [`Directive`] it returns the motor speed \[rev/s\], or [`NO_COMMAND`].
    #[inline(always)]
    pub fn advance(
        &self,
        before: &FrameState<T>,
        input: &FrameInput<T>,
        ready: T::Mask,
        law: impl FnOnce(&Directive<T>) -> T,
    ) -> (FrameState<T>, FrameOutput<T>) {
        let l = &self.limits;
        let (zero, one) = (T::zero(), T::one());
        let was = &before.memory;
        let at = Phases::<T>::of(was.phase);
        let mut s = *before;
        s.memory.since = was.since + l.period;
        s.memory.valve_since = was.valve_since + l.period;
        s.memory.stop_since = was.stop_since + l.period;

        // what was read and asked for; the last good value stands in for one period
        let now = self.plausible(&at, was, input, &mut s.memory);
        // what is no number holds: neither is it enabled, nor is hold off
        let (enabled, holds) = (is_set(now.enable), !now.hold.lt(T::lit(0.5)));
        s.memory.enabled_for = T::select(enabled, was.enabled_for + l.period, zero);
        let starts = is_set(now.start) & !is_set(was.start);
        let resets = is_set(now.reset_fault) & !is_set(was.reset);
        s.memory.start = T::select(is_set(now.start), one, zero);
        s.memory.reset = T::select(is_set(now.reset_fault), one, zero);

        // the release of the load
        let (runs, proven) = self.run_release(&at, before, &now, ready, &mut s);

        // the reference, from where the piston was released
        let begins = at.opening & l.valve_time.lt(s.memory.since);
        let reference = self.follow_reference(&at, was, &now, begins, &mut s.memory);

        // a loop in sustained oscillation falls back, until a reset
        let rests = at.controlling & !T::lit(RESTS).lt(now.reference_velocity.abs());
        let error = reference.position - now.stroke;
        let oscillates = self.oscillation.update(&mut s.oscillation, error, rests, l.period);
        let falls_back = (oscillates | is_set(was.falls_back)) & !(resets & !at.fault);
        s.memory.falls_back = T::select(falls_back, one, zero);

        // the controller
        let wanted = law(&Directive {
            stroke: now.stroke,
            pressure_a: now.pressure_a,
            pressure_b: now.pressure_b,
            motor_speed_read: now.motor_speed_read,
            position_is_good: s.memory.bad_position.lt(T::lit(0.5)),
            pressure_is_good: s.memory.bad_pressure.lt(T::lit(0.5)),
            reference,
            offset: s.memory.offset,
            motor_speed: was.motor_speed,
            begins,
            controls: at.controlling | begins,
            falls_back,
        });
        // which no number that is not finite is
        let is_valid = wanted.abs().lt(T::lit(NO_COMMAND));

        // what is wrong
        let mut wrong = self.monitors(&at, before, &mut s, &now, &reference);
        wrong.found((at.controlling | begins) & !is_valid, Cause::ControllerInvalid);
        let is_late = T::lit(READY_TIME).lt(s.memory.since);
        let is_still = l.still_time.lt(was.still_for);
        wrong.found(at.releasing & !runs & is_late, Cause::ControllerInvalid);
        wrong.found(at.releasing & !runs & is_late & !is_still, Cause::LoadNotStill);
        let Wrong(cause) = wrong;
        // before anything acts, what is wrong may go away for a while
        let has_waited = l.wait_time.lt(s.memory.enabled_for);
        let is_wrong = (!at.idle | has_waited) & T::lit(0.5).lt(cause);
        let at_once = is_wrong & is_held_at_once(cause);
        let fails = is_wrong & (!at.fault | (at_once & !is_held_at_once(was.cause)));

        // a stop: controlled while valve and drive obey, else immediate
        let obeys = at.opening | at.controlling;
        let begins_stop = obeys & enabled & (holds | is_wrong) & !at_once;
        let goes_on = is_set(was.stops) & enabled & !at_once & s.memory.stop_since.lt(l.stop_time);
        let stops = begins_stop | goes_on;
        let as_read = s.drive.plausible(now.motor_speed_read);
        s.memory.stops = T::select(stops, one, zero);
        s.memory.stop_since = T::select(begins_stop, zero, s.memory.stop_since);
        s.memory.stop_from = T::select(begins_stop, as_read, was.stop_from);

        // a fault is left by a reset, with everything well for a period of the load mode
        let at_rest = was.motor_speed.abs().lt(T::lit(1e-9)) & !stops;
        let turns = self.drive.uncommanded.lt(now.motor_speed_read.abs());
        let is_shut = now.valve_state.lt(T::lit(0.5)) & l.valve_time.lt(s.memory.valve_since);
        let is_still = s.memory.velocity.abs().lt(l.still_speed);
        let is_well = at.fault & at_rest & is_still & !is_wrong & !turns & is_shut;
        s.memory.well_for = T::select(is_well, was.well_for + l.period, zero);
        let leaves = at.fault & resets & l.still_time.lt(s.memory.well_for);

        let is_plausible = s.memory.bad.lt(T::lit(0.5));
        let transitions = Transitions {
            is_plausible,
            starts,
            proven,
            begins,
            stops,
            holds,
            leaves,
            enabled,
            fails,
        };
        let next = transitions.next_phase(&at, was.phase);
        let changes = T::lit(0.5).lt((next - was.phase).abs());
        s.memory.phase = next;
        s.memory.since = T::select(changes, zero, s.memory.since);
        s.memory.cause = T::select(fails, cause, T::select(leaves, zero, was.cause));
        let will = Phases::<T>::of(next);

        // where the load is held: from where it came to rest, or where the valve opened
        let rests = l.still_time.lt(s.memory.still_for);
        let settles = ((at.holding | at.fault) & !rests) | (at.releasing & !runs);
        let crept = at.fault & is_wrong;
        s.memory.held_at = T::select(changes | settles | crept, now.stroke, was.held_at);

        // motor and valve
        let ramp = one - s.memory.stop_since / (T::lit(CONTROLLED_RAMP) * l.stop_time);
        let mut speed = zero;
        let carries = will.releasing | (proven & will.opening);
        speed = T::select(carries, s.release.motor_speed, speed);
        speed = T::select(will.opening & !proven, was.motor_speed, speed);
        speed = T::select(will.controlling & is_valid, wanted, speed);
        speed = T::select(stops, s.memory.stop_from * ramp.max(zero), speed);
        let brakes = (at_once & !at.fault) | (at.controlling & !enabled);
        let from = T::select(brakes, as_read, was.motor_speed);
        s.memory.motor_speed = self.limited_speed(speed, from);
        let opens = will.opening | will.controlling | stops;
        s.memory.holding_valve = T::select(opens, one, zero);
        let switches = T::lit(0.5).lt((s.memory.holding_valve - was.holding_valve).abs());
        s.memory.valve_since = T::select(switches, zero, s.memory.valve_since);
        s.memory.has_begun = one;
        let output = self.output(&s);
        (s, output)
    }

    /// Advances the release of the load: whether it runs, and whether it has proven that the pump carries
    /// the load.
    fn run_release(
        &self,
        at: &Phases<T>,
        before: &FrameState<T>,
        now: &FrameInput<T>,
        ready: T::Mask,
        s: &mut FrameState<T>,
    ) -> (T::Mask, T::Mask) {
        let l = &self.limits;
        let zero = T::zero();
        let was = &before.memory;
        let input = self.release_input(now);
        let released = self.release.advance(&before.release, &input, l.period).to_array();
        // begun once the load is still and the controller could take over: a proof is never older than a period
        let has_begun = zero.lt(before.release.time);
        let is_still = l.still_time.lt(was.still_for);
        let runs = at.releasing & ((ready & is_still) | has_begun);
        let kept = released.map(|value| T::select(runs, value, zero));
        s.release = ReleaseState::from_array(kept);
        let proven = runs & T::lit(phase::PROVEN - 0.5).lt(s.release.phase);
        (runs, proven)
    }

    /// The reference that is followed, from where the piston was released: its offset to the one that is
    /// given is taken back as that moves.
    fn follow_reference(
        &self,
        at: &Phases<T>,
        was: &FrameMemory<T>,
        now: &FrameInput<T>,
        begins: T::Mask,
        s: &mut FrameMemory<T>,
    ) -> SetPoint<T> {
        let l = &self.limits;
        let zero = T::zero();
        let reach = T::lit(OFFSET_SHARE) * now.reference_velocity.abs() * l.period;
        let left = was.offset - was.offset.clamp(-reach, reach);
        let apart = now.stroke - now.reference_position;
        s.offset = T::select(begins, apart, T::select(at.controlling, left, zero));
        let followed = now.reference_position + s.offset;
        let back = T::select(at.controlling, (left - was.offset) / l.period, zero);
        let position = followed.clamp(zero, l.stroke);
        // at the end of the stroke it stays there
        let is_limited = T::lit(0.5 * REFERENCE_SLACK).lt((followed - position).abs());
        let velocity = T::select(is_limited, zero, now.reference_velocity + back);
        SetPoint { position, velocity }
    }

    /// A motor speed within its limit, and within the slew rate of where it is \[rev/s\].
    fn limited_speed(&self, speed: T, from: T) -> T {
        let l = &self.limits;
        let reach = l.motor_slew * l.period;
        speed.clamp(from - reach, from + reach).clamp(-l.motor_speed, l.motor_speed)
    }

    /// Pressures of the pump side and the cylinder chamber that carry the load, then of the others \[Pa\].
    fn sides(&self, now: &FrameInput<T>) -> [T; 4] {
        let by_a = T::zero().lt(self.release.direction);
        let of = |a: T, b: T| T::select(by_a, a, b);
        [
            of(now.pressure_pump_a, now.pressure_pump_b),
            of(now.pressure_a, now.pressure_b),
            of(now.pressure_pump_b, now.pressure_pump_a),
            of(now.pressure_b, now.pressure_a),
        ]
    }

    fn release_input(&self, now: &FrameInput<T>) -> ReleaseInput<T> {
        let [pump, load, other_pump, other] = self.sides(now);
        ReleaseInput {
            stroke: now.stroke,
            motor_speed: now.motor_speed_read,
            pressure_pump: pump,
            pressure_load: load,
            pressure_other: other,
            pressure_other_pump: other_pump,
            is_new: T::one(),
        }
    }

    fn output(&self, s: &FrameState<T>) -> FrameOutput<T> {
        let m = &s.memory;
        let at = Phases::<T>::of(m.phase);
        let failed = T::lit(STATUS_FAULT) + m.cause;
        let controls = T::select(is_set(m.falls_back), T::lit(STATUS_FALLBACK), m.phase);
        let status = T::select(at.controlling, controls, T::select(at.fault, failed, m.phase));
        let [amplitude, frequency] = self.oscillation.amplitude_and_frequency(&s.oscillation);
        FrameOutput {
            motor_speed: m.motor_speed,
            holding_valve: m.holding_valve,
            status,
            reference_offset: m.offset,
            oscillation_amplitude: amplitude,
            oscillation_frequency: frequency,
        }
    }
}
