//! Memory does not grow with the length of a log.
//!
//! `HYDROBOOM_ROWS=100000000 cargo test -p hydroboom-measurement --release --test memory` reads longer ones.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

#[path = "integration/mdf/written.rs"]
mod mdf_file;

use hydroboom_measurement::read;
use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Numbers that are more than are kept.
const NUMBERS: usize = 24_000_000;
/// Largest memory of reading \[kB\]: 160 MB of numbers, twice while the arrays grow, and the test's own needs.
const MOST_MEMORY: u64 = 500_000;

/// Rows, and signals of each.
fn size() -> (usize, usize) {
    let rows = std::env::var("HYDROBOOM_ROWS").ok().and_then(|rows| rows.parse().ok());
    let rows = rows.unwrap_or(400_000);
    (rows, (NUMBERS / rows).max(3))
}

fn memory() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|l| l.split_whitespace().next()?.parse().ok()).unwrap_or(0)
}

fn written(name: &str, write: impl Fn(&Path)) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    write(&path);
    path
}

/// The mean of a ramp is kept at any number of averaged rows.
fn is_averaged(path: &Path, rows: usize) {
    let log = read(path, None).unwrap();
    std::fs::remove_file(path).unwrap();
    let ramp = log.channels[0].range().unwrap();
    let mean = 0.5 * (rows - 1) as f64;
    assert!((ramp.mean / mean - 1.0).abs() < 1e-2, "{} for {mean}", ramp.mean);
    assert!(log.remarks.iter().any(|r| r.contains("averaged")), "{:?}", log.remarks);
    let kilobytes = memory();
    assert!(kilobytes < MOST_MEMORY, "{kilobytes} kB");
}

// a single test, since the memory of the whole process is measured
#[test]
fn long_logs_are_averaged_within_bounded_memory() {
    mdf();
    let (rows, signals) = size();
    let mcap = written(&format!("{rows}.mcap"), |path| {
        let options = WriteOptions::new().compression(Some(Compression::Zstd));
        let mut writer = options.create(BufWriter::new(File::create(path).unwrap())).unwrap();
        let channel = writer.add_channel(0, "/crane", "json", &BTreeMap::new()).unwrap();
        let mut text = String::new();
        for k in 0..rows {
            text.clear();
            write!(text, "{{\"a\":{k}").unwrap();
            for signal in 1..signals {
                write!(text, ",\"b{signal}\":{}", k % 100).unwrap();
            }
            text.push('}');
            let time = k as u64 * 1_000_000;
            let header = MessageHeader {
                channel_id: channel,
                sequence: 0,
                log_time: time,
                publish_time: time,
            };
            writer.write_to_known_channel(&header, text.as_bytes()).unwrap();
        }
        writer.finish().unwrap();
    });
    is_averaged(&mcap, rows);
    late_fields();
    let csv = written(&format!("{rows}.csv"), |path| {
        let mut file = BufWriter::new(File::create(path).unwrap());
        let names: Vec<String> = (1..signals).map(|k| format!("b{k}")).collect();
        writeln!(file, "t,a,{}", names.join(",")).unwrap();
        let mut text = String::new();
        for k in 0..rows {
            text.clear();
            write!(text, "{:.3},{k}", k as f64 * 1e-3).unwrap();
            for _ in 1..signals {
                write!(text, ",{}", k % 100).unwrap();
            }
            writeln!(file, "{text}").unwrap();
        }
        file.flush().unwrap();
    });
    is_averaged(&csv, rows);
}

/// Messages to which many fields come late.
fn late_fields() {
    let (rows, fields) = (1_000_000_u64, 100);
    let path = written("late_fields.mcap", |path| {
        let options = WriteOptions::new().compression(Some(Compression::Zstd));
        let mut writer = options.create(BufWriter::new(File::create(path).unwrap())).unwrap();
        let channel = writer.add_channel(0, "/crane", "json", &BTreeMap::new()).unwrap();
        let late: String = (0..fields).map(|k| format!(",\"b{k}\":{k}")).collect();
        for k in 0..=rows {
            let (sequence, log_time) = (0, k * 1_000_000);
            let header =
                MessageHeader { channel_id: channel, sequence, log_time, publish_time: log_time };
            let late = if k == rows { late.as_str() } else { "" };
            let text = format!("{{\"a\":{k}{late}}}");
            writer.write_to_known_channel(&header, text.as_bytes()).unwrap();
        }
        writer.finish().unwrap();
    });
    is_averaged(&path, rows as usize);
}

/// An MDF file, which is written from memory: of one length.
fn mdf() {
    let (rows, signals) = (400_000_u32, 60_u32);
    let path = written("long.mf4", |path| {
        let mut file = mdf_file::File::new("MDF     ", "4.10");
        let mut channels = 0;
        for k in (0..signals).rev() {
            channels = file.channel(
                channels,
                &format!("a{k}"),
                "",
                [0, 0, 8 + k, if k == 0 { 32 } else { 8 }],
            );
        }
        let channels = file.channel(channels, "t", "s", [2, 4, 0, 64]);
        let size = u64::from(8 + signals + 3);
        let group = file.group(0, channels, [0, u64::from(rows), size], false);
        let record = |k: u32| {
            let mut record = (f64::from(k) * 1e-3).to_le_bytes().to_vec();
            record.extend(k.to_le_bytes());
            record.resize(size as usize, k as u8);
            record
        };
        let data: Vec<u8> = (0..rows).flat_map(record).collect();
        let data = file.block("##DT", &[], &data);
        std::fs::write(path, file.finish(group, data, 0)).unwrap();
    });
    is_averaged(&path, rows as usize);
}
