//! Object dictionary of a device: objects by index and subindex, and the process data that are mapped from them.

use std::collections::BTreeMap;

/// Who may change an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObjectAccess {
    /// Only the device.
    ReadOnly,
    /// The main device, in any state with a mailbox.
    ReadWrite,
    /// The main device, in PREOP only.
    ReadWriteInPreOp,
}

/// Whether and in which direction an object can be mapped into process data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mapping {
    /// Not at all.
    None,
    /// Into outputs (RxPDO).
    Outputs,
    /// Into inputs (TxPDO).
    Inputs,
}

/// One object: its value in bytes, and what may be done with it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Object {
    /// Its value, little-endian.
    pub value: Vec<u8>,
    /// Who may change it.
    pub access: ObjectAccess,
    /// Whether it can be mapped.
    pub mapping: Mapping,
}

/// Index and subindex.
pub type Key = (u16, u8);

/// What was asked of a dictionary and cannot be: an SDO abort code (ETG.1000.6, table of abort codes).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Abort {
    /// The toggle bit does not alternate.
    Toggle = 0x0503_0000,
    /// Unknown command.
    UnknownCommand = 0x0504_0001,
    /// Out of memory: the value does not fit the mailbox.
    OutOfMemory = 0x0504_0005,
    /// The access is not supported.
    UnsupportedAccess = 0x0601_0000,
    /// A write to what can only be read.
    ReadOnly = 0x0601_0002,
    /// There is no such object.
    NoObject = 0x0602_0000,
    /// The object cannot be mapped.
    NotMappable = 0x0604_0041,
    /// The mapped objects are longer than process data may be.
    MappedTooLong = 0x0604_0042,
    /// Longer than the object.
    TooLong = 0x0607_0012,
    /// Shorter than the object.
    TooShort = 0x0607_0013,
    /// There is no such subindex.
    NoSubindex = 0x0609_0011,
    /// The value is out of range.
    ValueRange = 0x0609_0030,
    /// Not in this state.
    WrongState = 0x0800_0022,
}

/// Objects, in their order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ObjectDictionary(BTreeMap<Key, Object>);

impl ObjectDictionary {
    /// Adds an object, or puts it in place of one.
    pub fn add(&mut self, key: Key, value: &[u8], access: ObjectAccess, mapping: Mapping) {
        self.0.insert(key, Object { value: value.to_vec(), access, mapping });
    }

    /// The object of a key.
    ///
    /// # Errors
    ///
    /// [`Abort::NoObject`], or [`Abort::NoSubindex`] where the index has others.
    pub fn object(&self, key: Key) -> Result<&Object, Abort> {
        let absent = || match self.0.range((key.0, 0)..=(key.0, u8::MAX)).next() {
            Some(_) => Abort::NoSubindex,
            None => Abort::NoObject,
        };
        self.0.get(&key).ok_or_else(absent)
    }

    /// Sets a value of the same length, as the device does; what does not fit is cut off or filled with zeros.
    pub fn set(&mut self, key: Key, value: &[u8]) {
        if let Some(object) = self.0.get_mut(&key) {
            let mut bytes = value.iter().copied();
            object.value.iter_mut().for_each(|to| *to = bytes.next().unwrap_or(0));
        }
    }

    /// Writes for the main device.
    ///
    /// # Errors
    ///
    /// [`Abort`] where it may not be written, or the length differs.
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

    /// Value as a number without a sign; zero where there is none.
    pub fn unsigned(&self, key: Key) -> u64 {
        let Some(object) = self.0.get(&key) else { return 0 };
        object
            .value
            .iter()
            .rev()
            .skip(object.value.len().saturating_sub(8))
            .fold(0, |sum, byte| sum << 8 | u64::from(*byte))
    }

    /// Value as a number with a sign; zero where there is none.
    pub fn signed(&self, key: Key) -> i64 {
        let bits = self.0.get(&key).map_or(0, |object| 8 * object.value.len().min(8) as u32);
        if bits == 0 {
            return 0;
        }
        (self.unsigned(key) << (64 - bits)) as i64 >> (64 - bits)
    }

    /// Sets a number; higher bytes than the object has are cut off.
    pub fn set_number(&mut self, key: Key, value: i64) {
        self.set(key, &value.to_le_bytes());
    }

    /// Process data that an assignment (0x1C12 or 0x1C13) maps, in order; an entry of index 0 is a gap.
    ///
    /// # Errors
    ///
    /// [`Abort`] where an object is not there or cannot be mapped in that direction, or an entry has another length than its object.
    pub fn mapped(&self, assignment: u16) -> Result<Vec<MappedEntry>, Abort> {
        let wanted = if assignment == 0x1c12 { Mapping::Outputs } else { Mapping::Inputs };
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
                    if object.mapping != wanted || bits > 8 * object.value.len() {
                        return Err(Abort::NotMappable);
                    }
                }
                entries.push(MappedEntry { key, bits });
            }
        }
        Ok(entries)
    }
}

/// A mapped object and its length; index 0 is a gap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MappedEntry {
    /// Index and subindex.
    pub key: Key,
    /// Length in bits.
    pub bits: usize,
}

/// Bytes of process data.
pub fn mapped_bytes(entries: &[MappedEntry]) -> usize {
    entries.iter().map(|entry| entry.bits).sum::<usize>().div_ceil(8)
}

/// Takes values out of outputs into the dictionary.
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

/// Packs values of the dictionary into inputs.
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
