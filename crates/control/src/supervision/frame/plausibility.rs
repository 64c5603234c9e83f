//! Plausibility of measurements and reference, and substitutes for implausible ones.

use super::{Frame, FrameInput, FrameMemory, Phases, REFERENCE_SLACK, is_set};
use crate::supervision::plausibility::{LOWEST_PRESSURE, RUNAWAY, STROKE_SLACK, VELOCITY_WINDOW};
use hydroboom_math::Real;

/// Share of such a period that a plausible one makes good: one in ten is borne.
const FORGOTTEN: f64 = 0.1;

impl<T: Real> Frame<T> {
    /// The measurements and the reference as far as they are plausible: finite, in range, and no further
    /// from the last good ones than machine and reference can go. The last good one stands in for one that
    /// is not.
    pub(super) fn plausible(
        &self,
        at: &Phases<T>,
        was: &FrameMemory<T>,
        input: &FrameInput<T>,
        s: &mut FrameMemory<T>,
    ) -> FrameInput<T> {
        let steps = is_set(was.has_begun) & !at.idle;
        self.judge_measurements(was, input, steps, s);
        self.judge_reference(at, was, input, s);
        self.follow_signals(was, steps, s);
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

    /// Takes over the plausible measurements and counts the periods in which one was not. `steps` says
    /// whether they are compared with the last good ones.
    fn judge_measurements(
        &self,
        was: &FrameMemory<T>,
        input: &FrameInput<T>,
        steps: T::Mask,
        s: &mut FrameMemory<T>,
    ) {
        let l = &self.limits;
        let (zero, one) = (T::zero(), T::one());
        let runaway = T::lit(RUNAWAY);
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
    }

    /// Takes over a plausible reference, once it is followed, and counts the periods in which it was not.
    fn judge_reference(
        &self,
        at: &Phases<T>,
        was: &FrameMemory<T>,
        input: &FrameInput<T>,
        s: &mut FrameMemory<T>,
    ) {
        let l = &self.limits;
        let (zero, one) = (T::zero(), T::one());
        let (runaway, slack) = (T::lit(RUNAWAY), T::lit(STROKE_SLACK));
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
    }

    /// For how long each signal has repeated itself, how fast the piston is, and for how long it has been
    /// still.
    fn follow_signals(&self, was: &FrameMemory<T>, steps: T::Mask, s: &mut FrameMemory<T>) {
        let l = &self.limits;
        let zero = T::zero();
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
    }
}
