//! Faults that can be injected into a device.

use crate::al_status_code::AlStatusCode;
use crate::mailbox::Emergency;
use crate::object_dictionary::{Abort, Key};

/// A fault of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// It ignores a number of frames: working counters are too low.
    Deaf(u32),
    /// It falls back to SAFEOP, with a reason.
    StateDrop(AlStatusCode),
    /// SYNC0 stays away.
    SyncMissing,
    /// Its clock becomes faster by a number of ppb.
    Drift(i64),
    /// The mailbox is not read.
    MailboxStuck,
    /// An SDO of a key is refused.
    SdoAbort(Key, Abort),
    /// An emergency is sent.
    Emergency(Emergency),
}
