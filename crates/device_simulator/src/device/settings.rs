//! Settings of a device: identity, memory layout and synchronisation.

/// Identity of a device, as in object 0x1018 and in words 8 to 15 of the EEPROM.
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

/// Part of the process memory that belongs to a sync manager.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Area {
    /// Number of the sync manager.
    pub sync_manager: u16,
    /// First address in the process memory.
    pub start: u16,
    /// Length \[byte\]; for process data the largest length.
    pub length: u16,
}

/// Synchronisation capabilities and requirements of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Synchronisation {
    /// Whether it supports free run, without SYNC0.
    pub supports_free_run: bool,
    /// Whether it supports SYNC0.
    pub has_sync0: bool,
    /// Whether it supports SYNC1 in addition.
    pub has_sync1: bool,
    /// Base cycle time \[ns\]: shortest SYNC0 cycle, of which longer ones are multiples.
    pub base_cycle: u32,
    /// Set-up time \[ns\]: outputs must arrive this long before SYNC0.
    pub set_up_time: u64,
    /// Limit of the counter of missed cycles, beyond which the device leaves OP. A missed cycle adds three, a good
    /// one subtracts one (as object 0x10F1:02 of many drives).
    pub missed_limit: u32,
    /// Time for which the device waits in SAFEOP for SYNC0 and outputs until it refuses OP \[ns\], with the AL status
    /// code 0x002D or 0x0019.
    pub op_timeout: u64,
}

impl Default for Synchronisation {
    /// Free run only.
    fn default() -> Self {
        Self {
            supports_free_run: true,
            has_sync0: false,
            has_sync1: false,
            base_cycle: 250_000,
            set_up_time: 20_000,
            missed_limit: 4,
            op_timeout: 200_000_000,
        }
    }
}

/// Settings of a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Name of the device, at most 30 ASCII characters.
    pub name: String,
    /// Identity.
    pub identity: Identity,
    /// Version of the software (0x100A), at most 64 ASCII characters.
    pub software: String,
    /// Mailbox areas for requests and answers; `None` for a device without CoE.
    pub mailbox: Option<[Area; 2]>,
    /// Area of output data, from the main device; `None` without outputs.
    pub outputs: Option<Area>,
    /// Area of input data, to the main device; `None` without inputs.
    pub inputs: Option<Area>,
    /// Synchronisation capabilities and requirements.
    pub synchronisation: Synchronisation,
    /// Longest process-data watchdog time with which it enters SAFEOP \[ns\]; a watchdog is then required. `None`:
    /// any time, or no watchdog.
    pub longest_watchdog: Option<u64>,
    /// Time from a mailbox request to its answer \[ns\].
    pub mailbox_time: u64,
    /// Time from the request of a state until it is entered or refused \[ns\].
    pub state_change_time: u64,
    /// Device emulation: the controller acknowledges requested states by itself, as in devices without an
    /// application.
    pub has_device_emulation: bool,
}

impl Settings {
    /// Settings with a name and an identity, without mailbox and process data. By default a mailbox
    /// request takes 0.3 ms and a state change 1 ms, and the software is version 1.0.
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
            has_device_emulation: false,
        }
    }

    /// Adds mailboxes of 128 bytes at 0x1000 and 0x1080, and process data of up to 64 bytes at 0x1100 and 0x1180.
    pub fn with_mailbox(mut self) -> Self {
        let area = |sync_manager, start, length| Area { sync_manager, start, length };
        self.mailbox = Some([area(0, 0x1000, 128), area(1, 0x1080, 128)]);
        self.outputs = Some(area(2, 0x1100, 64));
        self.inputs = Some(area(3, 0x1180, 64));
        self
    }
}

/// Control bytes (0x0804 + 8 n) of the sync managers of mailboxes: requests, answers.
pub const MAILBOX_CONTROL: [u8; 2] = [0x26, 0x22];
/// Control bytes of the sync managers of process data: outputs (with the watchdog), inputs.
pub const PROCESS_DATA_CONTROL: [u8; 2] = [0x64, 0x20];
/// Mask of the control byte for mode and direction.
pub const MODE_AND_DIRECTION: u8 = 0x0f;
