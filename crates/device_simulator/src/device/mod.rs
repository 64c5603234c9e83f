//! A device: controller, state machine, mailbox, object dictionary and application.

mod fault;
mod settings;
mod sii;
mod state_machine;

pub use fault::Fault;
pub use settings::{Area, Identity, Settings, Synchronisation};
pub use state_machine::State;

use crate::al_status_code::AlStatusCode;
use crate::application::Application;
use crate::controller::registers::{AL_CONTROL, AL_STATUS, AL_STATUS_CODE};
use crate::controller::{Controller, DistributedClock, Eeprom, Event, SyncManager};
use crate::frame::{Access, Command, Datagram};
use crate::mailbox::{self, Request};
use crate::object_dictionary::{
    Abort, Key, MappedEntry, ObjectDictionary, mapped_bytes, pack, unpack,
};
use std::collections::VecDeque;

/// Simulated EtherCAT device: controller, state machine, mailbox, object dictionary and application.
pub struct Device {
    settings: Settings,
    /// Device controller: registers, memory and clock.
    pub controller: Controller,
    /// CoE object dictionary.
    pub dictionary: ObjectDictionary,
    application: Box<dyn Application>,
    state: State,
    error: Option<AlStatusCode>,
    /// Requested state, and when it is due \[ns\].
    requested: Option<(u64, u8)>,
    /// When SAFEOP was asked to go to OP \[ns\].
    waiting: Option<u64>,
    outputs: Vec<MappedEntry>,
    inputs: Vec<MappedEntry>,
    synchrony: Synchrony,
    /// When the request in the mailbox is answered \[ns\].
    answer_due: Option<u64>,
    answers: VecDeque<Vec<u8>>,
    last_answer: Vec<u8>,
    counter: u8,
    faults: Vec<Fault>,
    /// Frames that came by a damaged cable.
    frames: u32,
    /// How far time has gone \[ns\].
    now: u64,
}

/// Outputs and SYNC0 events received since the device went into SAFEOP.
#[derive(Clone, Copy, Debug, Default)]
struct Synchrony {
    /// When outputs came last \[ns\].
    outputs: Option<u64>,
    has_pulsed: bool,
    /// Outputs since the last SYNC0.
    since_pulse: u32,
    /// Missed cycles, a missed one for three.
    missed: u32,
}

