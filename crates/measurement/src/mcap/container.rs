//! Messages of an MCAP file, one after the other, within bounded memory; what is damaged is found and told.

use super::records::{Chunk, Fields, MAGIC, Message, Schema, Topic, code};
use std::collections::HashMap;
use std::io::Read;
use std::rc::Rc;

/// Bytes of a record, and of a chunk when unpacked, at most.
const LARGEST: u64 = 128 << 20;
/// Channels and schemas of a file, at most.
const MOST_CHANNELS: usize = 10_000;

/// What could not be read of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Loss {
    /// Whether the file ends before its data do.
    pub is_cut_off: bool,
    /// Chunks that are damaged, and are left out.
    pub chunks: u64,
    /// From when to when they were logged, as far as they say \[ns\].
    pub span: Option<(u64, u64)>,
    /// Messages that belong to no channel, or are damaged themselves.
    pub messages: u64,
    /// Why the rest of the file cannot be read, where it is damaged in between.
    pub rest: Option<String>,
    /// What was wrong first.
    pub reason: Option<String>,
}

/// Why a file is not read any further.
#[derive(Debug)]
pub enum Stop {
    /// It cannot be read.
    File(std::io::Error),
    /// It is none, or none that can be read; a sentence without its name.
    Format(String),
}

impl Loss {
    /// Whether everything was read.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Whether something is damaged: not the end alone is missing.
    pub fn is_damage(&self) -> bool {
        !Self { is_cut_off: false, ..self.clone() }.is_none()
    }

    /// A sentence for each loss.
    pub fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        if self.is_cut_off {
            remarks.push("it was cut off: it is read up to there".into());
        }
        let reason = self.reason.as_deref().unwrap_or("damaged");
        if self.chunks > 0 {
            let span = self.span.map_or(String::new(), |(from, to)| {
                format!(", of {:.3} s", (to.saturating_sub(from)) as f64 * 1e-9)
            });
            remarks.push(format!("{} damaged chunks are left out{span} ({reason})", self.chunks));
        }
        if self.messages > 0 {
            remarks.push(format!("{} damaged messages are left out ({reason})", self.messages));
        }
        if let Some(rest) = &self.rest {
            remarks.push(format!("it is damaged, and read up to there: {rest}"));
        }
        remarks
    }

    fn chunk(&mut self, begin: u64, end: u64, reason: String) {
        self.chunks += 1;
        let (from, to) = self.span.unwrap_or((begin, end));
        self.span = Some((from.min(begin), to.max(end)));
        self.reason.get_or_insert(reason);
    }

    fn message(&mut self, reason: &str) {
        self.messages += 1;
        self.reason.get_or_insert(reason.into());
    }
}

