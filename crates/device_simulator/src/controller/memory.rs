//! Memory of a controller: 4 KiB of registers, 8 KiB for process data and mailboxes.

use super::registers::{PROCESS_MEMORY, is_writable};

/// Size of a controller's memory \[byte\]: 4 KiB of registers, 8 KiB of process memory.
pub const SIZE: usize = 0x3000;

/// Memory of a controller, little-endian.
#[derive(Clone, Debug)]
pub struct Memory(Vec<u8>);

impl Default for Memory {
    fn default() -> Self {
        Self(vec![0; SIZE])
    }
}

impl Memory {
    /// Whether a range of `length` \[byte\] from `address` is within the memory.
    pub fn has(&self, address: u16, length: usize) -> bool {
        usize::from(address) + length <= SIZE
    }

    /// `length` bytes from `address`; fewer at the end of the memory.
    pub fn bytes(&self, address: u16, length: usize) -> &[u8] {
        let start = usize::from(address).min(SIZE);
        &self.0[start..(start + length).min(SIZE)]
    }

    /// `length` mutable bytes from `address`; fewer at the end of the memory.
    pub fn bytes_mut(&mut self, address: u16, length: usize) -> &mut [u8] {
        let start = usize::from(address).min(SIZE);
        &mut self.0[start..(start + length).min(SIZE)]
    }

    /// A number of `N` bytes.
    fn array<const N: usize>(&self, address: u16) -> [u8; N] {
        self.bytes(address, N).first_chunk().copied().unwrap_or([0; N])
    }

    /// Value of 8 bits at an address; 0 beyond the end of the memory.
    pub fn u8(&self, address: u16) -> u8 {
        self.array::<1>(address)[0]
    }

    /// Value of 16 bits at an address; 0 if it does not lie wholly within the memory.
    pub fn u16(&self, address: u16) -> u16 {
        u16::from_le_bytes(self.array(address))
    }

    /// Value of 32 bits at an address; 0 if it does not lie wholly within the memory.
    pub fn u32(&self, address: u16) -> u32 {
        u32::from_le_bytes(self.array(address))
    }

    /// Value of 64 bits at an address; 0 if it does not lie wholly within the memory.
    pub fn u64(&self, address: u16) -> u64 {
        u64::from_le_bytes(self.array(address))
    }

    /// Writes bytes as the device itself, read-only registers included. Bytes beyond the end of the memory are left
    /// out.
    pub fn set(&mut self, address: u16, bytes: &[u8]) {
        for (to, from) in self.bytes_mut(address, bytes.len()).iter_mut().zip(bytes) {
            *to = *from;
        }
    }

    /// Writes bytes as the main device: read-only registers stay as they are. Bytes beyond the end of the memory are
    /// left out.
    pub fn write(&mut self, address: u16, bytes: &[u8]) {
        for (at, byte) in (address..).zip(bytes) {
            if at >= PROCESS_MEMORY || is_writable(at) {
                self.set(at, &[*byte]);
            }
        }
    }
}
