//! AL state: requests by AL control, transitions, errors, and the registers that show them (ETG.1000.6).

use super::Device;
use super::process_data::SyncCounters;
use super::state_machine::{self, State};
use crate::al_status_code::AlStatusCode;
use crate::controller::registers::{AL_CONTROL, AL_STATUS, AL_STATUS_CODE};

impl Device {
    /// Executes a request of AL control: state in bits 0 to 3, acknowledgement of an error in bit 4. A refused one
    /// leaves the device in its state, with an AL status code.
    pub(super) fn change_state(&mut self, byte: u8, now: u64) {
        let is_acknowledged = byte & 0x10 != 0;
        let requested = match State::of(byte & 0x0f) {
            Ok(requested) => requested,
            Err(code) => return self.fail(self.state, code, now),
        };
        // with an error that is not acknowledged a device goes down only
        if self.error.is_some() && !is_acknowledged && requested >= self.state {
            return self.write_al_status();
        }
        self.error = None;
        if !self.settings.has_device_emulation {
            let memory = &self.controller.memory;
            let checked = state_machine::check(
                self.state,
                requested,
                memory,
                &self.settings,
                &self.dictionary,
            );
            if let Err(code) = checked {
                return self.fail(self.state, code, now);
            }
        }
        self.op_requested_at = None;
        if requested == State::Op && self.state != State::Op && !self.is_ready_for_op() {
            self.op_requested_at = Some(now);
            return self.write_al_status();
        }
        self.enter(requested, now);
    }

    /// Whether OP may be entered: outputs were received, and SYNC0 where it is used.
    pub(super) fn is_ready_for_op(&self) -> bool {
        let has_outputs = self.outputs.is_empty() || self.sync_counters.outputs.is_some();
        self.settings.has_device_emulation
            || has_outputs && (!self.uses_sync0() || self.sync_counters.has_received_sync0)
    }

    /// Enters a state, which was checked before. From PREOP to SAFEOP the mapping is taken over.
    pub(super) fn enter(&mut self, state: State, now: u64) {
        let before = std::mem::replace(&mut self.state, state);
        if before == State::Op && state != State::Op {
            self.set_outputs_safe(None, now);
        }
        if before < State::SafeOp && state == State::SafeOp {
            // checked on the way here
            self.outputs = self.dictionary.mapped(0x1c12).unwrap_or_default();
            self.inputs = self.dictionary.mapped(0x1c13).unwrap_or_default();
            self.sync_counters = SyncCounters::default();
            self.latch_inputs(now);
        }
        if state == State::Init {
            self.answers.clear();
            self.answer_due = None;
        }
        self.write_al_status();
    }

    /// Stays in a state or falls back to it, with an AL status code; outputs become safe where OP is left.
    pub(super) fn fail(&mut self, state: State, code: AlStatusCode, now: u64) {
        let was_operating = self.state == State::Op;
        self.state = self.state.min(state);
        self.error = Some(code);
        self.op_requested_at = None;
        if was_operating && self.state != State::Op {
            self.set_outputs_safe(Some(code), now);
        }
        self.write_al_status();
    }

    /// Stops the watchdog, and lets the application put its outputs into their safe state.
    fn set_outputs_safe(&mut self, why: Option<AlStatusCode>, now: u64) {
        self.controller.watchdog.stop();
        self.application.outputs_are_lost(&mut self.dictionary, now, why);
    }

    /// Writes AL status (0x0130) and AL status code (0x0134).
    fn write_al_status(&mut self) {
        let error = if self.error.is_some() { 0x10 } else { 0 };
        self.controller.memory.set(AL_STATUS, &[self.state as u8 | error, 0]);
        let code = self.error.unwrap_or(AlStatusCode::NoError) as u16;
        self.controller.memory.set(AL_STATUS_CODE, &code.to_le_bytes());
        if self.settings.has_device_emulation {
            self.controller.memory.set(AL_CONTROL, &[self.state as u8, 0]);
        }
    }
}
