//! A device: controller, state machine, mailbox, object dictionary and application.

mod al_state;
mod datagram;
mod fault;
mod mailbox_service;
mod process_data;
mod settings;
mod sii;
mod state_machine;

pub use fault::Fault;
pub use settings::{Area, Identity, Settings, Synchronisation};
pub use state_machine::State;

use crate::al_status_code::AlStatusCode;
use crate::application::Application;
use crate::controller::{Controller, DistributedClock, Eeprom};
use crate::mailbox;
use crate::object_dictionary::{MappedEntry, ObjectDictionary};
use process_data::SyncCounters;
use std::collections::VecDeque;

/// Simulated EtherCAT device: controller, state machine, mailbox, object dictionary and application.
pub struct Device {
    /// Identity, memory layout, synchronisation and times.
    settings: Settings,
    /// Device controller: registers, memory and clock.
    pub controller: Controller,
    /// CoE object dictionary.
    pub dictionary: ObjectDictionary,
    /// Function behind the controller.
    application: Box<dyn Application>,
    /// AL state.
    state: State,
    /// AL status code of an error that is not acknowledged.
    error: Option<AlStatusCode>,
    /// When a request is carried out \[ns\], and the byte that was written to AL control.
    requested: Option<(u64, u8)>,
    /// When OP was requested that is still waited for \[ns\]; none without such a request.
    op_requested_at: Option<u64>,
    /// Mapped outputs, from SAFEOP on.
    outputs: Vec<MappedEntry>,
    /// Mapped inputs, from SAFEOP on.
    inputs: Vec<MappedEntry>,
    /// Outputs and SYNC0 since SAFEOP.
    sync_counters: SyncCounters,
    /// When the request in the mailbox is answered \[ns\].
    answer_due: Option<u64>,
    /// Messages that wait for the mailbox to be empty.
    answers: VecDeque<Vec<u8>>,
    /// The message in the mailbox, for a repeat request.
    last_answer: Vec<u8>,
    /// Counter of the last message, 1 to 7 (ETG.1000.4, mailbox header).
    mailbox_counter: u8,
    /// Lasting injected faults.
    faults: Vec<Fault>,
    /// Frames received over a damaged cable.
    received_frames: u32,
    /// Time to which it was advanced \[ns\].
    now: u64,
}

impl std::fmt::Debug for Device {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut out = f.debug_struct("Device");
        out.field("name", &self.settings.name).field("state", &self.state);
        out.field("error", &self.error).finish_non_exhaustive()
    }
}

impl Device {
    /// Device after power-on, in state INIT.
    pub fn new(
        settings: Settings,
        clock: DistributedClock,
        dictionary: ObjectDictionary,
        application: Box<dyn Application>,
    ) -> Self {
        let content = sii::content(&settings, &dictionary);
        Self {
            controller: Controller::new(clock, Eeprom { content }),
            settings,
            dictionary,
            application,
            state: State::Init,
            error: None,
            requested: None,
            op_requested_at: None,
            outputs: Vec::new(),
            inputs: Vec::new(),
            sync_counters: SyncCounters::default(),
            answer_due: None,
            answers: VecDeque::new(),
            last_answer: Vec::new(),
            mailbox_counter: 0,
            faults: Vec::new(),
            received_frames: 0,
            now: 0,
        }
    }

    /// Present state, and the AL status code of an error; `None` without an error.
    pub fn state(&self) -> (State, Option<AlStatusCode>) {
        (self.state, self.error)
    }

    /// Name of the device.
    pub fn name(&self) -> &str {
        &self.settings.name
    }

    /// Injects a fault at the time `now` \[ns\].
    pub fn inject(&mut self, fault: Fault, now: u64) {
        match fault {
            Fault::StateDrop(code) => self.fail(State::SafeOp, code, now),
            Fault::Sync0Missing => self.controller.clock.is_sync0_suppressed = true,
            Fault::Drift(by) => self.controller.clock.drift_ppb += by,
            Fault::Emergency(message) => self.send(|counter| mailbox::emergency(counter, message)),
            Fault::FramesIgnored(_)
            | Fault::MailboxNotServed
            | Fault::SdoAbort(..)
            | Fault::DamagedCable { .. } => self.faults.push(fault),
        }
    }

    /// Removes all lasting injected faults.
    pub fn clear_faults(&mut self) {
        self.faults.clear();
        self.controller.clock.is_sync0_suppressed = false;
    }

    /// Whether the device processes the next frame; one that it ignores by an injected fault passes untouched.
    pub(crate) fn accepts_frame(&mut self) -> bool {
        let ignored = self.faults.iter_mut().find_map(|fault| match fault {
            Fault::FramesIgnored(frames) if *frames > 0 => Some(frames),
            _ => None,
        });
        if let Some(frames) = ignored {
            *frames -= 1;
            return false;
        }
        true
    }

    /// Receives a frame at a port; returns whether it is undamaged. A damaged one is counted in 0x0300 and 0x0301.
    pub(crate) fn receives_undamaged(&mut self, port: u8) -> bool {
        let damage_at_port = |fault: &Fault| match fault {
            Fault::DamagedCable { port: at, frames_per_error } if *at == port => {
                Some(*frames_per_error)
            }
            _ => None,
        };
        let Some(frames_per_error) =
            self.faults.iter().find_map(damage_at_port).filter(|frames| *frames > 0)
        else {
            return true;
        };
        self.received_frames = self.received_frames.wrapping_add(1);
        if !self.received_frames.is_multiple_of(frames_per_error) {
            return true;
        }
        self.controller.count_damaged_frame(port);
        false
    }

    /// Advances the device to the time `now` \[ns\]: SYNC0, watchdog, mailbox and state changes, in the order of
    /// their times. A time in the past has no effect.
    pub fn advance(&mut self, now: u64) {
        let now = now.max(self.now);
        self.now = now;
        loop {
            let controller = &self.controller;
            let sync = controller.clock.due(&controller.memory, now);
            let watchdog = (self.state == State::Op)
                .then(|| controller.watchdog.due(&controller.memory))
                .flatten();
            let op_timeout =
                self.op_requested_at.map(|since| since + self.settings.synchronisation.op_timeout);
            let requested = self.requested.map(|(due, _)| due);
            let due = [sync, watchdog, requested, self.answer_due, op_timeout];
            let Some(first) = due.into_iter().flatten().min().filter(|first| *first <= now) else {
                break;
            };
            self.application.advance(&mut self.dictionary, first);
            if sync == Some(first) {
                self.controller.clock.advance_sync0(&self.controller.memory);
                self.sync0(first);
            } else if watchdog == Some(first) {
                self.controller.watchdog.expire(&mut self.controller.memory);
                self.fail(State::SafeOp, AlStatusCode::SyncManagerWatchdog, first);
            } else if requested == Some(first) {
                if let Some((_, byte)) = self.requested.take() {
                    self.change_state(byte, first);
                }
            } else if self.answer_due == Some(first) {
                self.answer_due = None;
                self.answer();
            } else {
                self.op_requested_at = None;
                let code = match self.uses_sync0() && !self.sync_counters.has_received_sync0 {
                    true => AlStatusCode::NoSynchronisation,
                    false => AlStatusCode::NoValidOutputs,
                };
                self.fail(self.state, code, first);
            }
        }
        self.application.advance(&mut self.dictionary, now);
        if let Some(message) = self.application.emergency() {
            self.send(|counter| mailbox::emergency(counter, message));
        }
    }
}
