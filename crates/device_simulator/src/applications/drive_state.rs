//! State machine of a drive (CiA 402, IEC 61800-7-201): controlword in, statusword out.

/// State of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveState {
    /// Not ready, or switched off.
    SwitchOnDisabled,
    /// Power may be switched on.
    ReadyToSwitchOn,
    /// Power is on, no torque.
    SwitchedOn,
    /// The motor follows its set point.
    OperationEnabled,
    /// The motor is stopped quickly.
    QuickStopActive,
    /// A fault is there, the motor is stopped.
    FaultReactionActive,
    /// A fault is there, no torque.
    Fault,
}

impl DriveState {
    /// Its bits of the statusword: 0 to 3, 5 and 6, and 4 for power.
    pub fn status_bits(self) -> u16 {
        match self {
            Self::SwitchOnDisabled => 0x0040,
            Self::ReadyToSwitchOn => 0x0021,
            Self::SwitchedOn => 0x0033,
            Self::OperationEnabled => 0x0037,
            Self::QuickStopActive => 0x0017,
            Self::FaultReactionActive => 0x001f,
            Self::Fault => 0x0008,
        }
    }

    /// Whether the motor has torque.
    pub fn has_torque(self) -> bool {
        matches!(self, Self::OperationEnabled | Self::QuickStopActive | Self::FaultReactionActive)
    }

    /// The next state by a controlword; a fault is reset by a rising bit 7.
    pub fn by_controlword(self, word: u16, before: u16) -> Self {
        use DriveState::{
            Fault, FaultReactionActive, OperationEnabled, QuickStopActive, ReadyToSwitchOn,
            SwitchOnDisabled, SwitchedOn,
        };
        let is_reset = word & 0x80 != 0 && before & 0x80 == 0;
        let has_voltage = word & 0x02 != 0;
        let is_quick_stop = word & 0x04 == 0;
        match (self, word & 0x0f) {
            (Fault, _) => {
                if is_reset {
                    SwitchOnDisabled
                } else {
                    Fault
                }
            }
            (FaultReactionActive, _) => FaultReactionActive,
            _ if !has_voltage => SwitchOnDisabled,
            (OperationEnabled, _) if is_quick_stop => QuickStopActive,
            (QuickStopActive, _) => QuickStopActive,
            _ if is_quick_stop => SwitchOnDisabled,
            (SwitchOnDisabled, 0x06 | 0x0e) => ReadyToSwitchOn,
            (ReadyToSwitchOn, 0x07) => SwitchedOn,
            // switched on and enabled at once
            (ReadyToSwitchOn, 0x0f) => SwitchedOn,
            (SwitchedOn, 0x0f) => OperationEnabled,
            (SwitchedOn | OperationEnabled, 0x06 | 0x0e) => ReadyToSwitchOn,
            (OperationEnabled, 0x07) => SwitchedOn,
            (state, _) => state,
        }
    }
}
