//! What a cycle of the bus showed, for its log.

use crate::fault::Fault;
use crate::start_up::MOST_DEVICES;
use ethercrab::SubDeviceState;
use hydroboom_control::measurement::AXES;

/// One cycle of the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CycleRecord {
    /// Number of the newest measurement.
    pub measurement: u64,
    /// SYNC0 of the cycle, by this computer's clock and by the devices' \[ns\].
    pub sync0: [u64; 2],
    /// Exchanges: one or two.
    pub exchanges: [Exchange; 2],
    /// State of each device, as it came last: 1 INIT, 2 PREOP, 4 SAFEOP, 8 OP, 0 where it did not answer.
    pub states: [u8; MOST_DEVICES],
    /// Statusword and error code (0x603F, 0 where the drive does not show it) of each drive.
    pub drives: [[u16; 2]; AXES],
    /// The fault that stopped the machine.
    pub fault: Option<Fault>,
}

/// One exchange.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Exchange {
    /// When it passed the reference clock, after the SYNC0 before \[ns\]; none where it was lost.
    pub phase: Option<u32>,
    /// Its working counter; none where it was lost.
    pub working_counter: Option<u16>,
}

/// The number of a state.
pub(crate) fn number(state: SubDeviceState) -> u8 {
    match state {
        SubDeviceState::None => 0,
        SubDeviceState::Init => 1,
        SubDeviceState::PreOp => 2,
        SubDeviceState::Bootstrap => 3,
        SubDeviceState::SafeOp => 4,
        SubDeviceState::Op => 8,
        SubDeviceState::Other(number) => number,
    }
}
