//! Scan of the line: registers and identities of devices by their position, before anything is changed.

use super::facts::{ErrorCounters, LineDevice};
use crate::link::Link;
use crate::time::now;
use crate::wire::Wire;
use ethercrab::error::Error;
use ethercrab::{Command, EtherCrabWireRead, EtherCrabWireSized, RegisterAddress};

/// Largest number of devices that are scanned.
pub(super) const MOST_POSITIONS: u16 = 64;
/// First register of the error counters (ETG.1000.4).
const ERROR_COUNTERS: u16 = 0x0300;
/// Registers of the EEPROM interface (ETG.1000.4): owner.
const EEPROM_OWNER: u16 = 0x0500;
/// Control and status, with the word address behind it.
const EEPROM_CONTROL: u16 = 0x0502;
/// Data that were read.
const EEPROM_DATA: u16 = 0x0508;
/// Owner: access is first taken from the application.
const FORCE_RELEASE: u8 = 2;
/// Access is given to the main device.
const ASSIGN_TO_MAIN_DEVICE: u8 = 0;
/// Command: read.
const READ: u16 = 0x0100;
/// Bit of the status: the command is not done.
const IS_BUSY: u16 = 0x8000;
/// Time that a word of the EEPROM takes at most \[ns\].
const WORD_TIMEOUT: u64 = 20_000_000;
/// Words of vendor, product and revision in the EEPROM (ETG.1000.6).
const IDENTITY_WORDS: [u16; 3] = [8, 10, 12];

/// The devices by position; the first position without an answer ends the line.
pub(crate) fn read_line<L: Link>(wire: &mut Wire<L>) -> Vec<LineDevice> {
    let mut line = Vec::new();
    for position in 0..MOST_POSITIONS {
        let Ok(mut device) = registers(wire, position) else { break };
        device.identity = identity(wire, position).ok();
        line.push(device);
    }
    line
}

/// Reads counters and states again, at the end.
pub(crate) fn read_again<L: Link>(wire: &mut Wire<L>, line: &mut [LineDevice]) {
    for (position, device) in (0..).zip(line) {
        let after = registers(wire, position).ok();
        device.errors_after = after.map(|after| after.errors);
        // a state that was read right after a refusal is kept
        device.state_after = device.state_after.or(after.map(|after| [after.state, after.code]));
    }
}

/// Reads AL status and AL status code of each device.
pub(crate) fn read_states<L: Link>(wire: &mut Wire<L>, line: &mut [LineDevice]) {
    for (position, device) in (0..).zip(line) {
        let state = read(wire, position, RegisterAddress::AlStatus.into());
        let code = read(wire, position, RegisterAddress::AlStatusCode.into());
        device.state_after = state.ok().zip(code.ok()).map(|(state, code)| [state, code]);
    }
}

/// Ports, AL status, AL status code and error counters of the device at a position.
fn registers<L: Link>(wire: &mut Wire<L>, position: u16) -> Result<LineDevice, Error> {
    let counters: [u8; 20] = read(wire, position, ERROR_COUNTERS)?;
    Ok(LineDevice {
        ports: read(wire, position, RegisterAddress::DlStatus.into())?,
        state: read(wire, position, RegisterAddress::AlStatus.into())?,
        code: read(wire, position, RegisterAddress::AlStatusCode.into())?,
        errors: ErrorCounters::of(counters),
        ..LineDevice::default()
    })
}

/// Reads registers of the device at a position.
pub(crate) fn read<L: Link, T: EtherCrabWireRead + EtherCrabWireSized>(
    wire: &mut Wire<L>,
    position: u16,
    register: u16,
) -> Result<T, Error> {
    let main = wire.main;
    wire.run(Command::aprd(position, register).receive(main))
}

/// Vendor ID, product code and revision number in the EEPROM of the device at a position.
fn identity<L: Link>(wire: &mut Wire<L>, position: u16) -> Result<[u32; 3], Error> {
    let main = wire.main;
    for owner in [FORCE_RELEASE, ASSIGN_TO_MAIN_DEVICE] {
        wire.run(Command::apwr(position, EEPROM_OWNER).send(main, owner))?;
    }
    let mut numbers = [0; 3];
    for (number, word) in numbers.iter_mut().zip(IDENTITY_WORDS) {
        let ([low, high], [first, second]) = (READ.to_le_bytes(), word.to_le_bytes());
        let command = [low, high, first, second, 0, 0];
        wire.run(Command::apwr(position, EEPROM_CONTROL).send(main, command))?;
        let end = now() + WORD_TIMEOUT;
        while read::<_, u16>(wire, position, EEPROM_CONTROL)? & IS_BUSY != 0 {
            if now() > end {
                return Err(Error::Internal);
            }
        }
        *number = read(wire, position, EEPROM_DATA)?;
    }
    Ok(numbers)
}
