//! Faults that can be injected into a device.

use crate::al_status_code::AlStatusCode;
use crate::mailbox::Emergency;
use crate::object_dictionary::{Abort, Key};

/// A fault of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// It does not take part in so many frames: working counters are too low.
    Deaf(u32),
    /// It falls back to SAFEOP, with a reason.
    StateDrop(AlStatusCode),
    /// SYNC0 stays away.
    SyncMissing,
    /// Its clock runs faster by so many ppb than it did.
    Drift(i64),
    /// The mailbox is not read.
    MailboxStuck,
    /// An SDO of a key is refused.
    SdoAbort(Key, Abort),
    /// The cable at a port (0 or 1) is damaged: one of so many frames is, which is counted, and is lost.
    DamagedCable {
        /// Port.
        port: u8,
        /// Frames of which one is damaged; 0 none.
        one_of: u32,
    },
    /// An emergency is sent.
    Emergency(Emergency),
}
