//! Fieldbus memory management units (FMMU, ETG.1000.4): parts of the logical address space that are parts of a
//! device's memory, bit by bit.

use super::memory::Memory;
use super::registers::FMMU;

/// Number of FMMUs of a controller.
pub const UNITS: u16 = 16;

/// Fieldbus memory management unit (FMMU): mapping of a part of the logical address space to device memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fmmu {
    /// First logical bit: eight times the logical address, and the start bit.
    logical: u64,
    /// Bits that are mapped.
    bits: u64,
    /// First bit in the device's memory.
    physical: u64,
    /// Whether it maps reads.
    pub reads: bool,
    /// Whether it maps writes.
    pub writes: bool,
}

/// Overlap of a datagram and an FMMU, in bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Overlap {
    /// First bit in the datagram's data.
    pub in_data: usize,
    /// First bit in the device's memory.
    pub in_memory: usize,
    /// Number of bits.
    pub bits: usize,
}

impl Fmmu {
    /// FMMU by its number, as its registers state it; `None` if it is inactive or maps nothing.
    pub fn of(memory: &Memory, number: u16) -> Option<Self> {
        let at = FMMU + 16 * number;
        let [start_bit, stop_bit, physical_bit] =
            [6, 7, 10].map(|k| u64::from(memory.u8(at + k) & 7));
        let length = u64::from(memory.u16(at + 4));
        if memory.u8(at + 12) & 1 == 0 || length == 0 {
            return None;
        }
        Some(Self {
            logical: 8 * u64::from(memory.u32(at)) + start_bit,
            bits: (8 * (length - 1) + stop_bit + 1).saturating_sub(start_bit),
            physical: 8 * u64::from(memory.u16(at + 8)) + physical_bit,
            reads: memory.u8(at + 11) & 1 != 0,
            writes: memory.u8(at + 11) & 2 != 0,
        })
    }

    /// Overlap with a datagram of `length` \[byte\] at a logical address \[byte\]; `None` without overlap.
    pub fn overlap(&self, address: u32, length: usize) -> Option<Overlap> {
        let first = 8 * u64::from(address);
        let begin = first.max(self.logical);
        let end = (first + 8 * length as u64).min(self.logical + self.bits);
        (begin < end).then(|| Overlap {
            in_data: (begin - first) as usize,
            in_memory: (self.physical + begin - self.logical) as usize,
            bits: (end - begin) as usize,
        })
    }
}

/// Copies `bits` bits from `from`, starting at bit `from_bit`, into `to` at bit `to_bit`; bits beyond either end are
/// left out.
pub fn copy_bits(to: &mut [u8], to_bit: usize, from: &[u8], from_bit: usize, bits: usize) {
    if [to_bit, from_bit, bits].iter().all(|number| number.is_multiple_of(8)) {
        let target = to.iter_mut().skip(to_bit / 8).take(bits / 8);
        target.zip(from.iter().skip(from_bit / 8)).for_each(|(to, from)| *to = *from);
        return;
    }
    for k in 0..bits {
        let (target, source) = (to_bit + k, from_bit + k);
        if let (Some(to), Some(from)) = (to.get_mut(target / 8), from.get(source / 8)) {
            let bit = from >> (source % 8) & 1;
            *to = *to & !(1 << (target % 8)) | bit << (target % 8);
        }
    }
}
