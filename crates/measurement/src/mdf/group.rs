//! Groups of channels of an MDF file that were sampled together (`##CG`), and their records.

use super::block::{Blocks, Damage, number};
use super::channel::{Field, Kind, kind};
use super::data::{Parts, is_by_columns};
use crate::heading::Heading;
use crate::recording::Recording;
use crate::time_column::TimeColumn;
use crate::time_scale::TimeScale;
use std::collections::BTreeMap;
use std::io::{Read, Seek};

/// Largest number of channels of a file.
const MOST_CHANNELS: usize = 20_000;
/// Deepest nesting of channels.
const DEEPEST: u32 = 8;
/// Largest size of a record \[bytes\].
const LARGEST_RECORD: u64 = 16 << 20;

/// Channels with one time.
pub(super) struct Group {
    /// Name of the group, if any.
    pub(super) name: String,
    pub(super) time: Option<Field>,
    pub(super) fields: Vec<Field>,
    /// Name of the master quantity, if it is not a time.
    pub(super) other_master: Option<&'static str>,
    /// The time channel named by a mapping, if this group lacks it.
    lacks: Option<String>,
    /// Count of channels without numbers, by kind.
    pub(super) unread: BTreeMap<String, u64>,
    id: u64,
    /// Size of a record: its data, and the bits that mark invalid numbers \[bytes\].
    data: usize,
    record: usize,
    is_text: bool,
    /// Number of records that the group states.
    pub(super) cycles: u64,
    /// Expected number of records, bounded by the size of the file.
    expected: u64,
    /// The time \[s\], then a column for each field.
    pub(super) recording: Recording,
    /// Conversion of the time channel's numbers to seconds.
    scale: Option<TimeScale>,
    /// Reason why the time channel is not a time.
    pub(super) refused: Option<String>,
    /// Number of records without a time.
    timeless: u64,
    pub(super) read: u64,
}

/// Channel groups with a common data block.
pub(super) struct DataGroup {
    pub(super) groups: Vec<Group>,
    /// Size of the group number before each record \[bytes\].
    id_size: usize,
    data: u64,
}

impl DataGroup {
    /// All groups of a file, from the position of the first.
    ///
    /// # Errors
    ///
    /// Description of the damage.
    pub(super) fn all<R: Read + Seek>(
        file: &mut Blocks<R>,
        first: u64,
    ) -> Result<Vec<Self>, Damage> {
        let (mut all, mut at, mut channels) = (Vec::new(), first, 0);
        while at != 0 {
            let block = file.next(at, b"##DG")?;
            let mut groups = Vec::new();
            let mut next = block.link(1);
            while next != 0 {
                let (group, after) = Group::at(file, next, &mut channels)?;
                groups.push(group);
                next = after;
            }
            let id_size = block.number(0, 1) as usize;
            if !matches!(id_size, 0 | 1 | 2 | 4 | 8) {
                return Err(format!("records with numbers of {id_size} bytes"));
            }
            all.push(Self { groups, id_size, data: block.link(2) });
            at = block.link(0);
        }
        Ok(all)
    }

    /// Reads all records. Records before damage are kept.
    ///
    /// # Errors
    ///
    /// Description of the damage.
    pub(super) fn read<R: Read + Seek>(
        &mut self,
        file: &mut Blocks<R>,
        is_unfinished: bool,
    ) -> Result<(), Damage> {
        let read = self.read_parts(file, is_unfinished);
        self.groups.iter_mut().for_each(Group::finish);
        read
    }

    /// Whether the records are stored by columns, which is not supported.
    ///
    /// # Errors
    ///
    /// Description of the damage.
    pub(super) fn is_by_columns<R: Read + Seek>(
        &self,
        file: &mut Blocks<R>,
    ) -> Result<bool, Damage> {
        is_by_columns(file, self.data)
    }

    fn read_parts<R: Read + Seek>(
        &mut self,
        file: &mut Blocks<R>,
        is_unfinished: bool,
    ) -> Result<(), Damage> {
        let mut parts = Parts::at(file, self.data, is_unfinished)?;
        let mut bytes: Vec<u8> = Vec::new();
        while !self.is_read() {
            let Some(part) = parts.next(file)? else { break };
            bytes.extend(part);
            let used = self.records(&bytes)?;
            bytes.drain(..used);
        }
        Ok(())
    }

