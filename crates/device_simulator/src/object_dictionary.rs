//! Object dictionary of a device (ETG.1000.6): objects by index and subindex, and the process data that are mapped
//! from them.

use std::collections::BTreeMap;

/// Access rights of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObjectAccess {
    /// Read-only for the main device.
    ReadOnly,
    /// Writable by the main device, in any state with a mailbox.
    ReadWrite,
    /// Writable by the main device, in PREOP only.
    ReadWriteInPreOp,
}

/// Whether an object can be mapped into process data, and in which direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mapping {
    /// Not mappable.
    None,
    /// Mappable into output data (RxPDO).
    Outputs,
    /// Mappable into input data (TxPDO).
    Inputs,
}

/// Object of a dictionary: value, access rights and mapping.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Object {
    /// Value, little-endian.
    pub value: Vec<u8>,
    /// Access rights.
    pub access: ObjectAccess,
    /// Mapping into process data.
    pub mapping: Mapping,
}

/// Key of an object: index and subindex.
pub type Key = (u16, u8);

/// SDO abort code: reason why an access to an object is refused (ETG.1000.6, table of abort codes).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Abort {
    /// Toggle bit not alternated.
    Toggle = 0x0503_0000,
    /// Unknown command.
    UnknownCommand = 0x0504_0001,
    /// Out of memory: the value does not fit the mailbox.
    OutOfMemory = 0x0504_0005,
    /// Unsupported access to an object.
    UnsupportedAccess = 0x0601_0000,
    /// Write access to a read-only object.
    ReadOnly = 0x0601_0002,
    /// No object with this index.
    NoObject = 0x0602_0000,
    /// Object cannot be mapped into process data.
    NotMappable = 0x0604_0041,
    /// Mapped objects exceed the length of the process data.
    MappedTooLong = 0x0604_0042,
    /// Value longer than the object.
    TooLong = 0x0607_0012,
    /// Value shorter than the object.
    TooShort = 0x0607_0013,
    /// No object with this subindex.
    NoSubindex = 0x0609_0011,
    /// Value out of range.
    ValueRange = 0x0609_0030,
    /// Access not possible in the present state.
    WrongState = 0x0800_0022,
}

/// Object dictionary of a device, in the order of the keys.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ObjectDictionary(BTreeMap<Key, Object>);

impl ObjectDictionary {
    /// Adds an object, or replaces the one with this key.
    pub fn add(&mut self, key: Key, value: &[u8], access: ObjectAccess, mapping: Mapping) {
        self.0.insert(key, Object { value: value.to_vec(), access, mapping });
    }

    /// Object with this key.
    ///
    /// # Errors
    ///
    /// [`Abort::NoObject`], or [`Abort::NoSubindex`] if the index has other subindices.
    pub fn object(&self, key: Key) -> Result<&Object, Abort> {
        let absent = || match self.0.range((key.0, 0)..=(key.0, u8::MAX)).next() {
            Some(_) => Abort::NoSubindex,
            None => Abort::NoObject,
        };
        self.0.get(&key).ok_or_else(absent)
    }

    /// Sets the value of an object as the device; a longer value is cut off, a shorter one filled with zeros. Without
    /// such an object it has no effect.
    pub fn set(&mut self, key: Key, value: &[u8]) {
        if let Some(object) = self.0.get_mut(&key) {
            let mut bytes = value.iter().copied();
            object.value.iter_mut().for_each(|to| *to = bytes.next().unwrap_or(0));
        }
    }

    /// Writes the value of an object as the main device; `is_preop` says whether the device is in PREOP.
    ///
    /// # Errors
    ///
    /// - [`Abort::NoObject`] or [`Abort::NoSubindex`] if there is no such object.
    /// - [`Abort::ReadOnly`], or [`Abort::WrongState`] outside PREOP, if it may not be written.
    /// - [`Abort::TooShort`] or [`Abort::TooLong`] if the length differs.
    pub fn write(&mut self, key: Key, value: &[u8], is_preop: bool) -> Result<(), Abort> {
        let object = self.object(key)?;
        match object.access {
            ObjectAccess::ReadOnly => return Err(Abort::ReadOnly),
            ObjectAccess::ReadWriteInPreOp if !is_preop => return Err(Abort::WrongState),
            _ => {}
        }
        match value.len().cmp(&object.value.len()) {
            std::cmp::Ordering::Less => return Err(Abort::TooShort),
            std::cmp::Ordering::Greater => return Err(Abort::TooLong),
            std::cmp::Ordering::Equal => {}
        }
        self.set(key, value);
        Ok(())
    }

