//! Memory of a controller: 4 KiB of registers, 8 KiB for process data and mailboxes.

use super::registers::{PROCESS_MEMORY, is_writable};

/// Bytes that a controller has.
pub const SIZE: usize = 0x3000;

/// The memory, little-endian.
#[derive(Clone, Debug)]
pub struct Memory(Vec<u8>);

impl Default for Memory {
    fn default() -> Self {
        Self(vec![0; SIZE])
    }
}

impl Memory {
    /// Whether a range is within the memory.
    pub fn has(&self, address: u16, length: usize) -> bool {
        usize::from(address) + length <= SIZE
    }

    /// Bytes from an address on; fewer where the memory ends.
    pub fn bytes(&self, address: u16, length: usize) -> &[u8] {
        let start = usize::from(address).min(SIZE);
        &self.0[start..(start + length).min(SIZE)]
    }

    /// The same, to change.
    pub fn bytes_mut(&mut self, address: u16, length: usize) -> &mut [u8] {
        let start = usize::from(address).min(SIZE);
        &mut self.0[start..(start + length).min(SIZE)]
    }

    /// A number of `N` bytes.
    fn array<const N: usize>(&self, address: u16) -> [u8; N] {
        self.bytes(address, N).first_chunk().copied().unwrap_or([0; N])
    }

    /// One byte.
    pub fn u8(&self, address: u16) -> u8 {
        self.array::<1>(address)[0]
    }

    /// 16 bits.
    pub fn u16(&self, address: u16) -> u16 {
        u16::from_le_bytes(self.array(address))
    }

    /// 32 bits.
    pub fn u32(&self, address: u16) -> u32 {
        u32::from_le_bytes(self.array(address))
    }

    /// 64 bits.
    pub fn u64(&self, address: u16) -> u64 {
        u64::from_le_bytes(self.array(address))
    }

    /// Sets bytes, as the device itself does: read-only registers too.
    pub fn set(&mut self, address: u16, bytes: &[u8]) {
        for (to, from) in self.bytes_mut(address, bytes.len()).iter_mut().zip(bytes) {
            *to = *from;
        }
    }

    /// Writes bytes as the main device does: read-only registers keep what they hold.
    pub fn write(&mut self, address: u16, bytes: &[u8]) {
        for (at, byte) in (address..).zip(bytes) {
            if at >= PROCESS_MEMORY || is_writable(at) {
                self.set(at, &[*byte]);
            }
        }
    }
}
