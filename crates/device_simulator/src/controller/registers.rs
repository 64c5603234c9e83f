//! Addresses of a controller's registers, and which of their bytes the main device may write.

/// Type, revision, build, number of FMMUs and sync managers, memory, ports, features.
pub const INFORMATION: u16 = 0x0000;
/// Features: bit 2, a distributed clock; bit 3, one of 64 bit.
pub const FEATURES: u16 = 0x0008;
/// Configured station address.
pub const STATION_ADDRESS: u16 = 0x0010;
/// Configured station alias.
pub const STATION_ALIAS: u16 = 0x0012;
/// Data link control.
pub const DATA_LINK_CONTROL: u16 = 0x0100;
/// Data link status: links and loops of the ports.
pub const DATA_LINK_STATUS: u16 = 0x0110;
/// Requested state, with the bit that acknowledges an error.
pub const AL_CONTROL: u16 = 0x0120;
/// State, with the bit of an error.
pub const AL_STATUS: u16 = 0x0130;
/// Reason of the error.
pub const AL_STATUS_CODE: u16 = 0x0134;
/// Interface to the application.
pub const PDI_CONTROL: u16 = 0x0140;
/// Errors per port, lost links.
pub const ERROR_COUNTERS: u16 = 0x0300;
/// Watchdog divider, in units of 40 ns, less two.
pub const WATCHDOG_DIVIDER: u16 = 0x0400;
/// Process-data watchdog, in units of the divider.
pub const WATCHDOG_PROCESS_DATA: u16 = 0x0420;
/// 1 while the process-data watchdog has not expired.
pub const WATCHDOG_STATUS: u16 = 0x0440;
/// How often it has expired.
pub const WATCHDOG_COUNTER: u16 = 0x0442;
/// Access to the EEPROM, then control and status, address, data.
pub const EEPROM: u16 = 0x0500;
/// Fieldbus memory management units, 16 bytes each.
pub const FMMU: u16 = 0x0600;
/// Sync managers, 8 bytes each.
pub const SYNC_MANAGER: u16 = 0x0800;
/// Receive times of the ports.
pub const RECEIVE_TIME: u16 = 0x0900;
/// System time.
pub const SYSTEM_TIME: u16 = 0x0910;
/// Receive time at the processing unit.
pub const RECEIVE_TIME_UNIT: u16 = 0x0918;
/// Offset of the system time from the local time.
pub const SYSTEM_TIME_OFFSET: u16 = 0x0920;
/// Delay from the reference clock.
pub const SYSTEM_TIME_DELAY: u16 = 0x0928;
/// Difference of the system time from the received one; bit 31 where the local one is smaller.
pub const SYSTEM_TIME_DIFFERENCE: u16 = 0x092c;
/// Start of the filters of the control loop.
pub const SPEED_COUNTER: u16 = 0x0930;
/// Unit that controls SYNC.
pub const SYNC_UNIT: u16 = 0x0980;
/// Activation of cyclic operation, SYNC0, SYNC1.
pub const SYNC_ACTIVATION: u16 = 0x0981;
/// Start of cyclic operation; read, the time of the next SYNC0.
pub const SYNC_START: u16 = 0x0990;
/// Cycle of SYNC0 \[ns\].
pub const SYNC0_CYCLE: u16 = 0x09a0;
/// Cycle of SYNC1 \[ns\].
pub const SYNC1_CYCLE: u16 = 0x09a4;
/// First byte of the memory for process data and mailboxes.
pub const PROCESS_MEMORY: u16 = 0x1000;

/// Parts of the registers that only the device writes.
const READ_ONLY: [std::ops::Range<u16>; 13] = [
    INFORMATION..STATION_ADDRESS,
    STATION_ALIAS..0x0014,
    DATA_LINK_STATUS..0x0112,
    AL_STATUS..0x0136,
    PDI_CONTROL..0x0160,
    WATCHDOG_STATUS..WATCHDOG_COUNTER,
    0x0805..0x0806,
    0x080d..0x080e,
    0x0815..0x0816,
    0x081d..0x081e,
    RECEIVE_TIME..SYSTEM_TIME,
    RECEIVE_TIME_UNIT..SYSTEM_TIME_OFFSET,
    SYSTEM_TIME_DIFFERENCE..SPEED_COUNTER,
];

/// Whether the main device may write a byte of the registers.
pub fn is_writable(address: u16) -> bool {
    !READ_ONLY.iter().any(|range| range.contains(&address))
}
