//! Drives by CiA 402 (IEC 61800-7-201) in cyclic synchronous velocity: states of the power drive system, controlword
//! 0x6040, statusword 0x6041, error codes 0x603F.

/// Mode of operation, objects 0x6060 and 0x6061: cyclic synchronous velocity (csv).
pub const CYCLIC_VELOCITY: i8 = 9;
/// Bit 8 of 0x6502 (supported drive modes): cyclic synchronous velocity.
pub const HAS_CYCLIC_VELOCITY: u32 = 1 << 8;

/// State of the power drive system (finite state automaton of CiA 402), as the statusword 0x6041 codes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveState {
    /// Not ready to switch on: the drive initialises.
    NotReady,
    /// No torque, power may not be switched on.
    SwitchOnDisabled,
    /// No torque, power may be switched on.
    ReadyToSwitchOn,
    /// No torque, power is on.
    SwitchedOn,
    /// The motor follows its target.
    OperationEnabled,
    /// The motor is stopped quickly.
    QuickStopActive,
    /// A fault occurred, and the drive stops the motor.
    FaultReactionActive,
    /// Fault, no torque.
    Fault,
}

impl DriveState {
    /// Decodes bits 0 to 3, 5 and 6 of a statusword. A pattern that CiA 402 does not define counts as not ready.
    pub fn of(statusword: u16) -> Self {
        match (statusword & 0x4f, statusword & 0x6f) {
            (0x00, _) => Self::NotReady,
            (0x40, _) => Self::SwitchOnDisabled,
            (0x0f, _) => Self::FaultReactionActive,
            (0x08, _) => Self::Fault,
            (_, 0x21) => Self::ReadyToSwitchOn,
            (_, 0x23) => Self::SwitchedOn,
            (_, 0x27) => Self::OperationEnabled,
            (_, 0x07) => Self::QuickStopActive,
            _ => Self::NotReady,
        }
    }

    /// Controlword 0x6040 of the next transition towards operation enabled, or away from it: shutdown 0x0006, switch
    /// on 0x0007, enable operation 0x000F, quick stop 0x0002, disable voltage 0x0000. It never resets a fault:
    /// [`FAULT_RESET`] is sent on an operator's request only.
    pub fn controlword(self, is_operation_requested: bool) -> u16 {
        match self {
            Self::NotReady | Self::Fault | Self::FaultReactionActive => 0x0000,
            // quick stop: keeps the deceleration; 0x0000 would be transition 12, and the motor would coast
            Self::QuickStopActive => 0x0002,
            Self::SwitchOnDisabled => 0x0006,
            Self::ReadyToSwitchOn if is_operation_requested => 0x0007,
            Self::SwitchedOn | Self::OperationEnabled if is_operation_requested => 0x000f,
            _ => 0x0006,
        }
    }
}

/// Controlword whose rising bit 7 resets a fault: fault to switch on disabled.
pub const FAULT_RESET: u16 = 0x0080;

/// Bits of the statusword 0x6041 that are monitored beside the state.
pub mod status_bit {
    /// Bit 7, warning.
    pub const WARNING: u16 = 1 << 7;
    /// Bit 9, remote: the controlword is executed.
    pub const REMOTE: u16 = 1 << 9;
    /// Bit 11, internal limit active.
    pub const INTERNAL_LIMIT: u16 = 1 << 11;
    /// Bit 12, in cyclic modes: the drive follows its target.
    pub const FOLLOWS_TARGET: u16 = 1 << 12;
}

/// Text of an error code of 0x603F (CiA 402-2, table of error codes); none for codes that are not common.
pub fn error_text(code: u16) -> Option<&'static str> {
    Some(match code {
        0x2310 | 0x2311 => "continuous over-current at the output",
        0x2320 | 0x2330 | 0x2340 => "short circuit or earth fault at the output",
        0x3110 => "mains over-voltage",
        0x3120 | 0x3130 => "mains under-voltage or a phase is missing",
        0x3210 => "over-voltage of the DC link: check the braking resistor",
        0x3220 => "under-voltage of the DC link: is the power supply on?",
        0x4210 | 0x4310 => "the drive or the motor is too hot",
        0x5112 => "the supply of 24 V is missing",
        0x5440 => "contactor fault",
        0x6320 => "a parameter is wrong",
        0x7121 => "the motor is blocked",
        0x7300 | 0x7305 | 0x7306 | 0x7320 => "encoder fault: check its cable",
        0x7500 | 0x8100 => "communication was lost: no process data arrived",
        0x7510 => "fault of serial interface 1",
        0x8311 => "torque beyond its limit",
        0x8400 | 0x8480 => "the speed deviates from its target by too much",
        0x8500 | 0x8611 => "the position deviates from its target by too much",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_state_is_decoded_from_any_statusword() {
        use DriveState::{
            Fault, FaultReactionActive, NotReady, OperationEnabled, QuickStopActive,
            ReadyToSwitchOn, SwitchOnDisabled, SwitchedOn,
        };
        // CiA 402-2, statusword: x is any
        for (pattern, state) in [
            ("xxxxxxxxx0xx0000", NotReady),
            ("xxxxxxxxx1xx0000", SwitchOnDisabled),
            ("xxxxxxxxx01x0001", ReadyToSwitchOn),
            ("xxxxxxxxx01x0011", SwitchedOn),
            ("xxxxxxxxx01x0111", OperationEnabled),
            ("xxxxxxxxx00x0111", QuickStopActive),
            ("xxxxxxxxx0xx1111", FaultReactionActive),
            ("xxxxxxxxx0xx1000", Fault),
        ] {
            for any in ['0', '1'] {
                let word = pattern.replace('x', &any.to_string());
                let word = u16::from_str_radix(&word, 2).unwrap();
                assert_eq!(DriveState::of(word), state, "{pattern} with {any}");
            }
        }
    }

    #[test]
    fn a_quick_stop_keeps_its_deceleration() {
        // CiA 402-2: bit 1 (enable voltage) is 1, or transition 12 ends it; bit 2 (quick stop) is 0 while it lasts
        for is_operation_requested in [false, true] {
            assert_eq!(DriveState::QuickStopActive.controlword(is_operation_requested), 0x0002);
        }
    }

    #[test]
    fn no_controlword_resets_a_fault_or_enables_without_request() {
        let states = (0..=u16::MAX).map(DriveState::of);
        for (state, requested) in states.flat_map(|state| [(state, false), (state, true)]) {
            let word = state.controlword(requested);
            assert_eq!(word & FAULT_RESET, 0);
            assert!(requested || word & 0x000f != 0x000f);
        }
    }
}
