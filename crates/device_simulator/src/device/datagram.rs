//! Passage of a datagram: addressing, access to the controller's memory, and the events that follow.

use super::Device;
use crate::controller::Event;
use crate::frame::{Access, Command, Datagram};

impl Device {
    /// Executes a datagram that passes at the time `now` \[ns\], by its addressing mode, and handles what it caused.
    pub(crate) fn process_datagram(&mut self, mut datagram: Datagram<'_>, now: u64) {
        let is_at_position = |d: &Datagram<'_>| d.device() == 0;
        let has_station_address =
            |d: &Datagram<'_>| d.device() == self.controller.station_address();
        match datagram.command {
            Command::Nop => {}
            Command::Position(access) => {
                if is_at_position(&datagram) {
                    self.access(access, &mut datagram, false, now);
                }
                datagram.increment_position();
            }
            Command::Station(access) if has_station_address(&datagram) => {
                self.access(access, &mut datagram, false, now);
            }
            Command::Station(_) => {}
            Command::Broadcast(access) => {
                self.access(access, &mut datagram, true, now);
                datagram.increment_position();
            }
            Command::Logical(access) => {
                let address = datagram.logical();
                let count = self.controller.logical(address, access, datagram.data, now);
                datagram.increment_working_counter(count);
            }
            Command::PositionReadMultipleWrite => {
                let access = if is_at_position(&datagram) { Access::Read } else { Access::Write };
                self.access(access, &mut datagram, false, now);
                datagram.increment_position();
            }
            Command::StationReadMultipleWrite => {
                let access =
                    if has_station_address(&datagram) { Access::Read } else { Access::Write };
                self.access(access, &mut datagram, false, now);
            }
        }
        self.handle_events(now);
    }

    /// Executes an access to physical memory, and increments the working counter: 1 for a read, 1 for a write, 2 for
    /// the write of a read-write. `or` adds what is read to the bits in the frame, as broadcast reads do.
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
        let write_increment = if access == Access::ReadWrite { 2 } else { 1 };
        datagram.increment_working_counter(
            u16::from(was_read) + if was_written { write_increment } else { 0 },
        );
    }

    /// Handles the events that a datagram has caused: requests become due after the times of the settings.
    fn handle_events(&mut self, now: u64) {
        for event in self.controller.take_events() {
            match event {
                Event::AlControlWritten(byte) => {
                    self.requested = Some((now + self.settings.state_change_time, byte));
                }
                Event::MailboxWritten => self.answer_due = Some(now + self.settings.mailbox_time),
                Event::MailboxRead => self.fill_with_next(),
                Event::RepeatRequest => self.repeat_last(),
                Event::OutputsWritten => self.outputs_written(now),
            }
        }
    }
}
