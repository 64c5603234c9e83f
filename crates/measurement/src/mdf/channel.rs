//! Channels of a group of an MDF file (`##CN`): position and conversion of a number in a record.

use super::block::{Block, Blocks, Damage};
use super::conversion::Conversion;
use crate::heading::Heading;
use crate::path;
use std::io::{Read, Seek};

/// A number in the records of a group.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub(super) heading: String,
    pub(super) read: Heading,
    raw: Raw,
    conversion: Conversion,
    /// Bit after the record's data that marks the number as invalid.
    invalid_bit: Option<u64>,
}

/// Kind of a channel.
pub(super) enum Kind {
    /// Time of all other channels of the group.
    Time(Field),
    /// Another master quantity of the group, such as an angle; its name.
    OtherMaster(&'static str),
    Signal(Field),
    /// A channel without numbers; the name of its content.
    Unread(String),
}

/// Storage of a number in a record.
#[derive(Clone, Debug, PartialEq)]
enum Raw {
    /// Index of the record.
    Index,
    Bits {
        at: usize,
        bytes: usize,
        shift: u32,
        bits: u32,
        is_signed: bool,
        is_big: bool,
    },
    Float {
        at: usize,
        bytes: usize,
        is_big: bool,
    },
}

/// Evaluates a channel's block, for records with `record` bytes of data.
pub(super) fn kind<R: Read + Seek>(
    file: &mut Blocks<R>,
    block: &Block,
    name: &str,
    record: usize,
) -> Kind {
    let (kind, master) = (block.number(0, 1), block.number(1, 1));
    match (kind, master) {
        (2 | 3, 2) => return Kind::OtherMaster("an angle"),
        (2 | 3, 3) => return Kind::OtherMaster("a distance"),
        (2 | 3, 4) => return Kind::OtherMaster("an index"),
        (1 | 5, _) => return Kind::Unread("of varying length".into()),
        (4, _) => return Kind::Unread("another file".into()),
        _ => {}
    }
    let raw = match kind {
        3 | 6 => Ok(Raw::Index),
        _ => raw(block, record),
    };
    let raw = match raw {
        Ok(raw) => raw,
        Err(what) => return Kind::Unread(what),
    };
    let is_real = matches!(raw, Raw::Float { .. });
    let conversion = match Conversion::at(file, block.link(4), is_real) {
        Ok(conversion) => conversion,
        Err(what) => return Kind::Unread(what),
    };
    // measuring devices append their name to the signal: `pA\ETKC:1`
    let short = name.split('\\').next().unwrap_or(name);
    let read = match unit(file, block) {
        Ok(unit) if unit.trim().is_empty() => path::heading(short),
        Ok(unit) => Heading::with_unit(short, &unit),
        // no unit is guessed in place of an unreadable stated one
        Err(_) => {
            Heading { unknown_unit: Some("a text that is damaged".into()), ..path::heading(short) }
        }
    };
    let flags = block.number(12, 4);
    let invalid_bit = match flags & 3 {
        0 => None,
        2 => Some(block.number(16, 4)),
        _ => return Kind::Unread("invalid throughout".into()),
    };
    let field = Field { heading: name.into(), read, raw, conversion, invalid_bit };
    if matches!(kind, 2 | 3) { Kind::Time(field) } else { Kind::Signal(field) }
}

/// The unit of a channel, or else of its conversion.
fn unit<R: Read + Seek>(file: &mut Blocks<R>, block: &Block) -> Result<String, Damage> {
    let unit = file.text(block.link(6))?;
    if !unit.trim().is_empty() || block.link(4) == 0 {
        return Ok(unit);
    }
    let conversion = file.block(block.link(4), &[b"##CC"])?;
    file.text(conversion.link(1))
}

/// Storage of a number, or the name of other content.
fn raw(block: &Block, record: usize) -> Result<Raw, String> {
    let (kind, shift) = (block.number(2, 1), block.number(3, 1) as u32);
    let (at, bits) = (block.number(4, 4) as usize, block.number(8, 4) as u32);
    let is_big = kind % 2 == 1;
    let raw = match kind {
        0..=3 if (1..=64).contains(&bits) && shift < 64 => {
            let bytes = (shift + bits).div_ceil(8) as usize;
            Raw::Bits { at, bytes, shift, bits, is_signed: kind >= 2, is_big }
        }
        4 | 5 if matches!(bits, 16 | 32 | 64) && shift == 0 => {
            Raw::Float { at, bytes: bits as usize / 8, is_big }
        }
        6..=9 => return Err("a text".into()),
        10..=14 => return Err("bytes".into()),
        15 | 16 => return Err("complex".into()),
        _ => return Err(format!("of type {kind} with {bits} bits")),
    };
    let (Raw::Bits { at, bytes, .. } | Raw::Float { at, bytes, .. }) = raw else { return Ok(raw) };
    match at.checked_add(bytes).is_some_and(|end| end <= record) {
        true => Ok(raw),
        false => Err("beyond the end of its record".into()),
    }
}

impl Field {
    /// Whether a mapping's name refers to it.
    pub(super) fn is_named(&self, name: &str) -> bool {
        self.heading == name || self.read.name == name
    }

