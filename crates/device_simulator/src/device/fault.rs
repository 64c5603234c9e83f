//! Faults that can be injected into a device.

use crate::al_status_code::AlStatusCode;
use crate::mailbox::Emergency;
use crate::object_dictionary::{Abort, Key};

/// Fault that can be injected into a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The device ignores this number of frames, so that working counters are too low.
    Deaf(u32),
    /// The device falls back to SAFEOP with this AL status code.
    StateDrop(AlStatusCode),
    /// No SYNC0 pulses.
    SyncMissing,
    /// Additional drift of the device's clock \[ppb\].
    Drift(i64),
    /// The device does not read its mailbox.
    MailboxStuck,
    /// SDO access to this object is aborted with this code.
    SdoAbort(Key, Abort),
    /// The cable at a port (0 or 1) is damaged: one of so many frames is, which is counted, and is lost.
    DamagedCable {
        /// Port.
        port: u8,
        /// Frames of which one is damaged; 0 none.
        one_of: u32,
    },
    /// The device sends this emergency message.
    Emergency(Emergency),
}
