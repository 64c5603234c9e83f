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
mod transitions;

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
use transitions::{Phases, Requests, Transitions};

/// Share of the reference's velocity by which an offset of the reference is taken back.
const OFFSET_SHARE: f64 = 0.1;
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

/// A control period: phase and memory before it, and its inputs.
struct Period<'a, T: Real> {
    at: Phases<T>,
    was: &'a FrameMemory<T>,
    now: FrameInput<T>,
    requests: Requests<T>,
}

/// Fault found in a control period.
struct Detection<T: Real> {
    /// Number of the cause.
    cause: T,
    /// A cause is present.
    is_wrong: T::Mask,
    /// It is one for which the load is held at once.
    at_once: T::Mask,
    /// A fault occurs, or a more severe one.
    fails: T::Mask,
}

impl<T: Real> Period<'_, T> {
    /// Inputs and tasks of the controller.
    fn directive(
        &self,
        s: &FrameMemory<T>,
        reference: SetPoint<T>,
        begins: T::Mask,
        falls_back: T::Mask,
    ) -> Directive<T> {
        let Self { at, was, now, .. } = self;
        Directive {
            stroke: now.stroke,
            pressure_a: now.pressure_a,
            pressure_b: now.pressure_b,
            motor_speed_read: now.motor_speed_read,
            position_is_good: s.bad_position.lt(T::lit(0.5)),
            pressure_is_good: s.bad_pressure.lt(T::lit(0.5)),
            reference,
            offset: s.offset,
            motor_speed: was.motor_speed,
            begins,
            controls: at.controlling | begins,
            falls_back,
        }
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
        let requests = self.requests(was, &now, &mut s.memory);
        let period = Period { at, was, now, requests };
        let Period { at, now, .. } = &period;

        // the release of the load
        let (runs, proven) = self.run_release(at, before, now, ready, &mut s);

        // the reference, from where the piston was released
        let begins = at.opening & l.valve_time.lt(s.memory.since);
        let reference = self.follow_reference(at, was, now, begins, &mut s.memory);

        // the controller
        let falls_back = self.falls_back(&period, reference.position, &mut s);
        let wanted = law(&period.directive(&s.memory, reference, begins, falls_back));
        // which no number that is not finite is
        let is_valid = wanted.abs().lt(T::lit(NO_COMMAND));

        // what is wrong
        let mut wrong = self.monitors(at, before, &mut s, now, &reference);
        wrong.found((at.controlling | begins) & !is_valid, Cause::ControllerInvalid);
        self.monitor_readiness(at, was, &s.memory, runs, &mut wrong);
        let fault = self.detect(&period, &s.memory, wrong);

        let (stops, as_read) = self.controlled_stop(&period, &fault, &mut s);
        let leaves = self.leaves_fault(&period, fault.is_wrong, stops, &mut s.memory);
        let is_plausible = s.memory.bad.lt(T::lit(0.5));
        let fails = fault.fails;
        let transitions =
            Transitions { is_plausible, requests, proven, begins, stops, leaves, fails };
        let next = transitions.next_phase(at, was.phase);
        let changes = T::lit(0.5).lt((next - was.phase).abs());
        s.memory.phase = next;
        s.memory.since = T::select(changes, zero, s.memory.since);
        s.memory.cause = T::select(fails, fault.cause, T::select(leaves, zero, was.cause));
        let will = Phases::<T>::of(next);

        // where the load is held: from where it came to rest, or where the valve opened
        let rests = l.still_time.lt(s.memory.still_for);
        let settles = ((at.holding | at.fault) & !rests) | (at.releasing & !runs);
        let crept = at.fault & fault.is_wrong;
        s.memory.held_at = T::select(changes | settles | crept, now.stroke, was.held_at);

        // motor and valve
        let speed = self.phase_speed(&will, &transitions, was, &s, wanted, is_valid);
        let brakes = (fault.at_once & !at.fault) | (at.controlling & !requests.enabled);
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

    /// What is asked for; a rise of `start` or `reset_fault` is a request once.
    fn requests(
        &self,
        was: &FrameMemory<T>,
        now: &FrameInput<T>,
        s: &mut FrameMemory<T>,
    ) -> Requests<T> {
        let (zero, one) = (T::zero(), T::one());
        // what is no number holds: neither is it enabled, nor is hold off
        let (enabled, holds) = (is_set(now.enable), !now.hold.lt(T::lit(0.5)));
        s.enabled_for = T::select(enabled, was.enabled_for + self.limits.period, zero);
        let starts = is_set(now.start) & !is_set(was.start);
        let resets = is_set(now.reset_fault) & !is_set(was.reset);
        s.start = T::select(is_set(now.start), one, zero);
        s.reset = T::select(is_set(now.reset_fault), one, zero);
        Requests { enabled, holds, starts, resets }
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

    /// Whether the controller has to use its fallback gains: after a sustained oscillation about the reference
    /// position \[m\], until a reset.
    fn falls_back(&self, period: &Period<'_, T>, reference: T, s: &mut FrameState<T>) -> T::Mask {
        let Period { at, was, now, requests } = period;
        let rests = at.controlling & !T::lit(RESTS).lt(now.reference_velocity.abs());
        let error = reference - now.stroke;
        let oscillates =
            self.oscillation.update(&mut s.oscillation, error, rests, self.limits.period);
        let falls_back = (oscillates | is_set(was.falls_back)) & !(requests.resets & !at.fault);
        s.memory.falls_back = T::select(falls_back, T::one(), T::zero());
        falls_back
    }

    /// The fault, if there is one, and whether the load is held at once for it.
    fn detect(&self, period: &Period<'_, T>, s: &FrameMemory<T>, wrong: Wrong<T>) -> Detection<T> {
        let Period { at, was, .. } = period;
        let Wrong(cause) = wrong;
        // before anything acts, what is wrong may go away for a while
        let has_waited = self.limits.wait_time.lt(s.enabled_for);
        let is_wrong = (!at.idle | has_waited) & T::lit(0.5).lt(cause);
        let at_once = is_wrong & is_held_at_once(cause);
        let fails = is_wrong & (!at.fault | (at_once & !is_held_at_once(was.cause)));
        Detection { cause, is_wrong, at_once, fails }
    }

    /// Whether a controlled stop is under way, which it is while valve and drive obey, else the load is held at once;
    /// and the motor speed as read \[rev/s\], from which it begins.
    fn controlled_stop(
        &self,
        period: &Period<'_, T>,
        fault: &Detection<T>,
        s: &mut FrameState<T>,
    ) -> (T::Mask, T) {
        let Period { at, was, now, requests } = period;
        let (zero, one) = (T::zero(), T::one());
        let Requests { enabled, holds, .. } = *requests;
        let Detection { is_wrong, at_once, .. } = *fault;
        let obeys = at.opening | at.controlling;
        let begins_stop = obeys & enabled & (holds | is_wrong) & !at_once;
        let goes_on =
            is_set(was.stops) & enabled & !at_once & s.memory.stop_since.lt(self.limits.stop_time);
        let stops = begins_stop | goes_on;
        let as_read = s.drive.plausible(now.motor_speed_read);
        s.memory.stops = T::select(stops, one, zero);
        s.memory.stop_since = T::select(begins_stop, zero, s.memory.stop_since);
        s.memory.stop_from = T::select(begins_stop, as_read, was.stop_from);
        (stops, as_read)
    }

    /// Whether a fault is left: by a reset, with everything well for a period of the load mode.
    fn leaves_fault(
        &self,
        period: &Period<'_, T>,
        is_wrong: T::Mask,
        stops: T::Mask,
        s: &mut FrameMemory<T>,
    ) -> T::Mask {
        let l = &self.limits;
        let Period { at, was, now, requests } = period;
        let at_rest = was.motor_speed.abs().lt(T::lit(1e-9)) & !stops;
        let turns = self.drive.uncommanded.lt(now.motor_speed_read.abs());
        let is_shut = now.valve_state.lt(T::lit(0.5)) & l.valve_time.lt(s.valve_since);
        let is_still = s.velocity.abs().lt(l.still_speed);
        let is_well = at.fault & at_rest & is_still & !is_wrong & !turns & is_shut;
        s.well_for = T::select(is_well, was.well_for + l.period, T::zero());
        at.fault & requests.resets & l.still_time.lt(s.well_for)
    }

    /// Motor speed of the next phase \[rev/s\], before its limits; `wanted` is the controller's.
    fn phase_speed(
        &self,
        will: &Phases<T>,
        transitions: &Transitions<T>,
        was: &FrameMemory<T>,
        s: &FrameState<T>,
        wanted: T,
        is_valid: T::Mask,
    ) -> T {
        let (zero, one) = (T::zero(), T::one());
        let Transitions { proven, stops, .. } = *transitions;
        let ramp = one - s.memory.stop_since / (T::lit(CONTROLLED_RAMP) * self.limits.stop_time);
        let mut speed = zero;
        let carries = will.releasing | (proven & will.opening);
        speed = T::select(carries, s.release.motor_speed, speed);
        speed = T::select(will.opening & !proven, was.motor_speed, speed);
        speed = T::select(will.controlling & is_valid, wanted, speed);
        T::select(stops, s.memory.stop_from * ramp.max(zero), speed)
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
