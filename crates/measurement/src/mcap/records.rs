//! Records of an MCAP file, after its specification (mcap.dev/spec): an operation code, a length, fields.

use std::rc::Rc;

/// First and last bytes of a file.
pub(crate) const MAGIC: [u8; 8] = [0x89, b'M', b'C', b'A', b'P', b'0', b'\r', b'\n'];

/// Operation codes of records.
pub(super) mod code {
    pub(in crate::mcap) const FOOTER: u8 = 0x02;
    pub(in crate::mcap) const SCHEMA: u8 = 0x03;
    pub(in crate::mcap) const CHANNEL: u8 = 0x04;
    pub(in crate::mcap) const MESSAGE: u8 = 0x05;
    pub(in crate::mcap) const CHUNK: u8 = 0x06;
    pub(in crate::mcap) const DATA_END: u8 = 0x0f;
    const ATTACHMENT: u8 = 0x09;
    const METADATA: u8 = 0x0c;
    /// Codes that the format defines; codes from `PRIVATE` on belong to applications.
    const KNOWN: std::ops::RangeInclusive<u8> = 0x01..=0x0f;
    const PRIVATE: u8 = 0x80;

    /// Whether a record of a known kind is not needed for reading messages.
    pub(in crate::mcap) fn is_unneeded(code: u8) -> bool {
        let is_known = KNOWN.contains(&code) || code >= PRIVATE;
        is_known && !matches!(code, FOOTER | SCHEMA | CHANNEL | MESSAGE | CHUNK | DATA_END)
    }

    /// Whether a record without messages may have any size, for example an attachment. A large index is a sign of
    /// damage.
    pub(in crate::mcap) fn is_unbounded(code: u8) -> bool {
        matches!(code, ATTACHMENT | METADATA) || code >= PRIVATE
    }
}

/// Schema of a channel's messages.
#[derive(Debug, PartialEq, Eq, Hash)]
pub struct Schema {
    /// Name of the message type, such as `sensor_msgs/msg/JointState`.
    pub name: String,
    /// Schema language, such as `jsonschema` or `ros2msg`.
    pub encoding: String,
    /// Text of the schema, as bytes.
    pub data: Vec<u8>,
}

/// Topic of a channel, with encoding and schema of its messages.
#[derive(Debug, PartialEq, Eq, Hash)]
pub struct Topic {
    /// Name of the topic.
    pub name: String,
    /// Encoding of its messages, such as `json` or `cdr`.
    pub encoding: String,
    /// Schema of its messages; none if the file has none.
    pub schema: Option<Rc<Schema>>,
}

/// Message of an MCAP file.
pub struct Message<'a> {
    /// Topic of the message.
    pub topic: &'a Rc<Topic>,
    /// Time of logging \[ns\], from an epoch of the writer's choice, often the Unix epoch.
    pub log_time: u64,
    /// Encoded content of the message.
    pub data: &'a [u8],
}

/// Header of a chunk, and its compressed records.
pub(super) struct Chunk<'a> {
    pub(super) begin: u64,
    pub(super) end: u64,
    pub(super) size: u64,
    pub(super) crc: u32,
    pub(super) compression: &'a str,
    pub(super) records: &'a [u8],
}

/// Reader of a record's fields; each call returns `None` if the record is too short.
pub(super) struct Fields<'a>(pub(super) &'a [u8]);

impl<'a> Fields<'a> {
    fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (bytes, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(bytes)
    }

    pub(super) fn u16(&mut self) -> Option<u16> {
        Some(u16::from_le_bytes(*self.bytes(2)?.first_chunk()?))
    }

    pub(super) fn u32(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(*self.bytes(4)?.first_chunk()?))
    }

    pub(super) fn u64(&mut self) -> Option<u64> {
        Some(u64::from_le_bytes(*self.bytes(8)?.first_chunk()?))
    }

    fn text(&mut self) -> Option<&'a str> {
        let length = self.u32()? as usize;
        std::str::from_utf8(self.bytes(length)?).ok()
    }

    /// The next record within a chunk.
    pub(super) fn record(&mut self) -> Option<(u8, &'a [u8])> {
        let code = *self.bytes(1)?.first()?;
        let length = usize::try_from(self.u64()?).ok()?;
        Some((code, self.bytes(length)?))
    }

    pub(super) fn schema(mut self) -> Option<(u16, Schema)> {
        let (id, name, encoding) = (self.u16()?, self.text()?.into(), self.text()?.into());
        let length = self.u32()? as usize;
        Some((id, Schema { name, encoding, data: self.bytes(length)?.to_vec() }))
    }

    /// Id, schema id (zero for none), topic and encoding of a channel.
    pub(super) fn channel(mut self) -> Option<(u16, u16, String, String)> {
        Some((self.u16()?, self.u16()?, self.text()?.into(), self.text()?.into()))
    }

    /// Channel id, log time and data of a message.
    pub(super) fn message(mut self) -> Option<(u16, u64, &'a [u8])> {
        let (channel, _sequence, log_time) = (self.u16()?, self.u32()?, self.u64()?);
        let _publish_time = self.u64()?;
        Some((channel, log_time, self.0))
    }

    pub(super) fn chunk(mut self) -> Option<Chunk<'a>> {
        let (begin, end, size) = (self.u64()?, self.u64()?, self.u64()?);
        let (crc, compression) = (self.u32()?, self.text()?);
        let length = usize::try_from(self.u64()?).ok()?;
        Some(Chunk { begin, end, size, crc, compression, records: self.bytes(length)? })
    }
}
