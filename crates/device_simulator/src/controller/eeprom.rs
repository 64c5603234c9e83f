//! EEPROM interface (SII access, ETG.1000.4): the main device writes a command and a word address, and reads eight
//! bytes.

use super::memory::Memory;
use super::registers::EEPROM;

/// EEPROM interface of a device, behind registers 0x0500 to 0x050F.
#[derive(Clone, Debug, Default)]
pub struct Eeprom {
    /// Content of the EEPROM \[byte\]; addresses beyond it read as 0xFF.
    pub content: Vec<u8>,
}

/// Bit of the status: eight bytes are read at once.
const EIGHT_BYTE_READ: u16 = 0x0040;
/// Bits of the command.
const COMMAND: u16 = 0x0700;
/// Read.
const READ: u16 = 0x0100;
/// Reload the controller's own settings from the EEPROM.
const RELOAD: u16 = 0x0400;
/// Bit of the status: a command was refused.
const COMMAND_ERROR: u16 = 0x2000;

impl Eeprom {
    /// Executes the command in the control register (0x0502): a read puts eight bytes from the word address 0x0504
    /// into 0x0508. The EEPROM is read-only: a write command is refused, which bit 13 of 0x0502 shows.
    pub fn execute(&self, memory: &mut Memory) {
        let command = memory.u16(EEPROM + 2) & COMMAND;
        let first = 2 * memory.u32(EEPROM + 4) as usize;
        if command == READ {
            let byte = |k: usize| self.content.get(first + k).copied().unwrap_or(0xff);
            memory.set(EEPROM + 8, &std::array::from_fn::<u8, 8, _>(byte));
        }
        let error = if matches!(command, 0 | READ | RELOAD) { 0 } else { COMMAND_ERROR };
        memory.set(EEPROM + 2, &(EIGHT_BYTE_READ | error).to_le_bytes());
    }
}
