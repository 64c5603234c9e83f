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

use super::drive_monitor::{DriveMonitor, DriveMonitorState};
use super::fault::{Cause, is_held_at_once};
use super::limits::Limits;
use super::oscillation_detector::{OscillationDetector, OscillationState};
use super::plausibility::{LOWEST_PRESSURE, RUNAWAY, STROKE_SLACK, VELOCITY_WINDOW};
use super::release::{Refusal, Release, ReleaseInput, ReleaseState, phase};
use super::supervisor::CONTROLLED_RAMP;
use crate::reference::profile::SetPoint;
use hydroboom_math::{Real, record};

record! {
    /// Limits of the frame, from a crane file.
    pub struct FrameLimits<T> {
        /// Control period
        #[unit = "s"]
        pub period: T,
        /// Length of the stroke
        #[unit = "m"]
        pub stroke: T,
        /// Distance from the end stops that a moving piston keeps
        #[unit = "m"]
        pub end_margin: T,
        /// Largest speed of the piston
        #[unit = "m/s"]
        pub speed: T,
        /// Largest pressure
        #[unit = "Pa"]
        pub pressure: T,
        /// Largest movement of a held load
        #[unit = "m"]
        pub creep: T,
        /// Largest tracking error
        #[unit = "m"]
        pub tracking: T,
        /// Largest motor speed
        #[unit = "rev/s"]
        pub motor_speed: T,
        /// Largest change of motor speed
        #[unit = "rev/s²"]
        pub motor_slew: T,
        /// Duration of a controlled stop
        #[unit = "s"]
        pub stop_time: T,
        /// Way of a controlled stop for each speed, with what swings on
        #[unit = "s"]
        pub stopping_time: T,
        /// Time for which measurements that are not plausible are borne once enabled
        #[unit = "s"]
        pub wait_time: T,
        /// Time for which a load is observed until it is still: a period of the load mode
        #[unit = "s"]
        pub still_time: T,
        /// Piston speed below which a load is still
        #[unit = "m/s"]
        pub still_speed: T,
        /// Time after which a signal that repeats itself is stuck; 0 where sensors have no noise
        #[unit = "s"]
        pub stuck: T,
        /// Largest step of the position from one reading to the next that is no motion
        #[unit = "m"]
        pub position_step: T,
        /// Largest step of a pressure from one reading to the next
        #[unit = "Pa"]
        pub pressure_step: T,
        /// Largest disagreement of pump-side and cylinder pressure behind an open valve
        #[unit = "Pa"]
        pub pressure_agreement: T,
        /// Time for which it must last
        #[unit = "s"]
        pub agreement_time: T,
        /// Time from the valve's command until it has switched at the latest
        #[unit = "s"]
        pub valve_time: T,
    }
}

record! {
    /// What the frame is given in a control period.
    pub struct FrameInput<T> {
        /// 1: the drive is switched on and the load may be released; 0: the load is held at once
        #[unit = "0/1"]
        pub enable: T,
        /// 1: come to rest and hold the load
        #[unit = "0/1"]
        pub hold: T,
        /// A rise to 1 asks for the release of the held load
        #[unit = "0/1"]
        pub start: T,
        /// A rise to 1 leaves a fault once everything is well
        #[unit = "0/1"]
        pub reset_fault: T,
        /// Load-holding valve as read: 1 open, 0 shut, -1 where it cannot be read
        #[unit = "1"]
        pub valve_state: T,
        /// Piston position that is wanted, x_ref
        #[unit = "m"]
        pub reference_position: T,
        /// Piston velocity that is wanted, v_ref
        #[unit = "m/s"]
        pub reference_velocity: T,
        /// Piston position as read
        #[unit = "m"]
        pub stroke: T,
        /// Pressure on pump side A as read
        #[unit = "Pa"]
        pub pressure_pump_a: T,
        /// Pressure on the piston side as read
        #[unit = "Pa"]
        pub pressure_a: T,
        /// Pressure on the rod side as read
        #[unit = "Pa"]
        pub pressure_b: T,
        /// Pressure on pump side B as read
        #[unit = "Pa"]
        pub pressure_pump_b: T,
        /// Motor speed as the drive reads it
        #[unit = "rev/s"]
        pub motor_speed_read: T,
    }
}

