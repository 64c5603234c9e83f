//! Reader of an MCAP file's messages within bounded memory; damage is detected and reported.

use super::records::{Chunk, Fields, MAGIC, Message, Schema, Topic, code};
use crate::decompress::{self, Packing};
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::io::Read;
use std::rc::Rc;

/// Largest size of a record, and of a decompressed chunk \[bytes\].
const LARGEST: u64 = 128 << 20;
/// Largest number of channels, and of schemas.
const MOST_CHANNELS: usize = 10_000;
/// Largest total size of channel names and schemas \[bytes\].
const MOST_DESCRIPTIONS: usize = 64 << 20;
/// Buffer size for skipping \[bytes\].
const PART: u64 = 1 << 16;

/// Parts of an MCAP file that could not be read: truncation, damaged chunks and damaged messages.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Loss {
    /// Whether the file is truncated.
    pub is_cut_off: bool,
    /// Number of damaged chunks, which are left out.
    pub chunks: u64,
    /// Smallest and largest log time of the damaged chunks \[ns\]; none where unknown.
    pub span: Option<(u64, u64)>,
    /// Number of messages that are damaged or belong to no channel.
    pub messages: u64,
    /// Reason why the part after a damaged place cannot be read; none if reading went on to the end.
    pub rest: Option<String>,
    /// Damage of the first damaged chunk; none without one.
    pub chunk_reason: Option<String>,
    /// Damage of the first damaged message; none without one.
    pub message_reason: Option<String>,
}

/// Reason why reading an MCAP file is aborted.
#[derive(Debug)]
pub enum Stop {
    /// The file cannot be read.
    File(std::io::Error),
    /// The file is not an MCAP file, or uses an unsupported feature; a sentence without the file's name.
    Format(String),
}

impl Loss {
    /// Whether the whole file was read, without any loss.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Whether chunks or messages are damaged; truncation alone does not count.
    pub fn is_damage(&self) -> bool {
        !Self { is_cut_off: false, ..self.clone() }.is_none()
    }

    /// One sentence for each kind of loss, for the user; empty without loss.
    pub fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        if self.is_cut_off {
            remarks.push("it was cut off: it is read up to there".into());
        }
        if self.chunks > 0 {
            let span = self.span.map_or(String::new(), |(from, to)| {
                format!(", of {:.3} s", (to.saturating_sub(from)) as f64 * 1e-9)
            });
            let reason = self.chunk_reason.as_deref().unwrap_or("damaged");
            remarks.push(format!("{} damaged chunks are left out{span} ({reason})", self.chunks));
        }
        if self.messages > 0 {
            let reason = self.message_reason.as_deref().unwrap_or("damaged");
            remarks.push(format!("{} damaged messages are left out ({reason})", self.messages));
        }
        if let Some(rest) = &self.rest {
            remarks.push(format!("it is damaged, and read up to there: {rest}"));
        }
        remarks
    }

    /// Counts a damaged chunk with its range of log times, if known.
    fn chunk(&mut self, span: Option<(u64, u64)>, reason: String) {
        self.chunks += 1;
        // a chunk without messages states zero
        if let Some((begin, end)) = span.filter(|span| *span != (0, 0)) {
            let (from, to) = self.span.unwrap_or((begin, end));
            self.span = Some((from.min(begin), to.max(end)));
        }
        self.chunk_reason.get_or_insert(reason);
    }

    fn message(&mut self, reason: &str) {
        self.messages += 1;
        self.message_reason.get_or_insert(reason.into());
    }
}

