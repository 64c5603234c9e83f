//! Mailbox service: requests and answers in the memory of the mailbox's sync managers, with SDO access.

use super::{Area, Device, Fault, State};
use crate::controller::SyncManager;
use crate::mailbox::{self, Request};
use crate::object_dictionary::{Abort, Key};

impl Device {
    /// Answers the request in the mailbox, and empties it.
    pub(super) fn answer(&mut self) {
        let Some([requests, _]) = self.settings.mailbox else { return };
        if self.faults.contains(&Fault::MailboxNotServed) || self.state == State::Init {
            return;
        }
        let bytes =
            self.controller.memory.bytes(requests.start, usize::from(requests.length)).to_vec();
        SyncManager::set_full(&mut self.controller.memory, requests.sync_manager, false);
        match mailbox::request(&bytes) {
            Request::Sdo(sdo) => {
                if let Some(response) = self.sdo(&sdo) {
                    self.send(|counter| mailbox::sdo_response(counter, &response));
                }
            }
            Request::Information => self.send(mailbox::sdo_information_error),
            Request::Unsupported => self.send(|counter| mailbox::error(counter, 2)),
            Request::Malformed => self.send(|counter| mailbox::error(counter, 1)),
        }
    }

    /// Response to an SDO request; `None` if there is none.
    fn sdo(&mut self, request: &[u8]) -> Option<Vec<u8>> {
        let mailbox_length =
            self.settings.mailbox.map_or(0, |[_, answers]| usize::from(answers.length));
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
            let accepted = application.written(dictionary, key);
            if accepted.is_err() {
                *dictionary = before.clone();
            }
            accepted
        };
        let read = |key: Key| -> Result<Vec<u8>, Abort> {
            refused(key, faults).map_or(Ok(()), Err)?;
            before.object(key).map(|object| object.value.clone())
        };
        mailbox::answer(request, mailbox_length, read, write)
    }

    /// Queues a message, which is made with the next mailbox counter (1 to 7).
    pub(super) fn send(&mut self, message: impl FnOnce(u8) -> Vec<u8>) {
        self.mailbox_counter = self.mailbox_counter % 7 + 1;
        self.answers.push_back(message(self.mailbox_counter));
        self.fill_with_next();
    }

    /// Writes the next message into the mailbox for answers, where that is empty.
    pub(super) fn fill_with_next(&mut self) {
        let Some([_, area]) = self.settings.mailbox else { return };
        if SyncManager::is_full(&self.controller.memory, area.sync_manager) {
            return;
        }
        if let Some(message) = self.answers.pop_front() {
            self.last_answer = message;
            self.fill_mailbox(area);
        }
    }

    /// Writes the last message into the mailbox again, and acknowledges the repeat request by its toggle bit.
    pub(super) fn repeat_last(&mut self) {
        let Some([_, area]) = self.settings.mailbox else { return };
        let at = 0x0806 + 8 * area.sync_manager;
        let toggle = self.controller.memory.u8(at) & 2;
        if !self.last_answer.is_empty() {
            self.fill_mailbox(area);
        }
        self.controller.memory.set(at + 1, &[toggle]);
    }

    /// Writes the last message into the mailbox for answers, and marks it as full.
    fn fill_mailbox(&mut self, area: Area) {
        let to = self.controller.memory.bytes_mut(area.start, usize::from(area.length));
        to.fill(0);
        to.iter_mut().zip(&self.last_answer).for_each(|(to, from)| *to = *from);
        SyncManager::set_full(&mut self.controller.memory, area.sync_manager, true);
    }
}