record! {
    /// What the frame gives in a control period.
    pub struct FrameOutput<T> {
        /// Motor speed for the drive, n_ref
        #[unit = "rev/s"]
        pub motor_speed: T,
        /// Load-holding valve: 1 energised, 0 not
        #[unit = "0/1"]
        pub holding_valve: T,
        /// Status: 0 idle, 1 holding, 2 releasing, 3 opening, 4 controlling, 5 stopping, 10 controlling with fallback gains, 100 and the number of a fault's cause
        #[unit = "code"]
        pub status: T,
        /// Difference of the reference that is followed to the one that is given
        #[unit = "m"]
        pub reference_offset: T,
        /// Amplitude of a sustained oscillation at rest; 0 where there is none
        #[unit = "m"]
        pub oscillation_amplitude: T,
        /// Its frequency
        #[unit = "Hz"]
        pub oscillation_frequency: T,
    }
}

record! {
    /// What the frame itself remembers.
    pub struct FrameMemory<T> {
        /// Phase: 0 idle, 1 holding, 2 releasing, 3 opening, 4 controlling, 5 stopping, 6 fault
        #[unit = "1"]
        pub phase: T,
        /// Number of the fault's cause; 0 where there is none
        #[unit = "1"]
        pub cause: T,
        /// Time in this phase
        #[unit = "s"]
        pub since: T,
        /// Motor speed commanded
        #[unit = "rev/s"]
        pub motor_speed: T,
        /// Valve commanded
        #[unit = "1"]
        pub holding_valve: T,
        /// Time since the valve was last commanded to switch
        #[unit = "s"]
        pub valve_since: T,
        /// 1 while a controlled stop is under way: the valve is still open
        #[unit = "1"]
        pub stops: T,
        /// Motor speed as read when the stop began
        #[unit = "rev/s"]
        pub stop_from: T,
        /// Time since the stop began
        #[unit = "s"]
        pub stop_since: T,
        /// Start in the period before
        #[unit = "1"]
        pub start: T,
        /// Reset in the period before
        #[unit = "1"]
        pub reset: T,
        /// 1 once a period has passed
        #[unit = "1"]
        pub has_begun: T,
        /// Periods in which a measurement was not plausible, each forgotten within ten plausible ones
        #[unit = "1"]
        pub bad: T,
        /// 1 where the position was not plausible
        #[unit = "1"]
        pub bad_position: T,
        /// 1 where a pressure was not plausible
        #[unit = "1"]
        pub bad_pressure: T,
        /// Periods in which the reference was not plausible, each forgotten within ten plausible ones
        #[unit = "1"]
        pub bad_reference: T,
        /// Last good piston position
        #[unit = "m"]
        pub stroke: T,
        /// Last good pressure on pump side A
        #[unit = "Pa"]
        pub pressure_pump_a: T,
        /// Last good pressure on the piston side
        #[unit = "Pa"]
        pub pressure_a: T,
        /// Last good pressure on the rod side
        #[unit = "Pa"]
        pub pressure_b: T,
        /// Last good pressure on pump side B
        #[unit = "Pa"]
        pub pressure_pump_b: T,
        /// Last good motor speed as read
        #[unit = "rev/s"]
        pub motor_speed_read: T,
        /// Last good reference position
        #[unit = "m"]
        pub reference_position: T,
        /// Last good reference velocity
        #[unit = "m/s"]
        pub reference_velocity: T,
        /// Time for which the position has repeated itself
        #[unit = "s"]
        pub stroke_repeated: T,
        /// Time for which the pressure on pump side A has repeated itself
        #[unit = "s"]
        pub pressure_pump_a_repeated: T,
        /// Time for which the pressure on the piston side has repeated itself
        #[unit = "s"]
        pub pressure_a_repeated: T,
        /// Time for which the pressure on the rod side has repeated itself
        #[unit = "s"]
        pub pressure_b_repeated: T,
        /// Time for which the pressure on pump side B has repeated itself
        #[unit = "s"]
        pub pressure_pump_b_repeated: T,
        /// Velocity of the piston, averaged
        #[unit = "m/s"]
        pub velocity: T,
        /// Time for which it has been enabled
        #[unit = "s"]
        pub enabled_for: T,
        /// Integral of the position over this period of the load mode
        #[unit = "m·s"]
        pub held_sum: T,
        /// Time in this period of the load mode
        #[unit = "s"]
        pub held_time: T,
        /// Mean position over the period of the load mode before
        #[unit = "m"]
        pub held_mean: T,
        /// Periods of the load mode that have passed in this phase
        #[unit = "1"]
        pub held_windows: T,
        /// Time for which the load has been still
        #[unit = "s"]
        pub still_for: T,
        /// Position at which the load is held, or was when the valve was energised
        #[unit = "m"]
        pub held_at: T,
        /// Time for which pump side and cylinder have disagreed behind an open valve
        #[unit = "s"]
        pub disagreeing: T,
        /// Time for which everything has been well in a fault
        #[unit = "s"]
        pub well_for: T,
        /// Difference of the reference that is followed to the one that is given
        #[unit = "m"]
        pub offset: T,
        /// 1 after a sustained oscillation: the controller has its fallback gains
        #[unit = "1"]
        pub falls_back: T,
    }
}