    /// Value of an object as an unsigned number, of its first 8 bytes; zero if there is no such object.
    pub fn unsigned(&self, key: Key) -> u64 {
        let Some(object) = self.0.get(&key) else { return 0 };
        object
            .value
            .iter()
            .rev()
            .skip(object.value.len().saturating_sub(8))
            .fold(0, |sum, byte| sum << 8 | u64::from(*byte))
    }

    /// Value of an object as a signed number in two's complement, of its first 8 bytes; zero if there is no such
    /// object.
    pub fn signed(&self, key: Key) -> i64 {
        let bits = self.0.get(&key).map_or(0, |object| 8 * object.value.len().min(8) as u32);
        if bits == 0 {
            return 0;
        }
        (self.unsigned(key) << (64 - bits)) as i64 >> (64 - bits)
    }

    /// Sets the value of an object to a number; bytes beyond its length are cut off.
    pub fn set_number(&mut self, key: Key, value: i64) {
        self.set(key, &value.to_le_bytes());
    }

    /// Process data mapped by an assignment (0x1C12 for outputs, 0x1C13 for inputs), in their order. An entry with
    /// index 0 is a gap.
    ///
    /// # Errors
    ///
    /// - [`Abort::NoObject`] or [`Abort::NoSubindex`] if an object does not exist.
    /// - [`Abort::NotMappable`] if it cannot be mapped in that direction, or its entry is longer than the object.
    pub fn mapped(&self, assignment: u16) -> Result<Vec<MappedEntry>, Abort> {
        let direction = if assignment == 0x1c12 { Mapping::Outputs } else { Mapping::Inputs };
        let mut entries = Vec::new();
        for number in 1..=self.unsigned((assignment, 0)) as u8 {
            let list = self.unsigned((assignment, number)) as u16;
            self.object((list, 0))?;
            for sub in 1..=self.unsigned((list, 0)) as u8 {
                let entry = self.unsigned((list, sub)) as u32;
                let key = ((entry >> 16) as u16, (entry >> 8) as u8);
                let bits = (entry & 0xff) as usize;
                if key.0 != 0 {
                    let object = self.object(key)?;
                    if object.mapping != direction || bits > 8 * object.value.len() {
                        return Err(Abort::NotMappable);
                    }
                }
                entries.push(MappedEntry { key, bits });
            }
        }
        Ok(entries)
    }
}

/// Mapped object with its length; index 0 is a gap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MappedEntry {
    /// Key of the object: index and subindex.
    pub key: Key,
    /// Length \[bit\].
    pub bits: usize,
}

/// Length of process data with these entries \[byte\]: the sum of their bits, gaps included, rounded up.
pub fn mapped_bytes(entries: &[MappedEntry]) -> usize {
    entries.iter().map(|entry| entry.bits).sum::<usize>().div_ceil(8)
}

/// Copies mapped values from output data into the dictionary; bits beyond the end of `bytes` are zero. Of an entry
/// the lowest 64 bits are copied.
pub fn unpack(entries: &[MappedEntry], bytes: &[u8], into: &mut ObjectDictionary) {
    let mut first = 0;
    for entry in entries {
        let bit = |k: usize| {
            u64::from(bytes.get((first + k) / 8).map_or(0, |b| b >> ((first + k) % 8) & 1))
        };
        let value = (0..entry.bits.min(64)).fold(0, |sum, k| sum | bit(k) << k);
        into.set(entry.key, &value.to_le_bytes());
        first += entry.bits;
    }
}

/// Copies mapped values from the dictionary into input data; those beyond the end of `bytes` are left out. Gaps are
/// zero, and of an entry the lowest 64 bits are copied.
pub fn pack(entries: &[MappedEntry], from: &ObjectDictionary, bytes: &mut [u8]) {
    bytes.fill(0);
    let mut first = 0;
    for entry in entries {
        let value = from.unsigned(entry.key);
        for k in 0..entry.bits.min(64) {
            if let Some(byte) = bytes.get_mut((first + k) / 8) {
                *byte |= ((value >> k & 1) as u8) << ((first + k) % 8);
            }
        }
        first += entry.bits;
    }
}