    fn is_read(&self) -> bool {
        self.groups.iter().all(|g| !g.is_wanted() || g.read >= g.cycles)
    }

    /// Reads whole records from the beginning of `bytes`; returns the number of bytes used.
    fn records(&mut self, bytes: &[u8]) -> Result<usize, Damage> {
        let mut at = 0;
        loop {
            let Some(after) = bytes.get(at + self.id_size..) else { return Ok(at) };
            let id = number(bytes, at, self.id_size);
            let group = match self.id_size {
                0 => self.groups.first_mut(),
                _ => self.groups.iter_mut().find(|g| g.id == id),
            };
            let group =
                group.ok_or_else(|| format!("a record of a group {id}, which there is not"))?;
            let size = match group.is_text {
                true if after.len() < 4 => return Ok(at),
                true => 4 + number(after, 0, 4) as usize,
                false => group.record,
            };
            if size == 0 || size as u64 > LARGEST_RECORD {
                return Err(format!("a record of {size} bytes"));
            }
            let Some(record) = after.get(..size) else { return Ok(at) };
            group.keep(record);
            at += self.id_size + size;
        }
    }
}

impl Group {
    fn at<R: Read + Seek>(
        file: &mut Blocks<R>,
        at: u64,
        channels: &mut usize,
    ) -> Result<(Self, u64), Damage> {
        let block = file.next(at, b"##CG")?;
        let data = block.number(24, 4);
        let record = data + block.number(28, 4);
        let is_text = block.number(16, 2) & 1 == 1;
        let mut group = Self {
            // a damaged name is ignored
            name: file.text(block.link(2)).unwrap_or_default(),
            time: None,
            fields: Vec::new(),
            other_master: None,
            lacks: None,
            unread: BTreeMap::new(),
            id: block.number(0, 8),
            data: data as usize,
            record: record as usize,
            is_text,
            cycles: block.number(8, 8),
            expected: 0,
            recording: Recording::new(0, usize::MAX),
            scale: None,
            refused: None,
            timeless: 0,
            read: 0,
        };
        group.channels(file, block.link(1), "", channels, 0)?;
        Ok((group, block.link(0)))
    }

    /// Reads a list of channels with their sub-channels.
    fn channels<R: Read + Seek>(
        &mut self,
        file: &mut Blocks<R>,
        first: u64,
        prefix: &str,
        count: &mut usize,
        depth: u32,
    ) -> Result<(), Damage> {
        let mut at = first;
        while at != 0 {
            let block = file.next(at, b"##CN")?;
            *count += 1;
            if *count > MOST_CHANNELS {
                return Err(format!("it has more than {MOST_CHANNELS} channels"));
            }
            if depth > DEEPEST {
                return Err(format!("channels are nested more than {DEEPEST} deep"));
            }
            at = block.link(0);
            let Ok(name) = file.text(block.link(2)) else {
                *self.unread.entry("their names are damaged".into()).or_default() += 1;
                continue;
            };
            let name = match prefix.is_empty() {
                true => name,
                false => format!("{prefix}.{name}"),
            };
            let parts = block.link(1);
            let found = match file.head(parts) {
                _ if parts == 0 => kind(file, &block, &name, self.data),
                Ok(head) if head.id == *b"##CN" => {
                    self.channels(file, parts, &name, count, depth + 1)?;
                    continue;
                }
                Ok(_) => Kind::Unread("an array".into()),
                Err(damage) => Kind::Unread(damage),
            };
            match found {
                Kind::Time(field) if self.time.is_none() => self.time = Some(field),
                Kind::Time(field) | Kind::Signal(field) => self.fields.push(field),
                Kind::OtherMaster(what) => self.other_master = Some(what),
                Kind::Unread(what) => *self.unread.entry(what).or_default() += 1,
            }
        }
        Ok(())
    }

    /// Whether the group has a signal and a time.
    pub(super) fn is_wanted(&self) -> bool {
        self.time.is_some() && !self.fields.is_empty() && !self.is_text
    }

    /// Expected count of numbers in its records, including the times.
    pub(super) fn numbers(&self) -> u64 {
        self.expected.saturating_mul(self.fields.len() as u64 + 1)
    }