/// State of the frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameState<T> {
    /// Its own.
    pub memory: FrameMemory<T>,
    /// Of the drive's monitor.
    pub drive: DriveMonitorState<T>,
    /// Of the release.
    pub release: ReleaseState<T>,
    /// Of the oscillation detector.
    pub oscillation: OscillationState<T>,
}

/// Phases of the frame.
pub mod frame_phase {
    /// Not enabled.
    pub const IDLE: f64 = 0.0;
    /// The load hangs on its valves.
    pub const HOLDING: f64 = 1.0;
    /// The pump proves that it carries the load.
    pub const RELEASING: f64 = 2.0;
    /// The valve has its time to open.
    pub const OPENING: f64 = 3.0;
    /// The controller moves the load.
    pub const CONTROLLING: f64 = 4.0;
    /// The load is brought to rest.
    pub const STOPPING: f64 = 5.0;
    /// Something was wrong; the load is held until a reset.
    pub const FAULT: f64 = 6.0;
}

/// Status while the controller has its fallback gains.
pub const STATUS_FALLBACK: f64 = 10.0;
/// Status of a fault, to which the number of its cause is added.
pub const STATUS_FAULT: f64 = 100.0;

/// Share of the reference's velocity by which an offset of the reference is taken back.
const OFFSET_SHARE: f64 = 0.1;
/// Periods for which the last good value stands in for one that is not plausible.
const BORNE: f64 = 1.0;
/// Share of such a period that a plausible one makes good: one in ten is borne.
const FORGOTTEN: f64 = 0.1;
/// Time that a controller has until it could take over, before the pump turns \[s\].
const READY_TIME: f64 = 20.0;
/// Reference velocity below which the reference rests \[m/s\].
const RESTS: f64 = 1e-6;
/// Motor speed \[rev/s\] that says that a controller has none to give: no motor turns so fast. Not every language has NaN.
pub const NO_COMMAND: f64 = 1e6;
/// Slack for rounding in what a reference does within a period \[m\].
const REFERENCE_SLACK: f64 = 1e-4;

/// The frame: its limits, its monitors, the release.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame<T> {
    /// Limits.
    pub limits: FrameLimits<T>,
    /// Monitor of the drive.
    pub drive: DriveMonitor<T>,
    /// Release of the load.
    pub release: Release<T>,
    /// Detector of sustained oscillation.
    pub oscillation: OscillationDetector<T>,
}

