//! Unit of a drive's velocities, and the objects that state it.

use crate::object_dictionary::{Mapping, ObjectAccess, ObjectDictionary};

/// Unit of a drive's velocities 0x60FF and 0x606C (CiA 402, unit codes of CiA 303-2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum VelocityUnit {
    /// Increments per second of an encoder, behind a gear (0x6091) and a factor (0x6096).
    Increments {
        /// Encoder increments per motor revolution (0x608F).
        per_revolution: u32,
        /// Gear ratio: motor revolutions (0x6091:1) per shaft revolutions (0x6091:2).
        gear: [u32; 2],
        /// Numerator and divisor of the velocity factor (0x6096).
        factor: [u32; 2],
    },
    /// Revolutions per minute with a decimal prefix (0x60A9): -3 is 0.001 rpm.
    PrefixedRpm(i8),
}

/// Revolutions per minute in 0x60A9: numerator 0xB4, denominator 0x47 (CiA 303-2).
const REVOLUTION_PER_MINUTE: u32 = 0xb4 << 16 | 0x47 << 8;

impl VelocityUnit {
    /// One unit of velocity as a motor speed \[rev/s\].
    ///
    /// Increments: gear / factor / increments per revolution; a divisor of 0 in them counts as 1. With a prefix p:
    /// 10^p / 60.
    pub fn rev_per_s(self) -> f64 {
        match self {
            Self::Increments { per_revolution, gear, factor } => {
                let ratio = |[a, b]: [u32; 2]| f64::from(a) / f64::from(b.max(1));
                ratio(gear) / ratio(factor) / f64::from(per_revolution.max(1))
            }
            Self::PrefixedRpm(prefix) => 10f64.powi(i32::from(prefix)) / 60.0,
        }
    }

    /// Adds the objects that state the unit to a dictionary, read-only: 0x608F, 0x6091 and 0x6096, or 0x60A9.
    pub fn describe(self, dictionary: &mut ObjectDictionary) {
        let mut add = |key, value: u32| {
            dictionary.add(key, &value.to_le_bytes(), ObjectAccess::ReadOnly, Mapping::None);
        };
        match self {
            Self::Increments { per_revolution, gear, factor } => {
                for (index, [first, second]) in
                    [(0x608f, [per_revolution, 1]), (0x6091, gear), (0x6096, factor)]
                {
                    add((index, 1), first);
                    add((index, 2), second);
                }
            }
            Self::PrefixedRpm(prefix) => {
                add((0x60a9, 0), u32::from(prefix as u8) << 24 | REVOLUTION_PER_MINUTE);
            }
        }
    }
}
