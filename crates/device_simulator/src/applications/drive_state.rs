//! State machine of a drive (CiA 402, IEC 61800-7-201): controlword in, statusword out.

/// State of a drive's state machine (CiA 402).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveState {
    /// Switch on disabled: not ready, or switched off.
    SwitchOnDisabled,
    /// Ready to switch on: power may be switched on.
    ReadyToSwitchOn,
    /// Switched on: power is on, without torque.
    SwitchedOn,
    /// Operation enabled: the motor follows its set point.
    OperationEnabled,
    /// Quick stop active: the motor is being stopped.
    QuickStopActive,
    /// Fault reaction active: a fault has occurred, the motor is being stopped.
    FaultReactionActive,
    /// Fault: no torque.
    Fault,
}

impl DriveState {
    /// Bits of the statusword 0x6041 for this state: 0 to 3, 5 and 6, and bit 4 for voltage enabled.
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

    /// Whether the motor may have torque in this state: in operation, during a quick stop and a fault reaction.
    pub fn has_torque(self) -> bool {
        matches!(self, Self::OperationEnabled | Self::QuickStopActive | Self::FaultReactionActive)
    }

    /// Next state for a controlword 0x6040; `before` is the controlword before. A rising bit 7 resets a fault. A state
    /// that the word does not leave is kept.
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
