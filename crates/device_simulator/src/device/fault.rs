//! Faults that can be injected into a device.

use crate::al_status_code::AlStatusCode;
use crate::mailbox::Emergency;
use crate::object_dictionary::{Abort, Key};

/// Fault that can be injected into a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The device ignores this number of frames, so that working counters are too low.
    FramesIgnored(u32),
    /// The device falls back to SAFEOP with this AL status code.
    StateDrop(AlStatusCode),
    /// No SYNC0 pulses.
    Sync0Missing,
    /// Additional drift of the device's clock \[ppb\].
    Drift(i64),
    /// The device does not read its mailbox, which stays full.
    MailboxNotServed,
    /// SDO access to this object is aborted with this code.
    SdoAbort(Key, Abort),
    /// The cable at a port (0 or 1) damages frames at regular intervals; each is counted as an error, and lost.
    DamagedCable {
        /// Port.
        port: u8,
        /// Number of frames of which the last is damaged; 0 for no damage.
        frames_per_error: u32,
    },
    /// The device sends this emergency message.
    Emergency(Emergency),
}