/// Calls with every message, in the file's order.
///
/// # Errors
///
/// [`Stop`] when it is no MCAP file or cannot be read within bounded memory, and what `each` returns.
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
        // a chunk that its writer did not live to finish
        if code == code::CHUNK && length == u64::MAX {
            reader.loss.is_cut_off = true;
            break;
        }
        if length > LARGEST {
            let reason =
                format!("a record of {} MB where {} MB are the most", length >> 20, LARGEST >> 20);
            reader.loss.rest = Some(reason);
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
                let stated = Fields(&record).u32().unwrap_or(0);
                let is_damaged = stated != 0 && stated != crc.finalize();
                // chunks that are damaged are told already; those with a checksum of their own are sound
                if is_damaged && reader.has_unchecked {
                    return Err(Stop::Format(
                        "its checksum does not match its messages: some of them are damaged, and cannot be told from \
                         the others"
                            .into(),
                    ));
                }
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

/// A file whose checksum is counted on the way.
struct Hashed<R> {
    source: R,
    crc: crc32fast::Hasher,
}

impl<R: Read> Hashed<R> {
    /// Bytes of a file; fewer where it ends. No more memory is taken than the file has bytes.
    fn bytes(&mut self, count: u64) -> Result<Vec<u8>, Stop> {
        let mut bytes = Vec::new();
        self.source.by_ref().take(count).read_to_end(&mut bytes).map_err(Stop::File)?;
        self.crc.update(&bytes);
        Ok(bytes)
    }
}

struct Reader<F> {
    each: F,
    schemas: HashMap<u16, Rc<Schema>>,
    channels: HashMap<u16, Rc<Topic>>,
    loss: Loss,
    /// Records of the chunk that is read.
    unpacked: Vec<u8>,
    /// Whether a message had no checksum but the file's.
    has_unchecked: bool,
}

impl<F: FnMut(&Message<'_>) -> Result<(), Stop>> Reader<F> {
    fn record(&mut self, code: u8, data: &[u8]) -> Result<(), Stop> {
        match code {
            code::SCHEMA => {
                let Some((id, schema)) = Fields(data).schema() else {
                    self.loss.message("a schema that is too short");
                    return Ok(());
                };
                self.schemas.entry(id).or_insert_with(|| Rc::new(schema));
            }
            code::CHANNEL => {
                let Some((id, schema, name, encoding)) = Fields(data).channel() else {
                    self.loss.message("a channel that is too short");
                    return Ok(());
                };
                let schema = self.schemas.get(&schema).map(Rc::clone);
                let topic = || Rc::new(Topic { name, encoding, schema });
                self.channels.entry(id).or_insert_with(topic);
                if self.channels.len() > MOST_CHANNELS {
                    return Err(Stop::Format(format!("it has more than {MOST_CHANNELS} channels")));
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

    fn chunk(&mut self, record: &[u8]) -> Result<(), Stop> {
        let Some(chunk) = Fields(record).chunk() else {
            self.loss.chunk(0, 0, "the head of a chunk does not fit its size".into());
            return Ok(());
        };
        if chunk.size > LARGEST {
            return Err(Stop::Format(format!(
                "a chunk of {} MB (unpacked): chunks are read whole, up to {} MB; write it anew with smaller ones (mcap \
                 convert --chunk-size 4000000)",
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
            Err(reason) => self.loss.chunk(chunk.begin, chunk.end, reason),
        }
        self.unpacked = unpacked;
        Ok(())
    }
}

const UNKNOWN: &str = "chunks packed with";

/// Unpacks a chunk and compares its checksum.
fn unpack(chunk: &Chunk<'_>, unpacked: &mut Vec<u8>) -> Result<(), String> {
    let size = usize::try_from(chunk.size).map_err(|e| e.to_string())?;
    unpacked.clear();
    match chunk.compression {
        "" => unpacked.extend(chunk.records),
        "zstd" => {
            // memory is taken as it is filled: a damaged size takes none
            let mut decoder = zstd::stream::read::Decoder::with_buffer(chunk.records)
                .map_err(|e| e.to_string())?;
            decoder.window_log_max(27).map_err(|e| e.to_string())?;
            decoder.take(chunk.size + 1).read_to_end(unpacked).map_err(|e| e.to_string())?;
        }
        "lz4" => {
            let decoder = lz4_flex::frame::FrameDecoder::new(chunk.records);
            decoder.take(chunk.size + 1).read_to_end(unpacked).map_err(|e| e.to_string())?;
        }
        other => return Err(format!("{UNKNOWN} \"{other}\" are not read: zstd and lz4 are")),
    }
    if unpacked.len() != size {
        return Err(format!("unpacked it has not the {size} bytes that it says"));
    }
    if chunk.crc != 0 && chunk.crc != crc32fast::hash(unpacked) {
        return Err("its checksum does not match".into());
    }
    Ok(())
}

impl Fields<'_> {
    /// Code and length of a record.
    fn head(mut self) -> Option<(u8, u64)> {
        let (code, rest) = self.0.split_first()?;
        self.0 = rest;
        Some((*code, self.u64()?))
    }
}
