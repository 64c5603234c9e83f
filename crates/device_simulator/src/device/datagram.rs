//! Passage of a datagram: addressing, access to the controller's memory, and the events that follow.

use super::Device;
use crate::controller::Event;
use crate::frame::{Access, Command, Datagram};

impl Device {
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
}