/// What a controller is shown within the frame, and what it has to do.
#[derive(Clone, Copy, Debug)]
pub struct Directive<T: Real> {
    /// Piston position and pressures: as read, or the last good ones.
    pub stroke: T,
    /// Pressure on the piston side \[Pa\].
    pub pressure_a: T,
    /// Pressure on the rod side \[Pa\].
    pub pressure_b: T,
    /// Motor speed as read, or the last good one \[rev/s\].
    pub motor_speed_read: T,
    /// The position was plausible, and not replaced.
    pub position_is_good: T::Mask,
    /// The pressures were plausible, and not replaced.
    pub pressure_is_good: T::Mask,
    /// Reference, from where the piston was released.
    pub reference: SetPoint<T>,
    /// Difference of that reference to the one that is given \[m\].
    pub offset: T,
    /// Motor speed commanded in the period before \[rev/s\].
    pub motor_speed: T,
    /// The controller begins in this period: it takes over at that speed.
    pub begins: T::Mask,
    /// The controller has the load, from the period in which it begins on.
    pub controls: T::Mask,
    /// It has to do so with its fallback gains.
    pub falls_back: T::Mask,
}

impl Frame<f64> {
    /// The frame of a crane's limits, for a controller with a largest tracking error \[m\].
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

    /// The same frame over another number.
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

fn number<T: Real>(cause: Cause) -> T {
    T::lit(cause.number())
}

/// What is wrong: the last cause found counts, so they are looked for from mild to severe.
struct Wrong<T>(T);

impl<T: Real> Wrong<T> {
    fn found(&mut self, is: T::Mask, cause: Cause) {
        self.0 = T::select(is, number(cause), self.0);
    }
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

impl<T: Real> Frame<T> {
    /// One control period. `ready` says whether the controller could begin; `law` is the controller: shown
    /// the [`Directive`], it gives the motor speed \[rev/s\] that it wants, or [`NO_COMMAND`]. It is called
    /// once a period, in every phase.
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
        let input = self.release_input(&now);
        let released = self.release.advance(&before.release, &input, l.period).to_array();
        // begun once the load is still and the controller could take over: a proof is never older than a period
        let has_begun = zero.lt(before.release.time);
        let is_still = l.still_time.lt(was.still_for);
        let runs = at.releasing & ((ready & is_still) | has_begun);
        let kept = released.map(|value| T::select(runs, value, zero));
        s.release = ReleaseState::from_array(kept);
        let proven = runs & T::lit(phase::PROVEN - 0.5).lt(s.release.phase);

        // the reference, from where the piston was released
        let begins = at.opening & l.valve_time.lt(s.memory.since);
        let reach = T::lit(OFFSET_SHARE) * now.reference_velocity.abs() * l.period;
        let left = was.offset - was.offset.clamp(-reach, reach);
        let apart = now.stroke - now.reference_position;
        s.memory.offset = T::select(begins, apart, T::select(at.controlling, left, zero));
        let followed = now.reference_position + s.memory.offset;
        let back = T::select(at.controlling, (left - was.offset) / l.period, zero);
        let position = followed.clamp(zero, l.stroke);
        // at the end of the stroke it stays there
        let is_limited = T::lit(0.5 * REFERENCE_SLACK).lt((followed - position).abs());
        let velocity = T::select(is_limited, zero, now.reference_velocity + back);
        let reference = SetPoint { position, velocity };

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

        // the next phase: progress, then what is asked for, then what is wrong
        let to = |is: T::Mask, phase: f64, next: T| T::select(is, T::lit(phase), next);
        let is_plausible = s.memory.bad.lt(T::lit(0.5));
        let mut next = was.phase;
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
        let reach = l.motor_slew * l.period;
        let speed = speed.clamp(from - reach, from + reach);
        s.memory.motor_speed = speed.clamp(-l.motor_speed, l.motor_speed);
        let opens = will.opening | will.controlling | stops;
        s.memory.holding_valve = T::select(opens, one, zero);
        let switches = T::lit(0.5).lt((s.memory.holding_valve - was.holding_valve).abs());
        s.memory.valve_since = T::select(switches, zero, s.memory.valve_since);
        s.memory.has_begun = one;
        let output = self.output(&s);
        (s, output)
    }

