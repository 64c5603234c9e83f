//! EtherCAT device controller: registers, memory, FMMUs, sync managers, distributed clock and watchdog (ETG.1000.4,
//! IEC 61158-4-12).

mod distributed_clock;
mod eeprom;
mod fmmu;
mod memory;
pub mod registers;
mod sync_manager;
mod watchdog;

pub use distributed_clock::DistributedClock;
pub use eeprom::Eeprom;
pub use memory::Memory;
pub use sync_manager::SyncManager;
pub use watchdog::Watchdog;

use crate::frame::Access;
use fmmu::{Fmmu, copy_bits};
use registers::{
    AL_CONTROL, AL_STATUS, DATA_LINK_STATUS, EEPROM, ERROR_COUNTERS, FEATURES, INFORMATION,
    PROCESS_MEMORY, RECEIVE_TIME, STATION_ADDRESS, SYNC_ACTIVATION, SYNC_MANAGER, SYSTEM_TIME,
    WATCHDOG_DIVIDER, WATCHDOG_PROCESS_DATA, WATCHDOG_STATUS,
};

/// EtherCAT device controller: registers, memory, distributed clock, watchdog and EEPROM of one device.
#[derive(Clone, Debug)]
pub struct Controller {
    /// Registers and process memory.
    pub memory: Memory,
    /// Distributed clock.
    pub clock: DistributedClock,
    /// EEPROM.
    pub eeprom: Eeprom,
    /// Process-data watchdog.
    pub watchdog: Watchdog,
    /// Bus times at which the frame that is under way passes the ports \[ns\]; none for an unused port.
    pub(crate) ports: [Option<u64>; 4],
    /// Events since the application took them last.
    events: Vec<Event>,
}

/// Events for the application.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Event {
    /// AL control (0x0120) was written: its low byte.
    AlControlWritten(u8),
    /// The mailbox for requests was written completely.
    MailboxWritten,
    /// The mailbox for answers was read completely.
    MailboxRead,
    /// The repeat request of the mailbox for answers was toggled.
    RepeatRequest,
    /// Outputs were written completely.
    OutputsWritten,
}

/// Units of 40 ns in 100 us, less two: divider of the watchdogs after power-on.
const DEFAULT_DIVIDER: u16 = 2498;
/// 100 ms in units of the divider, after power-on.
const DEFAULT_WATCHDOG: u16 = 1000;

/// Bit of the features (0x0008): a distributed clock.
const HAS_CLOCK: u8 = 0x04;
/// Registers of a distributed clock, from 0x0900 on \[byte\].
const CLOCK: usize = 0x100;

impl Controller {
    /// Controller after power-on, with this clock and EEPROM.
    pub fn new(clock: DistributedClock, eeprom: Eeprom) -> Self {
        let mut memory = Memory::default();
        // 16 FMMUs, four sync managers, 8 KiB, ports 0 and 1 by MII, clocks of 64 bit
        memory.set(INFORMATION, &[0x11, 0, 2, 0, 16, 4, 8, 0x0f, 0x0c, 0]);
        memory.set(AL_STATUS, &[1]);
        memory.set(WATCHDOG_DIVIDER, &DEFAULT_DIVIDER.to_le_bytes());
        memory.set(WATCHDOG_PROCESS_DATA, &DEFAULT_WATCHDOG.to_le_bytes());
        memory.set(WATCHDOG_STATUS, &[1]);
        memory.set(EEPROM + 2, &[0x40]);
        let watchdog = Watchdog::default();
        Self { memory, clock, eeprom, watchdog, ports: [None; 4], events: Vec::new() }
    }

    /// Configured station address, register 0x0010; 0 before it is set.
    pub fn station_address(&self) -> u16 {
        self.memory.u16(STATION_ADDRESS)
    }

    /// Writes the data link status (0x0110): port 0 has a link, port 1 where a device follows.
    pub(crate) fn set_links(&mut self, is_last: bool) {
        let status: u16 = if is_last { 0x5610 | 1 } else { 0x5a30 | 1 };
        // an open port communicates, a port without a partner is closed
        self.memory.set(DATA_LINK_STATUS, &status.to_le_bytes());
    }

    /// Counts a damaged frame that came by a port: as an invalid frame, and as an error of the receiver. Counters stop
    /// at 255.
    pub(crate) fn count_damaged_frame(&mut self, port: u8) {
        for counter in [0, 1] {
            let register = ERROR_COUNTERS + 2 * u16::from(port.min(3)) + counter;
            let count = self.memory.u8(register).saturating_add(1);
            self.memory.set(register, &[count]);
        }
    }

    /// Counts a damaged frame that another device has counted, marked and passed on, at a port: as forwarded only.
    pub(crate) fn count_forwarded_frame(&mut self, port: u8) {
        let register = ERROR_COUNTERS + 8 + u16::from(port.min(3));
        let count = self.memory.u8(register).saturating_add(1);
        self.memory.set(register, &[count]);
    }