    /// The physical value in a record with `data` bytes of data; NaN if invalid.
    pub(super) fn of(&self, record: &[u8], data: usize, index: u64) -> f64 {
        if let Some(bit) = self.invalid_bit {
            let byte = record.get(data + (bit / 8) as usize).copied().unwrap_or(0);
            if byte >> (bit % 8) & 1 == 1 {
                return f64::NAN;
            }
        }
        let value = self.conversion.of(self.raw.of(record, index));
        if value.is_finite() { value } else { f64::NAN }
    }
}

impl Raw {
    fn of(&self, record: &[u8], index: u64) -> f64 {
        let whole = |at: usize, bytes: usize, is_big: bool| -> u128 {
            let part = record.get(at..at + bytes).unwrap_or(&[]);
            let join = |all: u128, byte: &u8| all << 8 | u128::from(*byte);
            match is_big {
                true => part.iter().fold(0, join),
                false => part.iter().rev().fold(0, join),
            }
        };
        match *self {
            Self::Index => index as f64,
            Self::Bits { at, bytes, shift, bits, is_signed, is_big } => {
                let value = (whole(at, bytes, is_big) >> shift) as u64;
                let unused = 64 - bits;
                match is_signed {
                    true => ((value << unused) as i64 >> unused) as f64,
                    false => (value << unused >> unused) as f64,
                }
            }
            Self::Float { at, bytes, is_big } => {
                let value = whole(at, bytes, is_big) as u64;
                match bytes {
                    2 => half(value as u16),
                    4 => f64::from(f32::from_bits(value as u32)),
                    _ => f64::from_bits(value),
                }
            }
        }
    }
}

/// Decodes a half-precision number: a sign, five bits of exponent, ten of fraction (IEEE 754).
fn half(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    let size = match exponent {
        0 => fraction * 2_f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1024.0 + fraction) * 2_f64.powi(exponent - 25),
    };
    if bits >> 15 == 1 { -size } else { size }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packed_bit_fields_are_read_in_either_byte_order() {
        let bits = |at, bytes, shift, bits, is_signed, is_big| Raw::Bits {
            at,
            bytes,
            shift,
            bits,
            is_signed,
            is_big,
        };
        let record = [0b1011_0110, 0b0000_0101, 0xff, 0x01, 0x02];
        assert_eq!(bits(0, 1, 2, 3, false, false).of(&record, 0), 5.0);
        assert_eq!(bits(0, 1, 4, 4, true, false).of(&record, 0), -5.0);
        assert_eq!(bits(0, 2, 4, 8, false, false).of(&record, 0), 0x5b as f64);
        assert_eq!(bits(2, 1, 0, 8, true, false).of(&record, 0), -1.0);
        assert_eq!(bits(3, 2, 0, 16, false, true).of(&record, 0), 258.0);
        assert_eq!(bits(3, 2, 0, 16, false, false).of(&record, 0), 513.0);
        let float = Raw::Float { at: 0, bytes: 4, is_big: true };
        assert_eq!(float.of(&1.5_f32.to_be_bytes(), 0), 1.5);
        assert_eq!(Raw::Index.of(&[], 7), 7.0);
        for (bits, value) in
            [(0x3c00, 1.0), (0xc000, -2.0), (0x7bff, 65_504.0), (1, 5.960_464_477_539_063e-8)]
        {
            assert_eq!(half(bits), value);
        }
    }
}
