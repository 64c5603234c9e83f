//! Monitors of the frame: causes for which the load is brought to rest or held at once.

use super::{Frame, FrameInput, FrameMemory, FrameState, Phases, is_set};
use crate::reference::profile::SetPoint;
use crate::supervision::fault::Cause;
use crate::supervision::plausibility::RUNAWAY;
use crate::supervision::release::Refusal;
use hydroboom_math::Real;

/// Periods for which the last good value stands in for one that is not plausible.
const BORNE: f64 = 1.0;
/// Time that a controller has until it could take over, before the pump turns \[s\].
const READY_TIME: f64 = 20.0;

fn number<T: Real>(cause: Cause) -> T {
    T::lit(cause.number())
}

/// What is wrong: the last cause found counts, so they are looked for from mild to severe.
pub(super) struct Wrong<T>(pub(super) T);

impl<T: Real> Wrong<T> {
    pub(super) fn found(&mut self, is: T::Mask, cause: Cause) {
        self.0 = T::select(is, number(cause), self.0);
    }
}

impl<T: Real> Frame<T> {
    /// Everything that may be wrong, from mild to severe: first what lets the load be brought to rest, then
    /// what has it held at once.
    pub(super) fn monitors(
        &self,
        at: &Phases<T>,
        before: &FrameState<T>,
        s: &mut FrameState<T>,
        now: &FrameInput<T>,
        reference: &SetPoint<T>,
    ) -> Wrong<T> {
        let was = &before.memory;
        let mut wrong = Wrong(T::zero());
        self.monitor_course(at, &s.memory, now, reference, &mut wrong);
        // from here on the load is held at once
        self.monitor_load(at, was, s, now, &mut wrong);
        let has_uncommanded_speed = self.monitor_valve_and_drive(at, was, s, now, &mut wrong);
        self.monitor_measurements(&s.memory, now, &mut wrong);
        // nothing that the frame commands stops such a drive
        wrong.found(has_uncommanded_speed, Cause::DriveUncommanded);
        wrong
    }

    /// Reference, course, end stops and pressures: a controlled stop ends before the end stop.
    fn monitor_course(
        &self,
        at: &Phases<T>,
        s: &FrameMemory<T>,
        now: &FrameInput<T>,
        reference: &SetPoint<T>,
        wrong: &mut Wrong<T>,
    ) {
        let l = &self.limits;
        let borne = T::lit(BORNE + 0.5);
        let follows = at.releasing | at.opening | at.controlling;
        wrong.found(follows & borne.lt(s.bad_reference), Cause::ReferenceImplausible);
        let v = s.velocity;
        let margin = l.end_margin.max(v.abs() * l.stopping_time);
        let touches = l.creep / l.still_time;
        let is_low = now.stroke.lt(margin) & v.lt(-touches);
        let is_high = (l.stroke - margin).lt(now.stroke) & touches.lt(v);
        wrong.found(at.controlling & (is_low | is_high), Cause::EndOfStroke);
        let off = (now.stroke - reference.position).abs();
        wrong.found(at.controlling & l.tracking.lt(off), Cause::TrackingError);
        let pressures = [now.pressure_pump_a, now.pressure_a, now.pressure_b, now.pressure_pump_b];
        let highest = pressures.into_iter().fold(T::zero(), |most, p| most.max(p));
        wrong.found(l.pressure.lt(highest), Cause::OverPressure);
    }

    /// The load: carried by the pump side, released, held, sinking, and running away.
    fn monitor_load(
        &self,
        at: &Phases<T>,
        was: &FrameMemory<T>,
        s: &mut FrameState<T>,
        now: &FrameInput<T>,
        wrong: &mut Wrong<T>,
    ) {
        let l = &self.limits;
        let [pump, load, ..] = self.sides(now);
        let has_opened = is_set(was.holding_valve) & l.valve_time.lt(s.memory.valve_since);
        let apart = has_opened & l.pressure_agreement.lt((pump - load).abs());
        s.memory.disagreeing = T::select(apart, was.disagreeing + l.period, T::zero());
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
        let v = s.memory.velocity;
        wrong.found((T::lit(RUNAWAY) * l.speed).lt(v.abs()), Cause::Runaway);
    }

    /// Load-holding valve and drive against what they are commanded; whether the drive turns uncommanded.
    fn monitor_valve_and_drive(
        &self,
        at: &Phases<T>,
        was: &FrameMemory<T>,
        s: &mut FrameState<T>,
        now: &FrameInput<T>,
        wrong: &mut Wrong<T>,
    ) -> T::Mask {
        let l = &self.limits;
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
        drive.uncommanded
    }

    /// The measurements themselves: stuck, or implausible for too long.
    fn monitor_measurements(&self, m: &FrameMemory<T>, now: &FrameInput<T>, wrong: &mut Wrong<T>) {
        let l = &self.limits;
        let zero = T::zero();
        let stuck = |time: T, value: T| l.stuck.lt(time) & value.lt(l.pressure);
        let is_stuck = stuck(m.stroke_repeated, zero)
            | stuck(m.pressure_pump_a_repeated, now.pressure_pump_a)
            | stuck(m.pressure_a_repeated, now.pressure_a)
            | stuck(m.pressure_b_repeated, now.pressure_b)
            | stuck(m.pressure_pump_b_repeated, now.pressure_pump_b);
        wrong.found(zero.lt(l.stuck) & is_stuck, Cause::SensorStuck);
        let lost = T::lit(BORNE + 0.5).lt(m.bad);
        wrong.found(lost, Cause::MotorSpeedImplausible);
        wrong.found(lost & is_set(m.bad_pressure), Cause::PressureImplausible);
        wrong.found(lost & is_set(m.bad_position), Cause::PositionImplausible);
    }

    /// A release that waits in vain: for a controller that could take over, or for a load at rest. `runs` holds
    /// where it waits no more.
    pub(super) fn monitor_readiness(
        &self,
        at: &Phases<T>,
        was: &FrameMemory<T>,
        s: &FrameMemory<T>,
        runs: T::Mask,
        wrong: &mut Wrong<T>,
    ) {
        let is_late = T::lit(READY_TIME).lt(s.since);
        let is_still = self.limits.still_time.lt(was.still_for);
        wrong.found(at.releasing & !runs & is_late, Cause::ControllerInvalid);
        wrong.found(at.releasing & !runs & is_late & !is_still, Cause::LoadNotStill);
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
}