/// Weight of a missed cycle; a good one takes one back.
const MISSED: u32 = 3;

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
            waiting: None,
            outputs: Vec::new(),
            inputs: Vec::new(),
            synchrony: Synchrony::default(),
            answer_due: None,
            answers: VecDeque::new(),
            last_answer: Vec::new(),
            counter: 0,
            faults: Vec::new(),
            frames: 0,
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
            Fault::SyncMissing => self.controller.clock.is_silent = true,
            Fault::Drift(by) => self.controller.clock.drift_ppb += by,
            Fault::Emergency(message) => self.send(|counter| mailbox::emergency(counter, message)),
            Fault::Deaf(_)
            | Fault::MailboxStuck
            | Fault::SdoAbort(..)
            | Fault::DamagedCable { .. } => self.faults.push(fault),
        }
    }

    /// Removes all lasting injected faults.
    pub fn clear_faults(&mut self) {
        self.faults.clear();
        self.controller.clock.is_silent = false;
    }

    /// Begins with a frame: one that the device does not hear passes it untouched.
    pub(crate) fn hears(&mut self) -> bool {
        let deaf = self.faults.iter_mut().find_map(|fault| match fault {
            Fault::Deaf(frames) if *frames > 0 => Some(frames),
            _ => None,
        });
        if let Some(frames) = deaf {
            *frames -= 1;
            return false;
        }
        true
    }

    /// A frame comes by a port; whether it came undamaged. A damaged one is counted.
    pub(crate) fn receives(&mut self, port: u8) -> bool {
        let is_here = |fault: &Fault| match fault {
            Fault::DamagedCable { port: at, one_of } if *at == port => Some(*one_of),
            _ => None,
        };
        let Some(one_of) = self.faults.iter().find_map(is_here).filter(|one_of| *one_of > 0) else {
            return true;
        };
        self.frames = self.frames.wrapping_add(1);
        if !self.frames.is_multiple_of(one_of) {
            return true;
        }
        self.controller.count_damaged_frame(port);
        false
    }

    /// What a datagram does as it passes.
    pub(crate) fn pass(&mut self, mut datagram: Datagram<'_>, now: u64) {
        let is_at = |d: &Datagram<'_>| d.device() == 0;
        let is_named = |d: &Datagram<'_>| d.device() == self.controller.station();
        match datagram.command {
            Command::Nop => {}
            Command::Position(access) => {
                if is_at(&datagram) {
                    self.access(access, &mut datagram, false, now);
                }
                datagram.count_position();
            }
            Command::Station(access) if is_named(&datagram) => {
                self.access(access, &mut datagram, false, now);
            }
            Command::Station(_) => {}
            Command::Broadcast(access) => {
                self.access(access, &mut datagram, true, now);
                datagram.count_position();
            }
            Command::Logical(access) => {
                let address = datagram.logical();
                let count = self.controller.logical(address, access, datagram.data, now);
                datagram.count(count);
            }
            Command::PositionReadMultipleWrite => {
                let access = if is_at(&datagram) { Access::Read } else { Access::Write };
                self.access(access, &mut datagram, false, now);
                datagram.count_position();
            }
            Command::StationReadMultipleWrite => {
                let access = if is_named(&datagram) { Access::Read } else { Access::Write };
                self.access(access, &mut datagram, false, now);
            }
        }
        self.notice(now);
    }

    /// An access to physical memory; `or` adds bits to what is in the frame.
    fn access(&mut self, access: Access, datagram: &mut Datagram<'_>, or: bool, now: u64) {
        let address = datagram.memory();
        let mut read = vec![0; datagram.data.len()];
        let was_read = access.reads() && self.controller.read(address, &mut read, now);
        let was_written = access.writes() && self.controller.write(address, datagram.data, now);
        if was_read {
            for (to, from) in datagram.data.iter_mut().zip(&read) {
                *to = if or { *to | from } else { *from };
            }
        }
        let for_write = if access == Access::ReadWrite { 2 } else { 1 };
        datagram.count(u16::from(was_read) + if was_written { for_write } else { 0 });
    }

    /// Takes notice of what a datagram has done.
    fn notice(&mut self, now: u64) {
        for event in self.controller.take_events() {
            match event {
                Event::StateRequest(byte) => {
                    self.requested = Some((now + self.settings.state_change_time, byte));
                }
                Event::Request => self.answer_due = Some(now + self.settings.mailbox_time),
                Event::Fetched => self.post(),
                Event::RepeatRequest => self.repeat(),
                Event::Outputs => self.outputs_came(now),
            }
        }
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
            let patience = self.waiting.map(|since| since + self.settings.synchronisation.patience);
            let requested = self.requested.map(|(due, _)| due);
            let due = [sync, watchdog, requested, self.answer_due, patience];
            let Some(first) = due.into_iter().flatten().min().filter(|first| *first <= now) else {
                break;
            };
            self.application.advance(&mut self.dictionary, first);
            if sync == Some(first) {
                self.controller.clock.pulse(&self.controller.memory);
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
                self.waiting = None;
                let code = match self.uses_sync0() && !self.synchrony.has_pulsed {
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

    /// Whether outputs and inputs go by SYNC0.
    fn uses_sync0(&self) -> bool {
        DistributedClock::settings(&self.controller.memory).0[0]
    }

    // ---- states

    /// A state is requested, or an error acknowledged (bit 4).
    fn change_state(&mut self, byte: u8, now: u64) {
        let is_acknowledged = byte & 0x10 != 0;
        let wanted = match State::of(byte & 0x0f) {
            Ok(wanted) => wanted,
            Err(code) => return self.fail(self.state, code, now),
        };
        // with an error that is not acknowledged a device goes down only
        if self.error.is_some() && !is_acknowledged && wanted >= self.state {
            return self.show_state();
        }
        self.error = None;
        if !self.settings.is_emulated {
            let memory = &self.controller.memory;
            let checked =
                state_machine::check(self.state, wanted, memory, &self.settings, &self.dictionary);
            if let Err(code) = checked {
                return self.fail(self.state, code, now);
            }
        }
        self.waiting = None;
        if wanted == State::Op && self.state != State::Op && !self.may_operate() {
            self.waiting = Some(now);
            return self.show_state();
        }
        self.enter(wanted, now);
    }

    /// Whether OP may be entered: outputs came, and SYNC0 where it is used.
    fn may_operate(&self) -> bool {
        let has_outputs = self.outputs.is_empty() || self.synchrony.outputs.is_some();
        self.settings.is_emulated
            || has_outputs && (!self.uses_sync0() || self.synchrony.has_pulsed)
    }

    /// Enters a state.
    fn enter(&mut self, state: State, now: u64) {
        let before = std::mem::replace(&mut self.state, state);
        if before == State::Op && state != State::Op {
            self.stop_outputs(None, now);
        }
        if before < State::SafeOp && state == State::SafeOp {
            // checked on the way here
            self.outputs = self.dictionary.mapped(0x1c12).unwrap_or_default();
            self.inputs = self.dictionary.mapped(0x1c13).unwrap_or_default();
            self.synchrony = Synchrony::default();
            self.take_inputs(now);
        }
        if state == State::Init {
            self.answers.clear();
            self.answer_due = None;
        }
        self.show_state();
    }

    /// Stays in a state or falls back to it, with an error.
    fn fail(&mut self, state: State, code: AlStatusCode, now: u64) {
        let was_operating = self.state == State::Op;
        self.state = self.state.min(state);
        self.error = Some(code);
        self.waiting = None;
        if was_operating && self.state != State::Op {
            self.stop_outputs(Some(code), now);
        }
        self.show_state();
    }

    fn stop_outputs(&mut self, why: Option<AlStatusCode>, now: u64) {
        self.controller.watchdog.stop();
        self.application.outputs_are_lost(&mut self.dictionary, now, why);
    }

    fn show_state(&mut self) {
        let error = if self.error.is_some() { 0x10 } else { 0 };
        self.controller.memory.set(AL_STATUS, &[self.state as u8 | error, 0]);
        let code = self.error.unwrap_or(AlStatusCode::NoError) as u16;
        self.controller.memory.set(AL_STATUS_CODE, &code.to_le_bytes());
        if self.settings.is_emulated {
            self.controller.memory.set(AL_CONTROL, &[self.state as u8, 0]);
        }
    }

    // ---- process data

    /// Whole outputs were written.
    fn outputs_came(&mut self, now: u64) {
        if self.state < State::SafeOp {
            return;
        }
        self.synchrony.outputs = Some(now);
        self.synchrony.since_pulse += 1;
        if !self.uses_sync0() {
            self.take_outputs(now);
            self.take_inputs(now);
        } else if self.state == State::Op
            && self.synchrony.since_pulse > self.settings.synchronisation.missed_limit
        {
            self.fail(State::SafeOp, AlStatusCode::FatalSynchronisationError, now);
        }
        self.operate(now);
    }

    /// Enters OP where that was waited for.
    fn operate(&mut self, now: u64) {
        if self.waiting.is_some() && self.may_operate() {
            self.waiting = None;
            self.enter(State::Op, now);
        }
    }

    /// SYNC0: outputs that came in time count, inputs are latched.
    fn sync0(&mut self, now: u64) {
        if self.state < State::SafeOp {
            return;
        }
        self.synchrony.has_pulsed = true;
        let cycle = u64::from(DistributedClock::settings(&self.controller.memory).1[0]);
        let set_up = self.settings.synchronisation.set_up;
        // a device without outputs waits for none
        let is_in_time = self.outputs.is_empty()
            || self
                .synchrony
                .outputs
                .is_some_and(|came| came + set_up <= now && now - came <= cycle);
        let missed = &mut self.synchrony.missed;
        *missed = if is_in_time { missed.saturating_sub(1) } else { *missed + MISSED };
        let limit = MISSED * self.settings.synchronisation.missed_limit;
        if self.state == State::Op && *missed > limit {
            self.fail(State::SafeOp, AlStatusCode::SynchronisationError, now);
        } else if self.state != State::Op {
            *missed = 0;
        }
        self.synchrony.since_pulse = 0;
        self.take_outputs(now);
        self.take_inputs(now);
        self.operate(now);
    }

    fn take_outputs(&mut self, now: u64) {
        let Some(area) = self.settings.outputs.filter(|_| self.state == State::Op) else { return };
        let bytes = self.controller.memory.bytes(area.start, mapped_bytes(&self.outputs));
        unpack(&self.outputs, bytes, &mut self.dictionary);
        self.application.outputs(&mut self.dictionary, now);
    }

    fn take_inputs(&mut self, now: u64) {
        self.application.inputs(&mut self.dictionary, now);
        let Some(area) = self.settings.inputs else { return };
        let length = mapped_bytes(&self.inputs);
        pack(&self.inputs, &self.dictionary, self.controller.memory.bytes_mut(area.start, length));
    }

    // ---- mailbox

    /// Answers the request that lies in the mailbox.
    fn answer(&mut self) {
        let Some([requests, _]) = self.settings.mailbox else { return };
        if self.faults.contains(&Fault::MailboxStuck) || self.state == State::Init {
            return;
        }
        let bytes =
            self.controller.memory.bytes(requests.start, usize::from(requests.length)).to_vec();
        SyncManager::set_full(&mut self.controller.memory, requests.sync_manager, false);
        match mailbox::request(&bytes) {
            Request::Sdo(sdo) => {
                if let Some(response) = self.sdo(&sdo) {
                    self.send(|counter| mailbox::sdo_answer(counter, &response));
                }
            }
            Request::Information => self.send(mailbox::no_information),
            Request::Unsupported => self.send(|counter| mailbox::error(counter, 2)),
            Request::Malformed => self.send(|counter| mailbox::error(counter, 1)),
        }
    }

    /// Answers an SDO request.
    fn sdo(&mut self, request: &[u8]) -> Option<Vec<u8>> {
        let room = self.settings.mailbox.map_or(0, |[_, answers]| usize::from(answers.length));
        let refused = |key: Key, faults: &[Fault]| {
            faults.iter().find_map(|fault| match fault {
                Fault::SdoAbort(at, abort) if *at == key => Some(*abort),
                _ => None,
            })
        };
        let is_preop = self.state == State::PreOp;
        let before = self.dictionary.clone();
        let (dictionary, application, faults) =
            (&mut self.dictionary, &mut self.application, &self.faults);
        let write = |key: Key, value: &[u8]| -> Result<(), Abort> {
            refused(key, faults).map_or(Ok(()), Err)?;
            dictionary.write(key, value, is_preop)?;
            let taken = application.written(dictionary, key);
            if taken.is_err() {
                *dictionary = before.clone();
            }
            taken
        };
        let read = |key: Key| -> Result<Vec<u8>, Abort> {
            refused(key, faults).map_or(Ok(()), Err)?;
            before.object(key).map(|object| object.value.clone())
        };
        mailbox::answer(request, room, read, write)
    }

    /// Sends a message with the next counter, after those that wait.
    fn send(&mut self, message: impl FnOnce(u8) -> Vec<u8>) {
        self.counter = self.counter % 7 + 1;
        self.answers.push_back(message(self.counter));
        self.post();
    }

    /// Puts the next message into the mailbox, where that is empty.
    fn post(&mut self) {
        let Some([_, area]) = self.settings.mailbox else { return };
        if SyncManager::is_full(&self.controller.memory, area.sync_manager) {
            return;
        }
        if let Some(message) = self.answers.pop_front() {
            self.last_answer = message;
            self.fill(area);
        }
    }

    /// The last message is repeated; its toggle is confirmed.
    fn repeat(&mut self) {
        let Some([_, area]) = self.settings.mailbox else { return };
        let at = 0x0806 + 8 * area.sync_manager;
        let toggle = self.controller.memory.u8(at) & 2;
        if !self.last_answer.is_empty() {
            self.fill(area);
        }
        self.controller.memory.set(at + 1, &[toggle]);
    }

    fn fill(&mut self, area: Area) {
        let to = self.controller.memory.bytes_mut(area.start, usize::from(area.length));
        to.fill(0);
        to.iter_mut().zip(&self.last_answer).for_each(|(to, from)| *to = *from);
        SyncManager::set_full(&mut self.controller.memory, area.sync_manager, true);
    }
}
