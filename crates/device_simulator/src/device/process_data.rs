//! Process data: outputs and inputs by the frame or by SYNC0, and the count of missed cycles.

use super::{Device, State};
use crate::al_status_code::AlStatusCode;
use crate::controller::DistributedClock;
use crate::object_dictionary::{mapped_bytes, pack, unpack};

/// Outputs and SYNC0 events since the device went into SAFEOP, for the synchronisation of ETG.1020.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SyncCounters {
    /// When outputs were received last \[ns\]; none before the first.
    pub(super) outputs: Option<u64>,
    /// Whether SYNC0 has come.
    pub(super) has_received_sync0: bool,
    /// Outputs received since the last SYNC0.
    outputs_since_sync0: u32,
    /// Counter of missed cycles: plus [`MISSED_CYCLE_WEIGHT`] for a missed one, minus 1 for a good one, at least 0.
    missed: u32,
}

/// Weight of a missed cycle in the counter, as of the sync error counter 0x10F1:02 of many drives.
const MISSED_CYCLE_WEIGHT: u32 = 3;

impl Device {
    /// Whether outputs are applied and inputs latched at SYNC0 (0x0981); else with the frame.
    pub(super) fn uses_sync0(&self) -> bool {
        DistributedClock::settings(&self.controller.memory).0[0]
    }

    /// Outputs were written completely at the time `now` \[ns\].
    pub(super) fn outputs_written(&mut self, now: u64) {
        if self.state < State::SafeOp {
            return;
        }
        self.sync_counters.outputs = Some(now);
        self.sync_counters.outputs_since_sync0 += 1;
        if !self.uses_sync0() {
            self.transfer_outputs(now);
            self.latch_inputs(now);
        } else if self.state == State::Op
            && self.sync_counters.outputs_since_sync0 > self.settings.synchronisation.missed_limit
        {
            self.fail(State::SafeOp, AlStatusCode::FatalSynchronisationError, now);
        }
        self.enter_op_when_ready(now);
    }

    /// Enters OP where it was requested and its conditions are met.
    fn enter_op_when_ready(&mut self, now: u64) {
        if self.op_requested_at.is_some() && self.is_ready_for_op() {
            self.op_requested_at = None;
            self.enter(State::Op, now);
        }
    }

    /// SYNC0 at the time `now` \[ns\]: outputs are applied, inputs latched, and late or missing outputs counted.
    pub(super) fn sync0(&mut self, now: u64) {
        if self.state < State::SafeOp {
            return;
        }
        self.sync_counters.has_received_sync0 = true;
        let cycle = u64::from(DistributedClock::settings(&self.controller.memory).1[0]);
        let set_up_time = self.settings.synchronisation.set_up_time;
        // a device without outputs waits for none
        let is_in_time = self.outputs.is_empty()
            || self
                .sync_counters
                .outputs
                .is_some_and(|arrival| arrival + set_up_time <= now && now - arrival <= cycle);
        let missed = &mut self.sync_counters.missed;
        *missed = if is_in_time { missed.saturating_sub(1) } else { *missed + MISSED_CYCLE_WEIGHT };
        let limit = MISSED_CYCLE_WEIGHT * self.settings.synchronisation.missed_limit;
        if self.state == State::Op && *missed > limit {
            self.fail(State::SafeOp, AlStatusCode::SynchronisationError, now);
        } else if self.state != State::Op {
            *missed = 0;
        }
        self.sync_counters.outputs_since_sync0 = 0;
        self.transfer_outputs(now);
        self.latch_inputs(now);
        self.enter_op_when_ready(now);
    }

    /// In OP, passes the outputs in the memory to the application.
    fn transfer_outputs(&mut self, now: u64) {
        let Some(area) = self.settings.outputs.filter(|_| self.state == State::Op) else { return };
        let bytes = self.controller.memory.bytes(area.start, mapped_bytes(&self.outputs));
        unpack(&self.outputs, bytes, &mut self.dictionary);
        self.application.outputs(&mut self.dictionary, now);
    }

    /// Puts the inputs of the application into the memory.
    pub(super) fn latch_inputs(&mut self, now: u64) {
        self.application.inputs(&mut self.dictionary, now);
        let Some(area) = self.settings.inputs else { return };
        let length = mapped_bytes(&self.inputs);
        pack(&self.inputs, &self.dictionary, self.controller.memory.bytes_mut(area.start, length));
    }
}