    /// Takes out the events for the application.
    pub(crate) fn take_events(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.events)
    }

    /// Whether all of a range exists, `length` in bytes: without a clock its registers do not.
    fn has(&self, address: u16, length: usize) -> bool {
        let has_clock = self.memory.u8(FEATURES) & HAS_CLOCK != 0;
        self.memory.has(address, length)
            && (has_clock || !overlaps(address, length, RECEIVE_TIME, CLOCK))
    }

    /// Reads memory for the main device at the time `now` \[ns\]. Returns false if the read is refused, as of an
    /// empty mailbox.
    pub fn read(&mut self, address: u16, into: &mut [u8], now: u64) -> bool {
        let length = into.len();
        if !self.has(address, length) {
            return false;
        }
        if overlaps(address, length, SYSTEM_TIME, 16) || overlaps(address, length, 0x0990, 8) {
            self.clock.update_registers(&mut self.memory, now);
        }
        let mut emptied = None;
        if address >= PROCESS_MEMORY {
            for number in 0..sync_manager::COUNT {
                let manager = SyncManager::of(&self.memory, number);
                if !manager.overlaps(address, length) || !manager.is_mailbox() {
                    continue;
                }
                let is_ready = SyncManager::is_full(&self.memory, number);
                if manager.is_written_by_main_device() || !is_ready {
                    return false;
                }
                emptied = manager.is_completed_by(address, length).then_some(number);
            }
        }
        into.copy_from_slice(self.memory.bytes(address, length));
        if let Some(number) = emptied {
            SyncManager::set_full(&mut self.memory, number, false);
            self.events.push(Event::MailboxRead);
        }
        true
    }

    /// Writes memory for the main device at the time `now` \[ns\]. Returns false if the write is refused, as to a
    /// full mailbox.
    pub fn write(&mut self, address: u16, from: &[u8], now: u64) -> bool {
        let length = from.len();
        if !self.has(address, length) {
            return false;
        }
        if address < PROCESS_MEMORY {
            self.write_registers(address, from, now);
            return true;
        }
        let mut completed = None;
        for number in 0..sync_manager::COUNT {
            let manager = SyncManager::of(&self.memory, number);
            if !manager.overlaps(address, length) {
                continue;
            }
            let is_full = manager.is_mailbox() && SyncManager::is_full(&self.memory, number);
            if !manager.is_written_by_main_device() || is_full {
                return false;
            }
            completed = manager.is_completed_by(address, length).then_some((number, manager));
        }
        self.memory.set(address, from);
        match completed {
            Some((number, manager)) if manager.is_mailbox() => {
                SyncManager::set_full(&mut self.memory, number, true);
                self.events.push(Event::MailboxWritten);
            }
            Some((_, manager)) => {
                if manager.triggers_watchdog() {
                    self.watchdog.trigger(&mut self.memory, now);
                }
                self.events.push(Event::OutputsWritten);
            }
            None => {}
        }
        true
    }

    /// Writes registers, with their effects: clocks latch and follow, the EEPROM executes, a state is requested.
    fn write_registers(&mut self, address: u16, from: &[u8], now: u64) {
        let length = from.len();
        let repeat = self.memory.u8(SYNC_MANAGER + 8 + 6) & 2;
        self.memory.write(address, from);
        let is_written = |register, bytes| overlaps(address, length, register, bytes);
        if is_written(RECEIVE_TIME, 1) {
            self.clock.latch(&mut self.memory, self.ports);
        }
        if is_written(SYSTEM_TIME, 1) {
            self.clock.correct(&mut self.memory, from, now);
        }
        if is_written(SYNC_ACTIVATION, 1) {
            self.clock.activate(&self.memory, now);
        }
        if is_written(EEPROM + 3, 1) {
            self.eeprom.execute(&mut self.memory);
        }
        if is_written(AL_CONTROL, 1) {
            self.events.push(Event::AlControlWritten(self.memory.u8(AL_CONTROL)));
        }
        for number in 0..sync_manager::COUNT {
            let activation = SYNC_MANAGER + 8 * number + 6;
            if is_written(activation, 1) && self.memory.u8(activation) & 1 == 0 {
                SyncManager::set_full(&mut self.memory, number, false);
            }
        }
        if self.memory.u8(SYNC_MANAGER + 8 + 6) & 2 != repeat {
            self.events.push(Event::RepeatRequest);
        }
    }

    /// Executes a datagram with a logical address through the FMMUs, at the time `now` \[ns\]. Returns the increment
    /// of its working counter: 1 for a read, 1 for a write, 2 for the write of a read-write, 0 without an FMMU.
    pub fn logical(&mut self, address: u32, access: Access, data: &mut [u8], now: u64) -> u16 {
        let (mut was_read, mut was_written) = (false, false);
        let units: Vec<Fmmu> =
            (0..fmmu::UNITS).filter_map(|number| Fmmu::of(&self.memory, number)).collect();
        let sent = data.to_vec();
        for unit in &units {
            let Some(overlap) = unit.overlap(address, data.len()) else { continue };
            let first = (overlap.in_memory / 8) as u16;
            let bit = overlap.in_memory % 8;
            let mut bytes = self.memory.bytes(first, (bit + overlap.bits).div_ceil(8)).to_vec();
            if access.writes() && unit.writes {
                copy_bits(&mut bytes, bit, &sent, overlap.in_data, overlap.bits);
                was_written |= self.write(first, &bytes, now);
            }
            if access.reads() && unit.reads && self.read(first, &mut bytes, now) {
                copy_bits(data, overlap.in_data, &bytes, bit, overlap.bits);
                was_read = true;
            }
        }
        let write_increment = if access == Access::ReadWrite { 2 } else { 1 };
        u16::from(was_read) + if was_written { write_increment } else { 0 }
    }
}

/// Whether two ranges of the memory, each with an address and a length \[byte\], share a byte.
fn overlaps(address: u16, length: usize, register: u16, bytes: usize) -> bool {
    let (a, b) = (usize::from(address), usize::from(register));
    a < b + bytes && b < a + length
}