/// Reads an MCAP file (mcap.dev/spec) and calls `each` with every message, in the file's order. Memory is bounded;
/// damaged parts are skipped and returned.
///
/// # Errors
///
/// [`Stop`] if the file is not an MCAP file or exceeds the memory bounds, and the errors of `each`.
pub fn messages(
    source: impl Read,
    each: impl FnMut(&Message<'_>) -> Result<(), Stop>,
) -> Result<Loss, Stop> {
    let mut source = Hashed { source, crc: crc32fast::Hasher::new() };
    let begins = source.bytes(MAGIC.len() as u64)?;
    if begins != MAGIC {
        return Err(Stop::Format("it does not begin as an MCAP file does".into()));
    }
    let mut reader = Reader {
        each,
        schemas: HashMap::new(),
        channels: HashMap::new(),
        described: 0,
        loss: Loss::default(),
        unpacked: Vec::new(),
        has_unchecked: false,
    };
    loop {
        let crc = source.crc.clone();
        let head = source.bytes(9)?;
        let Some((code, length)) = Fields(&head).head() else {
            reader.loss.is_cut_off = true;
            break;
        };
        // a chunk that its writer did not complete
        if code == code::CHUNK && length == u64::MAX {
            reader.loss.is_cut_off = true;
            break;
        }
        let is_large = length > LARGEST;
        let too_large =
            || format!("a record of {} MB where {} MB are the most", length >> 20, LARGEST >> 20);
        if is_large && !code::is_unbounded(code) {
            reader.loss.rest = Some(too_large());
            break;
        }
        if code::is_unneeded(code) {
            if source.skip(length)? == length {
                continue;
            }
            match is_large {
                // no writer produces such a record: its length is damaged
                true => reader.loss.rest = Some(too_large()),
                false => reader.loss.is_cut_off = true,
            }
            break;
        }
        let record = source.bytes(length)?;
        if (record.len() as u64) < length {
            reader.loss.is_cut_off = true;
            break;
        }
        match code {
            code::CHUNK => reader.chunk(&record)?,
            code::DATA_END => {
                reader.check(&record, crc.finalize())?;
                break;
            }
            code::FOOTER => break,
            0 => {
                reader.loss.rest = Some("a record of no kind".into());
                break;
            }
            _ => {
                reader.has_unchecked |= code == code::MESSAGE;
                reader.record(code, &record)?;
            }
        }
    }
    Ok(reader.loss)
}

/// A file reader that computes the checksum of the data read.
struct Hashed<R> {
    source: R,
    crc: crc32fast::Hasher,
}

impl<R: Read> Hashed<R> {
    /// Reads bytes; fewer at the end of the file. Allocates no more than the file's size.
    fn bytes(&mut self, count: u64) -> Result<Vec<u8>, Stop> {
        let mut bytes = Vec::new();
        self.source.by_ref().take(count).read_to_end(&mut bytes).map_err(Stop::File)?;
        self.crc.update(&bytes);
        Ok(bytes)
    }

    /// Skips bytes up to the end of the file; returns the number skipped.
    fn skip(&mut self, count: u64) -> Result<u64, Stop> {
        let mut skipped = 0;
        while skipped < count {
            match self.bytes((count - skipped).min(PART))?.len() as u64 {
                0 => break,
                part => skipped += part,
            }
        }
        Ok(skipped)
    }
}

struct Reader<F> {
    each: F,
    schemas: HashMap<u16, Rc<Schema>>,
    channels: HashMap<u16, Rc<Topic>>,
    /// Total size of channel names and schemas \[bytes\].
    described: usize,
    loss: Loss,
    /// Records of the current chunk.
    unpacked: Vec<u8>,
    /// Whether a message was covered only by the file's checksum.
    has_unchecked: bool,
}

impl<F: FnMut(&Message<'_>) -> Result<(), Stop>> Reader<F> {
    /// Compares the checksum that the data's end states with that of the data read.
    fn check(&self, record: &[u8], found: u32) -> Result<(), Stop> {
        let stated = Fields(record).u32().unwrap_or(0);
        // damaged chunks are reported already; chunks with a valid checksum are sound
        if stated != 0 && stated != found && self.has_unchecked {
            return Err(Stop::Format(
                "its checksum does not match its messages: some of them are damaged, and cannot be told from \
                 the others"
                    .into(),
            ));
        }
        Ok(())
    }

    fn record(&mut self, code: u8, data: &[u8]) -> Result<(), Stop> {
        match code {
            code::SCHEMA => {
                let Some((id, schema)) = Fields(data).schema() else {
                    self.loss.message("a schema that is too short");
                    return Ok(());
                };
                if let Entry::Vacant(place) = self.schemas.entry(id) {
                    let Schema { name, encoding, data } = &schema;
                    let size = name.len() + encoding.len() + data.len();
                    place.insert(Rc::new(schema));
                    self.describe(size)?;
                }
            }
            code::CHANNEL => {
                let Some((id, schema, name, encoding)) = Fields(data).channel() else {
                    self.loss.message("a channel that is too short");
                    return Ok(());
                };
                let schema = self.schemas.get(&schema).map(Rc::clone);
                if let Entry::Vacant(place) = self.channels.entry(id) {
                    let size = name.len() + encoding.len();
                    place.insert(Rc::new(Topic { name, encoding, schema }));
                    self.describe(size)?;
                }
            }
            code::MESSAGE => {
                let Some((channel, log_time, data)) = Fields(data).message() else {
                    self.loss.message("a message that is too short");
                    return Ok(());
                };
                match self.channels.get(&channel) {
                    Some(topic) => (self.each)(&Message { topic, log_time, data })?,
                    None => self.loss.message("a channel that is not described"),
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Counts a new channel or schema of `size` bytes.
    fn describe(&mut self, size: usize) -> Result<(), Stop> {
        self.described += size;
        let many = |what| Err(Stop::Format(format!("it has more than {what}")));
        match (self.channels.len(), self.schemas.len()) {
            (channels, _) if channels > MOST_CHANNELS => many(format!("{MOST_CHANNELS} channels")),
            (_, schemas) if schemas > MOST_CHANNELS => many(format!("{MOST_CHANNELS} schemas")),
            _ if self.described > MOST_DESCRIPTIONS => {
                many(format!("{} MB of schemas and names", MOST_DESCRIPTIONS >> 20))
            }
            _ => Ok(()),
        }
    }

    fn chunk(&mut self, record: &[u8]) -> Result<(), Stop> {
        let Some(chunk) = Fields(record).chunk() else {
            self.loss.chunk(None, "the head of a chunk does not fit its size".into());
            return Ok(());
        };
        if chunk.size > LARGEST {
            return Err(Stop::Format(format!(
                "a chunk of {} MB (unpacked): chunks are read whole, up to {} MB; write it anew with smaller ones (mcap \
                 compress --chunk-size 4000000 IN -o OUT)",
                chunk.size >> 20,
                LARGEST >> 20
            )));
        }
        let mut unpacked = std::mem::take(&mut self.unpacked);
        match unpack(&chunk, &mut unpacked) {
            Ok(()) => {
                self.has_unchecked |= chunk.crc == 0;
                let mut fields = Fields(&unpacked);
                while !fields.0.is_empty() {
                    match fields.record() {
                        Some((code, data)) => self.record(code, data)?,
                        None => {
                            self.loss.message("a record that is longer than its chunk");
                            break;
                        }
                    }
                }
            }
            Err(reason) if reason.starts_with(UNKNOWN) => return Err(Stop::Format(reason)),
            Err(reason) => self.loss.chunk(Some((chunk.begin, chunk.end)), reason),
        }
        self.unpacked = unpacked;
        Ok(())
    }
}

const UNKNOWN: &str = "chunks packed with";

/// Decompresses a chunk and verifies its checksum.
fn unpack(chunk: &Chunk<'_>, unpacked: &mut Vec<u8>) -> Result<(), String> {
    let packing = match chunk.compression {
        "" => None,
        "zstd" => Some(Packing::Zstd),
        "lz4" => Some(Packing::Lz4),
        other => return Err(format!("{UNKNOWN} \"{other}\" are not read: zstd and lz4 are")),
    };
    match packing {
        Some(packing) => decompress::unpack(packing, chunk.records, chunk.size, unpacked)?,
        None if chunk.records.len() as u64 != chunk.size => {
            return Err(format!("it has not the {} bytes that it says", chunk.size));
        }
        None => {
            unpacked.clear();
            unpacked.extend(chunk.records);
        }
    }
    if chunk.crc != 0 && chunk.crc != crc32fast::hash(unpacked) {
        return Err("its checksum does not match".into());
    }
    Ok(())
}

impl Fields<'_> {
    /// Operation code and length of a record.
    fn head(mut self) -> Option<(u8, u64)> {
        let (code, rest) = self.0.split_first()?;
        self.0 = rest;
        Some((*code, self.u64()?))
    }
}
