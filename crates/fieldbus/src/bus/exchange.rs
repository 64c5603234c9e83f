//! Exchange of a frame: outputs into the process image, the frame and its answer, inputs out of it.

use super::{Bus, MARGIN, Transition};
use crate::cycle_record::{Exchange, NO_STATE, number};
use crate::fault::Fault;
use crate::link::Link;
use crate::start_up::{OP, UNTIL_OP};
use crate::time::now;
use ethercrab::SubDeviceState;
use hydroboom_realtime::machine::Delay;

/// Time constant of the exponential mean of delays \[commands\].
const AVERAGED: f64 = 256.0;

impl<L: Link> Bus<L> {
    /// One exchange, due at a time \[ns\], with or without new outputs; returns whether its inputs are valid.
    pub(super) fn exchange(&mut self, due: u64, has_outputs: bool) -> bool {
        let main = self.wire.main;
        for (position, bytes) in self.outputs.iter().enumerate() {
            // the guard has to end with its statement: reading inputs while it is held is a deadlock
            if let Ok(device) = self.group.subdevice(main, position) {
                copy(&mut device.outputs_raw_mut(), bytes);
            }
        }
        let sent = now();
        if self.side.is_withheld() {
            // a test of the devices' watchdogs: no frame is sent, as with a broken cable
            self.pace.update(sent, None);
            self.cycle.is_lost = true;
            return false;
        }
        self.counters.exchanges += 1;
        let is_late = sent.saturating_sub(due) > self.table.bus.period / 2;
        self.counters.late_begins += u64::from(is_late);
        let end = self.pace.answer_deadline(sent, &self.table.bus, MARGIN);
        let answer = self.wire.run_until(self.group.tx_rx_dc(main), end).and_then(Result::ok);
        self.pace.update(sent, answer.as_ref().map(|answer| answer.extra.dc_system_time));
        let Some(answer) = answer else {
            self.counters.lost += 1;
            self.cycle.is_lost = true;
            return false;
        };
        self.times.round_trip.saturating_record(now().saturating_sub(sent).max(1));
        self.time_outputs(answer.extra.dc_system_time, has_outputs);
        let begin = self.cycle.sync0.unwrap_or_default();
        // the only exchange of a cycle is recorded as the first one
        let place = usize::from(has_outputs && self.table.bus.exchanges == 2);
        self.record.exchanges[place] = Exchange {
            phase: Some(answer.extra.dc_system_time.saturating_sub(begin) as u32),
            working_counter: Some(answer.working_counter),
        };
        for (shown, state) in self.record.states.iter_mut().zip(&answer.subdevice_states) {
            *shown = number(*state);
        }
        if answer.working_counter != self.working_counter {
            self.counters.low += 1;
            self.cycle.has_wrong_working_counter = true;
        }
        let is_late =
            matches!(self.transition, Transition::Requested(since) if now() - since > UNTIL_OP);
        for (device, state) in (0..).zip(&answer.subdevice_states) {
            let state = number(*state);
            if state == NO_STATE {
                // no device filled in the datagram; one frame alone is no fault, and its working counter is wrong, too
                self.device_silent(device);
            } else if !self.transition.allows(state) || is_late && state != OP {
                self.dropped = self.dropped.or(Some(device));
            }
        }
        if matches!(self.transition, Transition::Requested(_))
            && answer.is_in_state(SubDeviceState::Op)
        {
            self.transition = Transition::Op;
        }
        if self.cycle.has_wrong_working_counter {
            return false;
        }
        for (position, bytes) in self.inputs.iter_mut().enumerate() {
            if let Ok(device) = self.group.subdevice(main, position) {
                copy(bytes, &device.inputs_raw());
            }
        }
        true
    }

    /// Records margin to SYNC0 and delay of the outputs of a frame, from the time \[ns\] at which it passed the
    /// reference clock.
    fn time_outputs(&mut self, passed: u64, has_outputs: bool) {
        let period = self.table.bus.period;
        let begin = *self.cycle.sync0.get_or_insert(passed - passed % period);
        if !has_outputs {
            return;
        }
        let applied = begin + period;
        match applied.checked_sub(passed) {
            Some(margin) => self.times.margin.saturating_record(margin.max(1)),
            None => self.counters.late_outputs += 1,
        }
        if let Some(sampled) = self.answers.take() {
            let cycles = |from: u64, to: u64| to.saturating_sub(from) as f64 / period as f64;
            // inputs are read `exchange` after the SYNC0 at which they were latched
            let now = Delay {
                measurement: self.table.bus.exchange as f64 / period as f64,
                total: cycles(sampled, applied.max(passed)),
            };
            self.delay = Some(self.delay.map_or(now, |mean| Delay {
                total: mean.total + (now.total - mean.total) / AVERAGED,
                ..now
            }));
        }
    }

    /// A device did not answer: a fault where this loss exceeds the limit of the window.
    fn device_silent(&mut self, device: u16) {
        if self.wrong_working_counters.is_at_limit() {
            self.stop(Fault::DeviceSilent { device });
        }
    }
}

/// Copies as much as there is room for.
fn copy(to: &mut [u8], from: &[u8]) {
    to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
}