    /// Bounds the expected number of records by the bytes of data. An interrupted recording has no count: the bound
    /// applies.
    pub(super) fn expect(&mut self, bytes: u64, is_unfinished: bool) {
        let most = bytes.checked_div(self.record as u64).unwrap_or(0);
        self.cycles = if is_unfinished { u64::MAX } else { self.cycles };
        self.expected = self.cycles.min(most);
    }

    /// Uses the channel named by a mapping as the time. Scale and unit apply only to groups with that channel; other
    /// groups have no time then.
    pub(super) fn choose_time(&mut self, stated: Option<&TimeColumn>) {
        let wanted = stated.and_then(|s| s.column.as_deref());
        let is_master = |w: &str| self.time.as_ref().is_some_and(|t| t.is_named(w));
        let mut is_own = true;
        if let Some(wanted) = wanted.filter(|w| !is_master(w)) {
            is_own = false;
            let place = self.fields.iter().position(|f| f.is_named(wanted));
            let field = place.map(|place| self.fields.remove(place));
            if field.is_none() {
                self.lacks = Some(wanted.into());
            }
            self.fields.extend(std::mem::replace(&mut self.time, field));
        }
        // the format defines its times in seconds
        let seconds = |read: &Heading| {
            (is_own && read.unit.is_none() && read.unknown_unit.is_none()).then_some(1.0)
        };
        let scale = |t: &Field| TimeScale::new(&t.heading, &t.read, stated, seconds(&t.read));
        self.scale = self.time.as_ref().map(scale);
    }

    /// Headings of its channels.
    pub(super) fn headings(&self) -> Vec<String> {
        self.time.iter().chain(&self.fields).map(|f| f.heading.clone()).collect()
    }

    /// Whether the group lacks the time channel that a mapping names.
    pub(super) fn lacks_time(&self) -> bool {
        self.lacks.is_some()
    }

    /// Adds remarks about the parts left out.
    pub(super) fn add_remarks(&self, is_unfinished: bool, remarks: &mut Vec<String>) {
        let name = match (self.name.is_empty(), self.fields.first()) {
            (false, _) => self.name.clone(),
            (true, Some(field)) => format!("the group of {}", field.heading),
            (true, None) => "a group".into(),
        };
        if !self.fields.is_empty() && self.time.is_none() {
            remarks.push(match (&self.lacks, self.other_master) {
                (Some(wanted), _) => {
                    format!("{name} has no channel \"{wanted}\", the time: it is left out")
                }
                (_, Some(what)) => {
                    format!("{name} is sampled at {what}, not at times: it is left out")
                }
                (None, None) => format!("{name} has no time: it is left out"),
            });
        }
        for (what, count) in &self.unread {
            remarks.push(format!("{count} channels of {name} are left out: {what}"));
        }
        remarks.extend(self.scale.as_ref().and_then(|s| s.remark.clone()));
        if let Some(reason) = &self.refused {
            remarks.push(format!("{name} is left out: {reason}"));
        }
        if self.timeless > 0 {
            remarks
                .push(format!("{} records of {name} have no time and are left out", self.timeless));
        }
        if self.is_wanted() && self.read < self.cycles && !is_unfinished {
            remarks.push(format!("{name} has {} records of {}", self.read, self.cycles));
        }
    }

    fn keep(&mut self, record: &[u8]) {
        let Some(time) = self.time.as_ref().filter(|_| self.read < self.cycles) else { return };
        let of = |field: &Field| field.of(record, self.data, self.read);
        let mut row: Vec<f64> = std::iter::once(time).chain(&self.fields).map(of).collect();
        self.read += 1;
        if !row[0].is_finite() {
            self.timeless += 1;
            return;
        }
        let (Some(scale), None) = (&mut self.scale, &self.refused) else { return };
        let recording = &mut self.recording;
        let kept = scale.push(self.read, &mut row, |line, row| recording.push(line, row));
        self.refused = kept.err();
    }

    /// Finishes the group after its last record.
    fn finish(&mut self) {
        let (Some(scale), None) = (&mut self.scale, &self.refused) else { return };
        let recording = &mut self.recording;
        self.refused = scale.finish(|line, row| recording.push(line, row)).err();
    }
}
