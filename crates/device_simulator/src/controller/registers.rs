//! Addresses of a controller's registers (ETG.1000.4), and which of their bytes the main device may write.

/// Device information: type, revision, build, number of FMMUs and sync managers, memory size, ports, features.
pub const INFORMATION: u16 = 0x0000;
/// Features: bit 2, a distributed clock; bit 3, one of 64 bit.
pub const FEATURES: u16 = 0x0008;
/// Configured station address, 16 bit: set by the main device; 0 before.
pub const STATION_ADDRESS: u16 = 0x0010;
/// Configured station alias, 16 bit: second address of a device, from word 4 of its EEPROM. Always 0 here, because
/// it is not loaded.
pub const STATION_ALIAS: u16 = 0x0012;
/// Data link control, 32 bit: forwarding of frames and loops of the ports. Stored without effect here.
pub const DATA_LINK_CONTROL: u16 = 0x0100;
/// Data link status, 16 bit: links and loops of the ports.
pub const DATA_LINK_STATUS: u16 = 0x0110;
/// AL control, 16 bit: requested state in bits 0 to 3, and bit 4 to acknowledge an error.
pub const AL_CONTROL: u16 = 0x0120;
/// AL status, 16 bit: present state in bits 0 to 3, and bit 4 for an error.
pub const AL_STATUS: u16 = 0x0130;
/// AL status code, 16 bit: reason of the error; 0 without one.
pub const AL_STATUS_CODE: u16 = 0x0134;
/// PDI control: interface to the application.
pub const PDI_CONTROL: u16 = 0x0140;
/// Error counters, 8 bit each, up to 255: invalid frames and receiver errors of ports 0 to 3,
/// then forwarded errors and lost links.
pub const ERROR_COUNTERS: u16 = 0x0300;
/// Watchdog divider, 16 bit, in units of 40 ns, minus 2.
pub const WATCHDOG_DIVIDER: u16 = 0x0400;
/// Time of the process-data watchdog, 16 bit, in units of the divider; 0 switches it off.
pub const WATCHDOG_PROCESS_DATA: u16 = 0x0420;
/// Watchdog status: 1 while the process-data watchdog has not expired.
pub const WATCHDOG_STATUS: u16 = 0x0440;
/// Number of expirations of the process-data watchdog.
pub const WATCHDOG_COUNTER: u16 = 0x0442;
/// EEPROM interface: access rights, then control and status, address, data.
pub const EEPROM: u16 = 0x0500;
/// First FMMU; 16 bytes each.
pub const FMMU: u16 = 0x0600;
/// First sync manager; 8 bytes each.
pub const SYNC_MANAGER: u16 = 0x0800;
/// Receive times of the ports, local time \[ns\].
pub const RECEIVE_TIME: u16 = 0x0900;
/// System time \[ns\].
pub const SYSTEM_TIME: u16 = 0x0910;
/// Receive time at the processing unit, local time \[ns\].
pub const RECEIVE_TIME_UNIT: u16 = 0x0918;
/// Offset of system time from local time \[ns\].
pub const SYSTEM_TIME_OFFSET: u16 = 0x0920;
/// Propagation delay from the reference clock \[ns\].
pub const SYSTEM_TIME_DELAY: u16 = 0x0928;
/// Difference of the system time from the received one \[ns\]; bit 31 is set if the own one is smaller.
pub const SYSTEM_TIME_DIFFERENCE: u16 = 0x092c;
/// Speed counter start: resets the filters of the clock's control loop.
pub const SPEED_COUNTER: u16 = 0x0930;
/// Owner of the SYNC unit: main device or application.
pub const SYNC_UNIT: u16 = 0x0980;
/// Activation, 8 bit: bit 0 cyclic operation, bit 1 SYNC0, bit 2 SYNC1.
pub const SYNC_ACTIVATION: u16 = 0x0981;
/// Start time of cyclic operation; when read, the time of the next SYNC0, system time \[ns\].
pub const SYNC_START: u16 = 0x0990;
/// Cycle time of SYNC0 \[ns\].
pub const SYNC0_CYCLE: u16 = 0x09a0;
/// Cycle time of SYNC1 \[ns\].
pub const SYNC1_CYCLE: u16 = 0x09a4;
/// First address of the process memory, for process data and mailboxes.
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

/// Whether the main device may write a byte of the registers at this address.
pub fn is_writable(address: u16) -> bool {
    !READ_ONLY.iter().any(|range| range.contains(&address))
}