    /// The measurements and the reference as far as they are plausible: finite, in range, and no further
    /// from the last good ones than machine and reference can go. The last good one stands in for one that
    /// is not.
    fn plausible(
        &self,
        at: &Phases<T>,
        was: &FrameMemory<T>,
        input: &FrameInput<T>,
        s: &mut FrameMemory<T>,
    ) -> FrameInput<T> {
        let l = &self.limits;
        let (zero, one) = (T::zero(), T::one());
        let runaway = T::lit(RUNAWAY);
        let steps = is_set(was.has_begun) & !at.idle;
        let slack = T::lit(STROKE_SLACK);
        let lowest = T::lit(LOWEST_PRESSURE);
        let (most, fastest) = (l.pressure + l.pressure, runaway * l.motor_speed);
        // a pressure that was shut in steps when the valve switches
        let switching = was.valve_since.lt(l.valve_time);
        let pressure_step = T::select(switching, most - lowest, l.pressure_step);
        let periods = was.bad + one;
        let position_step = runaway * l.speed * l.period * periods + l.position_step;
        let is_good = |value: T, last: T, low: T, high: T, step: T| {
            let in_range = low.lt(value) & value.lt(high);
            let in_reach = (value - last).abs().lt(step);
            value.is_finite() & in_range & (in_reach | !steps)
        };
        let good = [
            is_good(input.stroke, was.stroke, -slack, l.stroke + slack, position_step),
            is_good(
                input.pressure_pump_a,
                was.pressure_pump_a,
                lowest,
                most,
                pressure_step * periods,
            ),
            is_good(input.pressure_a, was.pressure_a, lowest, most, pressure_step * periods),
            is_good(input.pressure_b, was.pressure_b, lowest, most, pressure_step * periods),
            is_good(
                input.pressure_pump_b,
                was.pressure_pump_b,
                lowest,
                most,
                pressure_step * periods,
            ),
            is_good(
                input.motor_speed_read,
                was.motor_speed_read,
                -fastest,
                fastest,
                fastest + fastest,
            ),
        ];
        let [g_x, g_pa, g_a, g_b, g_pb, g_n] = good;
        let all = g_x & g_pa & g_a & g_b & g_pb & g_n;
        s.bad = T::select(all, (was.bad - T::lit(FORGOTTEN)).max(zero), periods);
        s.stroke = T::select(g_x, input.stroke, was.stroke);
        s.pressure_pump_a = T::select(g_pa, input.pressure_pump_a, was.pressure_pump_a);
        s.pressure_a = T::select(g_a, input.pressure_a, was.pressure_a);
        s.pressure_b = T::select(g_b, input.pressure_b, was.pressure_b);
        s.pressure_pump_b = T::select(g_pb, input.pressure_pump_b, was.pressure_pump_b);
        s.motor_speed_read = T::select(g_n, input.motor_speed_read, was.motor_speed_read);
        // which of them, for the cause
        s.bad_position = T::select(g_x, zero, one);
        s.bad_pressure = T::select(g_pa & g_a & g_b & g_pb, zero, one);

        // the reference, once it is followed
        let periods = was.bad_reference + one;
        let step = runaway * l.speed * l.period * periods + T::lit(REFERENCE_SLACK);
        let (x, v) = (input.reference_position, input.reference_velocity);
        let in_range = (-slack).lt(x) & x.lt(l.stroke + slack) & v.abs().lt(runaway * l.speed);
        let in_reach = (x - was.reference_position).abs().lt(step) | !at.controlling;
        let good = x.is_finite() & v.is_finite() & in_range & in_reach;
        let forgotten = (was.bad_reference - T::lit(FORGOTTEN)).max(zero);
        s.bad_reference = T::select(good, forgotten, periods);
        s.reference_position = T::select(good, x, was.reference_position);
        s.reference_velocity = T::select(good, v, was.reference_velocity);

        // for how long each has repeated itself, and how fast the piston is
        let repeats = |now: T, last: T, time: T| {
            T::select(zero.lt((now - last).abs()), zero, time + l.period)
        };
        s.stroke_repeated = repeats(s.stroke, was.stroke, was.stroke_repeated);
        s.pressure_pump_a_repeated =
            repeats(s.pressure_pump_a, was.pressure_pump_a, was.pressure_pump_a_repeated);
        s.pressure_a_repeated = repeats(s.pressure_a, was.pressure_a, was.pressure_a_repeated);
        s.pressure_b_repeated = repeats(s.pressure_b, was.pressure_b, was.pressure_b_repeated);
        s.pressure_pump_b_repeated =
            repeats(s.pressure_pump_b, was.pressure_pump_b, was.pressure_pump_b_repeated);
        let velocity = (s.stroke - was.stroke) / l.period;
        let averaged = was.velocity + (velocity - was.velocity) / T::lit(VELOCITY_WINDOW);
        s.velocity = T::select(steps, averaged, zero);
        let is_still = s.velocity.abs().lt(l.still_speed);
        s.still_for = T::select(is_still, was.still_for + l.period, zero);
        FrameInput {
            reference_position: s.reference_position,
            reference_velocity: s.reference_velocity,
            stroke: s.stroke,
            pressure_pump_a: s.pressure_pump_a,
            pressure_a: s.pressure_a,
            pressure_b: s.pressure_b,
            pressure_pump_b: s.pressure_pump_b,
            motor_speed_read: s.motor_speed_read,
            ..*input
        }
    }

