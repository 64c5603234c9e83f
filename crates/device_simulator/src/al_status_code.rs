//! AL status codes, register 0x0134: reasons why a device refused or left a state (ETG.1000.6, ETG.1020).

/// A code of register 0x0134, with the sentence that belongs to it.
macro_rules! codes {
    ($($name:ident = $code:literal, $text:literal;)*) => {
        /// AL status code: reason why a device refused or left a state (ETG.1000.6, table of AL status codes).
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum AlStatusCode {
            $(#[doc = $text] $name = $code,)*
        }

        impl AlStatusCode {
            /// All codes, in ascending order.
            pub const ALL: &[Self] = &[$(Self::$name),*];

            /// Reason as text, without a final stop.
            pub fn text(self) -> &'static str {
                match self { $(Self::$name => $text,)* }
            }
        }
    };
}

codes! {
    NoError = 0x0000, "no error";
    Unspecified = 0x0001, "unspecified error";
    NoMemory = 0x0002, "no memory left for local application data";
    InvalidDeviceSetup = 0x0003, "set-up of the device is invalid";
    InvalidStateChange = 0x0011, "the requested change of state is not allowed";
    UnknownState = 0x0012, "the requested state is not known";
    BootstrapNotSupported = 0x0013, "bootstrap is not supported";
    NoValidFirmware = 0x0014, "there is no valid firmware";
    InvalidBootMailbox = 0x0015, "mailbox configuration is invalid in bootstrap";
    InvalidMailbox = 0x0016, "mailbox configuration is invalid in PREOP";
    InvalidSyncManager = 0x0017, "sync manager configuration is invalid";
    NoValidInputs = 0x0018, "there are no valid inputs";
    NoValidOutputs = 0x0019, "there are no valid outputs";
    SynchronisationError = 0x001a, "synchronisation of outputs and SYNC0 lost";
    SyncManagerWatchdog = 0x001b, "process-data watchdog: no outputs came within its time";
    InvalidSyncManagerTypes = 0x001c, "types of sync managers are invalid";
    InvalidOutputConfiguration = 0x001d, "outputs: sync manager does not fit the mapped process data";
    InvalidInputConfiguration = 0x001e, "inputs: sync manager does not fit the mapped process data";
    InvalidWatchdog = 0x001f, "watchdog configuration is invalid";
    NeedsColdStart = 0x0020, "the device needs a cold start";
    NeedsInit = 0x0021, "the device has to go to INIT";
    NeedsPreOp = 0x0022, "the device has to go to PREOP";
    NeedsSafeOp = 0x0023, "the device has to go to SAFEOP";
    InvalidInputMapping = 0x0024, "input mapping is invalid";
    InvalidOutputMapping = 0x0025, "output mapping is invalid";
    InconsistentSettings = 0x0026, "settings contradict each other";
    FreeRunNotSupported = 0x0027, "free run is not supported";
    SynchronisationNotSupported = 0x0028, "synchronisation is not supported";
    FreeRunNeedsThreeBuffers = 0x0029, "free run needs the mode of three buffers";
    BackgroundWatchdog = 0x002a, "watchdog of the application";
    NoValidInputsAndOutputs = 0x002b, "there are no valid inputs and outputs";
    FatalSynchronisationError = 0x002c, "SYNC0 is no longer received";
    NoSynchronisation = 0x002d, "no SYNC0 was received";
    CycleTooShort = 0x002e, "the cycle is too short";
    InvalidSyncConfiguration = 0x0030, "configuration of SYNC is invalid";
    InvalidLatchConfiguration = 0x0031, "configuration of the latch is invalid";
    PllError = 0x0032, "PLL error: the frames are not synchronised to the SYNC events";
    SyncInputOutputError = 0x0033, "several synchronisation errors at once";
    SyncTimeout = 0x0034, "too many output frames (SM events) were missed";
    InvalidSyncCycle = 0x0035, "the cycle of the synchronisation is invalid";
    InvalidSync0Cycle = 0x0036, "the cycle of SYNC0 is invalid";
    InvalidSync1Cycle = 0x0037, "the cycle of SYNC1 is invalid";
    MailboxAoe = 0x0041, "mailbox error: AoE";
    MailboxEoe = 0x0042, "mailbox error: EoE";
    MailboxCoe = 0x0043, "mailbox error: CoE";
    MailboxFoe = 0x0044, "mailbox error: FoE";
    MailboxSoe = 0x0045, "mailbox error: SoE";
    MailboxVoe = 0x004f, "mailbox error: VoE";
    EepromNoAccess = 0x0050, "the EEPROM is not assigned to the application";
    EepromError = 0x0051, "EEPROM access failed";
    RestartedLocally = 0x0060, "the device restarted by itself";
    IdentificationUpdated = 0x0061, "the identification value was updated";
    ControllerNotAvailable = 0x00f0, "the application's controller is not available";
}
