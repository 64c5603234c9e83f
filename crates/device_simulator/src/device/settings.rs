//! What a device is: identity, memory layout, and what it asks of synchronisation.

/// Identity, as in object 0x1018 and in the EEPROM.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// Vendor ID.
    pub vendor: u32,
    /// Product code.
    pub product: u32,
    /// Revision number.
    pub revision: u32,
    /// Serial number.
    pub serial: u32,
}

/// Part of the process memory that a sync manager shares.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Area {
    /// Number of the sync manager.
    pub sync_manager: u16,
    /// First byte.
    pub start: u16,
    /// Bytes: of a mailbox all, of process data the most there may be.
    pub length: u16,
}

/// What a device asks of synchronisation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Synchronisation {
    /// Whether it works without SYNC0.
    pub may_run_free: bool,
    /// Whether SYNC0 can be used.
    pub has_sync0: bool,
    /// Whether SYNC1 can be used beside it.
    pub has_sync1: bool,
    /// Shortest cycle of SYNC0, of which a longer one is a multiple \[ns\].
    pub base_cycle: u32,
    /// Time before SYNC0 by which outputs have to be there \[ns\].
    pub set_up: u64,
    /// Missed cycles beyond which it stops; a missed one counts three, a good one takes one back (as object 0x10F1:02 of many drives).
    pub missed_limit: u32,
    /// How long SAFEOP waits for SYNC0 and outputs before OP is refused \[ns\].
    pub patience: u64,
}

impl Default for Synchronisation {
    /// Free run only.
    fn default() -> Self {
        Self {
            may_run_free: true,
            has_sync0: false,
            has_sync1: false,
            base_cycle: 250_000,
            set_up: 20_000,
            missed_limit: 4,
            patience: 200_000_000,
        }
    }
}

/// What a device is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Name, at most 30 ASCII characters.
    pub name: String,
    /// Identity.
    pub identity: Identity,
    /// Version of its software (0x100A), at most 64 ASCII characters.
    pub software: String,
    /// Mailboxes for requests and answers; none for a device without CoE.
    pub mailbox: Option<[Area; 2]>,
    /// Outputs, from the main device; none where there are none.
    pub outputs: Option<Area>,
    /// Inputs, to the main device.
    pub inputs: Option<Area>,
    /// What it asks of synchronisation.
    pub synchronisation: Synchronisation,
    /// Longest process-data watchdog \[ns\] that it goes into SAFEOP with, where one is wanted; none where it takes any, and none at all.
    pub longest_watchdog: Option<u64>,
    /// Time until the mailbox is answered \[ns\].
    pub mailbox_time: u64,
    /// Time until a requested state is entered or refused \[ns\].
    pub state_change_time: u64,
    /// Whether the controller itself follows the requested state, as in devices without an application of their own.
    pub is_emulated: bool,
}

impl Settings {
    /// A device with a name and an identity, without mailbox and process data.
    pub fn new(name: &str, identity: Identity) -> Self {
        Self {
            name: name.into(),
            identity,
            software: "1.0".into(),
            mailbox: None,
            outputs: None,
            inputs: None,
            synchronisation: Synchronisation::default(),
            longest_watchdog: None,
            mailbox_time: 300_000,
            state_change_time: 1_000_000,
            is_emulated: false,
        }
    }

    /// With mailboxes of 128 bytes at 0x1000 and 0x1080, and process data of up to 64 bytes at 0x1100 and 0x1180.
    pub fn with_mailbox(mut self) -> Self {
        let area = |sync_manager, start, length| Area { sync_manager, start, length };
        self.mailbox = Some([area(0, 0x1000, 128), area(1, 0x1080, 128)]);
        self.outputs = Some(area(2, 0x1100, 64));
        self.inputs = Some(area(3, 0x1180, 64));
        self
    }
}

/// Control byte of a sync manager for a mailbox, by direction.
pub const MAILBOX_CONTROL: [u8; 2] = [0x26, 0x22];
/// Control byte of a sync manager for outputs, with the watchdog, and for inputs.
pub const PROCESS_DATA_CONTROL: [u8; 2] = [0x64, 0x20];
/// Bits of a control byte that state mode and direction.
pub const MODE_AND_DIRECTION: u8 = 0x0f;
