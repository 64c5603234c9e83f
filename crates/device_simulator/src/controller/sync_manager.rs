//! Sync managers (ETG.1000.4): memory that main device and application share, as a mailbox or as a buffer that is
//! always free.

use super::memory::Memory;
use super::registers::SYNC_MANAGER;

/// Number of sync managers of a controller.
pub const COUNT: u16 = 4;

/// Sync manager: memory shared by main device and application, as its eight registers state it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SyncManager {
    /// First address of its memory.
    pub start: u16,
    /// Length of its memory \[byte\].
    pub length: u16,
    /// Control byte: mode, direction, interrupts and watchdog trigger.
    pub control: u8,
    /// Whether it is enabled.
    pub is_enabled: bool,
}

/// Bit of the status that says that a mailbox is full.
const FULL: u8 = 0x08;

impl SyncManager {
    /// Sync manager by its number, as its registers state it.
    pub fn of(memory: &Memory, number: u16) -> Self {
        let at = SYNC_MANAGER + 8 * number;
        Self {
            start: memory.u16(at),
            length: memory.u16(at + 2),
            control: memory.u8(at + 4),
            is_enabled: memory.u8(at + 6) & 1 != 0,
        }
    }

    /// Whether it is in mailbox mode (bits 0 and 1 of its control byte); else in buffer mode.
    pub fn is_mailbox(&self) -> bool {
        self.control & 0x03 == 0x02
    }

    /// Whether its direction is from main device to application.
    pub fn is_written_by_main_device(&self) -> bool {
        self.control & 0x0c == 0x04
    }

    /// Whether writes to it trigger the process-data watchdog (bit 6 of its control byte).
    pub fn triggers_watchdog(&self) -> bool {
        self.control & 0x40 != 0
    }

    /// Whether an access of `length` \[byte\] at `address` overlaps its memory, while it is enabled.
    pub fn overlaps(&self, address: u16, length: usize) -> bool {
        let (a, b) = (usize::from(self.start), usize::from(self.start) + usize::from(self.length));
        let first = usize::from(address);
        self.is_enabled && self.length > 0 && first < b && first + length > a
    }

    /// Whether an access of `length` \[byte\] at `address` includes its last byte, which completes the exchange.
    pub fn is_completed_by(&self, address: u16, length: usize) -> bool {
        let last = usize::from(self.start) + usize::from(self.length);
        self.overlaps(address, length) && usize::from(address) + length >= last
    }

    /// Whether the mailbox of this sync manager number is full.
    pub fn is_full(memory: &Memory, number: u16) -> bool {
        memory.u8(SYNC_MANAGER + 8 * number + 5) & FULL != 0
    }

    /// Marks the mailbox of this sync manager number as full or empty.
    pub fn set_full(memory: &mut Memory, number: u16, full: bool) {
        let at = SYNC_MANAGER + 8 * number + 5;
        let status = memory.u8(at);
        memory.set(at, &[if full { status | FULL } else { status & !FULL }]);
    }
}