    /// Everything that may be wrong, from mild to severe: first what lets the load be brought to rest, then
    /// what has it held at once.
    fn monitors(
        &self,
        at: &Phases<T>,
        before: &FrameState<T>,
        s: &mut FrameState<T>,
        now: &FrameInput<T>,
        reference: &SetPoint<T>,
    ) -> Wrong<T> {
        let l = &self.limits;
        let was = &before.memory;
        let zero = T::zero();
        let borne = T::lit(BORNE + 0.5);
        let mut wrong = Wrong(zero);
        let follows = at.releasing | at.opening | at.controlling;
        wrong.found(follows & borne.lt(s.memory.bad_reference), Cause::ReferenceImplausible);

        // a controlled stop ends before the end stop
        let v = s.memory.velocity;
        let margin = l.end_margin.max(v.abs() * l.stopping_time);
        let touches = l.creep / l.still_time;
        let is_low = now.stroke.lt(margin) & v.lt(-touches);
        let is_high = (l.stroke - margin).lt(now.stroke) & touches.lt(v);
        wrong.found(at.controlling & (is_low | is_high), Cause::EndOfStroke);
        let off = (now.stroke - reference.position).abs();
        wrong.found(at.controlling & l.tracking.lt(off), Cause::TrackingError);
        let pressures = [now.pressure_pump_a, now.pressure_a, now.pressure_b, now.pressure_pump_b];
        let highest = pressures.into_iter().fold(zero, |most, p| most.max(p));
        wrong.found(l.pressure.lt(highest), Cause::OverPressure);

        // from here on the load is held at once
        let [pump, load, ..] = self.sides(now);
        let has_opened = is_set(was.holding_valve) & l.valve_time.lt(s.memory.valve_since);
        let apart = has_opened & l.pressure_agreement.lt((pump - load).abs());
        s.memory.disagreeing = T::select(apart, was.disagreeing + l.period, zero);
        wrong.found(l.agreement_time.lt(s.memory.disagreeing), Cause::PressureDisagrees);
        for refusal in Refusal::ALL {
            let is = (s.release.phase - T::lit(refusal.phase())).abs().lt(T::lit(0.5));
            wrong.found(at.releasing & is, refusal.into());
        }
        let moved = now.stroke - was.held_at;
        let sank = l.creep.lt(-self.release.direction * moved);
        let rests = l.still_time.lt(was.still_for) & l.still_time.lt(was.since);
        let holds = at.holding | at.fault;
        let crept = holds & rests & l.creep.lt(moved.abs());
        // one that moves on, fast or slow: the means of two periods of the load mode differ
        let mean_moved = self.mean_motion(was, &mut s.memory, now, holds);
        let moves = T::lit(2.5).lt(s.memory.held_windows) & l.creep.lt(mean_moved.abs());
        // a release lifts by its proving motion, and by what the boom swings
        let lifted = (self.release.largest_motion + l.creep).lt(self.release.direction * moved);
        wrong.found(crept | moves | (at.releasing & (sank | lifted)), Cause::LoadNotHeld);
        wrong.found(at.opening & sank, Cause::LoadSank);
        wrong.found((T::lit(RUNAWAY) * l.speed).lt(v.abs()), Cause::Runaway);
        // below -0.5 it is not read; what is no number is neither open nor shut
        let is_open = is_set(now.valve_state);
        let is_shut = T::lit(-0.5).lt(now.valve_state) & now.valve_state.lt(T::lit(0.5));
        let asked = is_set(was.holding_valve);
        let wrong_valve = (asked & is_shut) | (!asked & is_open) | !now.valve_state.is_finite();
        let has_switched = l.valve_time.lt(was.valve_since);
        wrong.found(has_switched & wrong_valve, Cause::ValveNotFollowing);
        let difference = now.pressure_pump_a - now.pressure_pump_b;
        let drive = self.drive.judge(
            &mut s.drive,
            was.motor_speed,
            now.motor_speed_read,
            difference,
            l.period,
        );
        let acts = at.releasing | at.opening | at.controlling | at.stopping;
        wrong.found(acts & drive.deviates, Cause::DriveNotFollowing);

        // the measurements themselves
        let m = &s.memory;
        let stuck = |time: T, value: T| l.stuck.lt(time) & value.lt(l.pressure);
        let is_stuck = stuck(m.stroke_repeated, zero)
            | stuck(m.pressure_pump_a_repeated, now.pressure_pump_a)
            | stuck(m.pressure_a_repeated, now.pressure_a)
            | stuck(m.pressure_b_repeated, now.pressure_b)
            | stuck(m.pressure_pump_b_repeated, now.pressure_pump_b);
        wrong.found(zero.lt(l.stuck) & is_stuck, Cause::SensorStuck);
        let lost = borne.lt(m.bad);
        wrong.found(lost, Cause::MotorSpeedImplausible);
        wrong.found(lost & is_set(m.bad_pressure), Cause::PressureImplausible);
        wrong.found(lost & is_set(m.bad_position), Cause::PositionImplausible);
        // nothing that the frame commands stops such a drive
        wrong.found(drive.uncommanded, Cause::DriveUncommanded);
        wrong
    }

    /// Difference of the piston's mean positions over this period of the load mode and the one before \[m\], in the
    /// control period in which this one ends; zero in all others.
    fn mean_motion(
        &self,
        was: &FrameMemory<T>,
        s: &mut FrameMemory<T>,
        now: &FrameInput<T>,
        holds: T::Mask,
    ) -> T {
        let l = &self.limits;
        let zero = T::zero();
        let begins = was.since.lt(T::lit(0.5) * l.period);
        let keep = |value: T| T::select(holds & !begins, value, zero);
        let sum = keep(was.held_sum) + now.stroke * l.period;
        let time = keep(was.held_time) + l.period;
        let windows = keep(was.held_windows);
        let ends = l.still_time.lt(time);
        let mean = sum / time;
        s.held_sum = T::select(ends, zero, sum);
        s.held_time = T::select(ends, zero, time);
        s.held_mean = T::select(ends, mean, was.held_mean);
        s.held_windows = T::select(ends, windows + T::one(), windows);
        T::select(ends & T::lit(0.5).lt(windows), mean - was.held_mean, zero)
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
