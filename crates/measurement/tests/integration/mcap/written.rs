//! MCAP files, for the tests: by the library of the format's makers, and record by record where that would not write
//! them.

use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions, Writer};
use std::collections::BTreeMap;
use std::io::Cursor;

/// A channel: topic, encoding of messages, and name, encoding and text of the schema.
pub struct Channel<'a> {
    pub topic: &'a str,
    pub encoding: &'a str,
    pub schema: (&'a str, &'a str, &'a str),
}

/// JSON messages need no schema.
pub fn json(topic: &str) -> Channel<'_> {
    Channel { topic, encoding: "json", schema: ("State", "jsonschema", "{}") }
}

/// ROS 2 messages.
pub fn ros2<'a>(topic: &'a str, name: &'a str, text: &'a str) -> Channel<'a> {
    Channel { topic, encoding: "cdr", schema: (name, "ros2msg", text) }
}

/// How a file is written.
pub fn options() -> WriteOptions {
    WriteOptions::new().compression(Some(Compression::Zstd)).chunk_size(Some(2000))
}

/// A file of messages: number of the channel, time \[ns\], data.
pub fn file(
    options: WriteOptions,
    channels: &[Channel],
    messages: &[(usize, u64, Vec<u8>)],
) -> Vec<u8> {
    let mut writer: Writer<Cursor<Vec<u8>>> = options.create(Cursor::new(Vec::new())).unwrap();
    let ids: Vec<u16> = channels
        .iter()
        .map(|c| {
            let (name, encoding, text) = c.schema;
            let schema = match encoding {
                "" => 0,
                _ => writer.add_schema(name, encoding, text.as_bytes()).unwrap(),
            };
            writer.add_channel(schema, c.topic, c.encoding, &BTreeMap::new()).unwrap()
        })
        .collect();
    for (channel, time, data) in messages {
        let header = MessageHeader {
            channel_id: ids[*channel],
            sequence: 0,
            log_time: *time,
            publish_time: *time,
        };
        writer.write_to_known_channel(&header, data).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

/// A record: code, length, fields.
pub fn record(code: u8, fields: &[u8]) -> Vec<u8> {
    let mut bytes = vec![code];
    bytes.extend((fields.len() as u64).to_le_bytes());
    bytes.extend(fields);
    bytes
}

/// A text with its length.
pub fn text(text: &str) -> Vec<u8> {
    let mut bytes = (text.len() as u32).to_le_bytes().to_vec();
    bytes.extend(text.as_bytes());
    bytes
}

/// A channel without a schema, and a message of it, as they stand in a chunk.
pub fn channel_and_messages(topic: &str, messages: &[(u64, &str)]) -> Vec<u8> {
    let channel = [vec![1, 0, 0, 0], text(topic), text("json"), vec![0; 4]].concat();
    let mut records = record(4, &channel);
    for (time, data) in messages {
        let head = [&[1, 0, 0, 0, 0, 0][..], &time.to_le_bytes(), &time.to_le_bytes()].concat();
        records.extend(record(5, &[&head[..], data.as_bytes()].concat()));
    }
    records
}

/// A file of one chunk with a given size and checksum.
pub fn one_chunk(compression: &str, size: u64, crc: u32, packed: &[u8]) -> Vec<u8> {
    let mut chunk = vec![0; 16];
    chunk.extend(size.to_le_bytes());
    chunk.extend(crc.to_le_bytes());
    chunk.extend(text(compression));
    chunk.extend((packed.len() as u64).to_le_bytes());
    chunk.extend(packed);
    let magic = b"\x89MCAP0\r\n";
    [&magic[..], &record(6, &chunk), &record(15, &[0; 4])].concat()
}
