//! MDF 4 files: those that asammdf writes (`make.py`), and by hand what it does not.

pub mod written;

use self::written::File;
use crate::temporary::folder;
use hydroboom_measurement::{Mapping, Measurement, Signal, Signals, TimeColumn, Unit, read};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

fn recorded(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/integration/mdf/files").join(name)
}

fn path(name: &str, content: &[u8]) -> PathBuf {
    let path = folder(module_path!()).join(name);
    std::fs::write(&path, content).unwrap();
    path
}

fn refused(name: &str, content: &[u8]) -> String {
    read(&path(name, content), None).unwrap_err().to_string()
}

/// Units, times and values that asammdf reads, by channel; NaN where one is invalid.
fn expected(name: &str) -> BTreeMap<String, (String, Vec<(f64, f64)>)> {
    let mut channels = BTreeMap::new();
    for line in std::fs::read_to_string(recorded(name)).unwrap().lines() {
        let cells: Vec<&str> = line.split(',').collect();
        let value = cells[3].parse().unwrap_or(f64::NAN);
        let (_, samples): &mut (String, Vec<_>) =
            channels.entry(cells[0].into()).or_insert((cells[1].into(), Vec::new()));
        samples.push((cells[2].parse().unwrap(), value));
    }
    channels
}

fn is_as_expected(log: &Measurement, name: &str) {
    let expected = expected(name);
    for (heading, (unit, samples)) in &expected {
        let channel = log.channel(heading).unwrap_or_else(|| panic!("no {heading}"));
        assert_eq!(channel.unit.map_or("", |u| u.name), unit, "{heading}");
        assert_eq!(channel.values.len(), samples.len(), "{heading}");
        for (k, (time, value)) in samples.iter().enumerate() {
            assert_eq!(channel.time[k], *time, "{heading}");
            let found = channel.values[k];
            assert!(
                (found - value).abs() <= 1e-14 * value.abs() || found.is_nan() && value.is_nan(),
                "{heading}: {found} for {value}"
            );
        }
    }
    assert_eq!(log.channels.len(), expected.len(), "{}", log.headings());
}

#[test]
fn every_compression_gives_the_same_numbers() {
    for name in ["plain", "deflate", "transposed", "zstd", "transposed_lz4", "list", "packed_list"]
    {
        let log = read(&recorded(&format!("{name}.mf4")), None).unwrap();
        is_as_expected(&log, "crane.csv");
        assert!(log.remarks.is_empty(), "{name}: {:?}", log.remarks);
        // each group has its own time
        assert_eq!(log.channel("oil").unwrap().time.len(), 12);
        let signals = Signals::of(&log, &Mapping::guess(&log)).unwrap();
        let at = |signal| signals.get(signal).unwrap().at(0.1).unwrap();
        assert!((at(Signal::Stroke) - 60e-3).abs() < 1e-9);
        assert!((at(Signal::PressureA) - 63e5).abs() < 1e-3);
        assert!((at(Signal::MotorSpeed) + 20.0 / 60.0).abs() < 1e-9);
    }
}

#[test]
fn conversions_states_and_invalid_samples_agree_with_asammdf() {
    let log = read(&recorded("conversions.mf4"), None).unwrap();
    is_as_expected(&log, "conversions.csv");
    for wanted in ["of varying length", "an array"] {
        assert!(log.remarks.iter().any(|r| r.contains(wanted)), "{:?}", log.remarks);
    }
}

#[test]
fn range_and_value_conversions_agree_with_asammdf() {
    is_as_expected(&read(&recorded("parts.mf4"), None).unwrap(), "parts.csv");
}

/// Records of two groups and of texts lie among each other, each with the number of its group.
fn unsorted(file: &mut File) -> (u64, u64) {
    let mut data = Vec::new();
    for k in 0..40_u8 {
        data.extend([1]);
        data.extend((f64::from(k) * 0.01).to_le_bytes());
        data.extend([k, 2 * k]);
        if k % 4 == 0 {
            data.extend([2]);
            data.extend((f64::from(k) * 0.01).to_le_bytes());
            data.extend((f32::from(k) * 0.5).to_be_bytes());
            data.extend([3, 5, 0, 0, 0]);
            data.extend(b"moves");
        }
    }
    let texts = file.group(0, 0, [3, 10, 0], true);
    let slow = file.channel(0, "p_A", "bar", [0, 5, 8, 32]);
    let slow = file.channel(slow, "t", "s", [2, 4, 0, 64]);
    let slow = file.group(texts, slow, [2, 10, 12], false);
    let fast = file.channel(0, "stroke", "mm", [0, 1, 8, 16]);
    let fast = file.channel(fast, "t", "s", [2, 4, 0, 64]);
    let fast = file.group(slow, fast, [1, 40, 10], false);
    let data = file.block("##DT", &[], &data);
    (fast, data)
}

#[test]
fn interleaved_records_are_separated() {
    let mut file = File::new("MDF     ", "4.10");
    let (group, data) = unsorted(&mut file);
    let log = read(&path("unsorted.mf4", &file.finish(group, data, 1)), None).unwrap();
    assert_eq!(log.headings(), "stroke, p_A");
    assert_eq!(log.channels[0].values[3], f64::from(3 * 256 + 6));
    assert_eq!((log.channels[1].time[2], log.channels[1].values[2]), (0.08, 4.0));
    assert_eq!((log.channels[0].values.len(), log.channels[1].values.len()), (40, 10));
}

#[test]
fn an_interrupted_recording_is_read_to_its_end() {
    let mut file = File::new("UnFinMF ", "4.10");
    let channel = file.channel(0, "stroke", "mm", [0, 0, 8, 8]);
    let channel = file.channel(channel, "t", "s", [2, 4, 0, 64]);
    // neither the records nor the length of the data were counted
    let group = file.group(0, channel, [0, 0, 9], false);
    let at = (file.bytes.len().next_multiple_of(8) + 56 + 16) as u64;
    let mut bytes = file.finish(group, at.next_multiple_of(8), 0);
    bytes.resize(at.next_multiple_of(8) as usize, 0);
    bytes.extend(b"##DT\0\0\0\0");
    bytes.extend([24_u64.to_le_bytes(), 0_u64.to_le_bytes()].concat());
    for k in 0..25_u8 {
        bytes.extend((f64::from(k) * 0.01).to_le_bytes());
        bytes.extend([k]);
    }
    bytes.extend([1, 2, 3]);
    let log = read(&path("interrupted.mf4", &bytes), None).unwrap();
    assert_eq!(log.channels[0].values.len(), 25);
    assert!(log.remarks.iter().any(|r| r.contains("interrupted")), "{:?}", log.remarks);
}

#[test]
fn another_channel_may_be_the_time() {
    let time = |column: &str| TimeColumn { column: Some(column.into()), ..TimeColumn::default() };
    let stroke = TimeColumn { unit: Unit::from_text("s").ok(), ..time("stroke") };
    let log = read(&recorded("plain.mf4"), Some(&stroke)).unwrap();
    assert_eq!(log.channel("p_A").unwrap().time[5], 55.0);
    let message = read(&recorded("plain.mf4"), Some(&time("stroke"))).unwrap_err().to_string();
    assert!(message.contains("mm is a length, not a time"), "{message}");
    let message = read(&recorded("plain.mf4"), Some(&time("nowhere"))).unwrap_err().to_string();
    assert!(message.contains("nowhere") && message.contains("motor_speed"), "{message}");
}

#[test]
fn unreadable_files_and_channels_are_reported() {
    let message = refused("old.mf4", &File::new("MDF     ", "3.30").finish(0, 0, 0));
    assert!(message.contains("version 3.30"), "{message}");
    let message = refused("empty.mf4", &File::new("MDF     ", "4.10").finish(0, 0, 0));
    assert!(message.contains("no signal"), "{message}");
    assert!(refused("head.mf4", b"MDF     4.10    ").contains("no block"));
    // without a time, and with an angle in its place
    for (kind, sync, wanted) in [(0, 0, "has no time"), (2, 2, "sampled at an angle")] {
        let mut file = File::new("MDF     ", "4.10");
        let channel = file.channel(0, "stroke", "mm", [0, 0, 8, 8]);
        let channel = file.channel(channel, "t", "s", [kind, 4, 0, 64]);
        let sync_at = channel as usize + 24 + 64 + 1;
        file.bytes[sync_at] = sync;
        let group = file.group(0, channel, [0, 3, 9], false);
        let data = file.block("##DT", &[], &[0; 27]);
        let message = refused("timeless.mf4", &file.finish(group, data, 0));
        assert!(message.contains(wanted), "{message}");
    }
    // what was whole is kept
    let whole = std::fs::read(recorded("list.mf4")).unwrap();
    let last = whole.windows(4).rposition(|w| w == b"##DT").unwrap();
    let mut damaged = whole.clone();
    damaged[last + 2] = b'X';
    let log = read(&path("damaged.mf4", &damaged), None).unwrap();
    assert!(log.remarks.iter().any(|r| r.contains("up to there")), "{:?}", log.remarks);
}

#[test]
fn reading_a_cyclic_list_terminates() {
    let mut file = File::new("MDF     ", "4.10");
    let channel = file.channel(0, "stroke", "mm", [0, 0, 8, 8]);
    let channel = file.channel(channel, "t", "s", [2, 4, 0, 64]);
    let group = file.group(0, channel, [0, u64::MAX, 9], false);
    let times: Vec<u8> =
        (0..3_u8).flat_map(|k| [f64::from(k).to_le_bytes().to_vec(), vec![k]].concat()).collect();
    let data = file.block("##DT", &[], &times);
    let here = file.bytes.len().next_multiple_of(8) as u64;
    let list = file.block("##DL", &[here, data, data], &[0; 8]);
    let log = read(&path("loop.mf4", &file.finish(group, list, 0)), None).unwrap();
    assert_eq!(log.channels[0].values, [0.0, 1.0, 2.0]);
    assert!(log.remarks.iter().any(|r| r.contains("two links")), "{:?}", log.remarks);
}

#[test]
fn a_compressed_block_of_large_declared_size_is_refused() {
    let mut file = File::new("MDF     ", "4.10");
    let channel = file.channel(0, "stroke", "mm", [0, 0, 8, 8]);
    let channel = file.channel(channel, "t", "s", [2, 4, 0, 64]);
    let group = file.group(0, channel, [0, 1 << 40, 9], false);
    let mut packed = b"DT\0\0\0\0\0\0".to_vec();
    packed.extend([3_u64 << 30, 8].iter().flat_map(|n| n.to_le_bytes()));
    packed.extend([0; 8]);
    let data = file.block("##DZ", &[], &packed);
    let message = refused("bomb.mf4", &file.finish(group, data, 0));
    assert!(message.contains("a packed block of 3072 MB"), "{message}");
}

/// A link of a channel is changed: 4 to its conversion, 6 to its unit.
fn link(file: &mut File, channel: u64, place: usize, to: u64) {
    let at = channel as usize + 24 + 8 * place;
    file.bytes[at..at + 8].copy_from_slice(&to.to_le_bytes());
}

/// A conversion: way, numbers, and where texts and other conversions stand.
fn conversion(file: &mut File, way: u8, values: &[f64], references: &[u64]) -> u64 {
    let mut data = vec![way, 0, 0, 0];
    data.extend((references.len() as u16).to_le_bytes());
    data.extend((values.len() as u16).to_le_bytes());
    data.extend([0; 16]);
    data.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    file.block("##CC", &[&[0; 4], references].concat(), &data)
}

/// Two groups: one with a clock of 16 bits in addition to its own time, one without.
fn with_a_clock(unit: &str) -> Vec<u8> {
    let mut file = File::new("MDF     ", "4.10");
    let slow = file.channel(0, "p_A", "bar", [0, 0, 8, 8]);
    let slow = file.channel(slow, "t", "s", [2, 4, 0, 64]);
    let slow = file.group(0, slow, [2, 20, 9], false);
    let fast = file.channel(0, "stroke", "mm", [0, 0, 8, 8]);
    let fast = file.channel(fast, "clock", unit, [0, 0, 9, 16]);
    let fast = file.channel(fast, "t", "s", [2, 4, 0, 64]);
    let fast = file.group(slow, fast, [1, 20, 11], false);
    let mut data = Vec::new();
    for k in 0..20_u16 {
        let time = f64::from(k).to_le_bytes();
        data.extend([&[1], &time[..], &[k as u8], &(10 * k).to_le_bytes()].concat());
        data.extend([&[2], &time[..], &[k as u8]].concat());
    }
    let data = file.block("##DT", &[], &data);
    file.finish(fast, data, 1)
}

#[test]
fn a_mapped_time_applies_to_groups_that_contain_it() {
    let clock = TimeColumn { column: Some("clock".into()), ..TimeColumn::default() };
    // by its unit, as the mapping says, and by its numbers
    let milliseconds = TimeColumn { unit: Unit::from_text("ms").ok(), ..clock.clone() };
    for (unit, time) in [("ms", &clock), ("", &milliseconds), ("", &clock)] {
        let log = read(&path("clock.mf4", &with_a_clock(unit)), Some(time)).unwrap();
        assert_eq!(log.headings(), "stroke, t");
        assert!((log.channels[0].time[7] - 0.07).abs() < 1e-12, "{}", log.channels[0].time[7]);
        let says = |what: &str| log.remarks.iter().any(|r| r.contains(what));
        assert!(says("the group of p_A has no channel \"clock\""), "{:?}", log.remarks);
        assert_eq!(says("taken as ms"), unit.is_empty() && time.unit.is_none());
    }
    let message =
        read(&path("clock.mf4", &with_a_clock("bar")), Some(&clock)).unwrap_err().to_string();
    assert!(message.contains("bar is a pressure, not a time"), "{message}");
    // of the groups' own times a scale is for all
    let scaled = TimeColumn { scale: 0.5, ..TimeColumn::default() };
    let log = read(&path("clock.mf4", &with_a_clock("")), Some(&scaled)).unwrap();
    assert!(log.channels.iter().all(|c| c.time[8] == 4.0) && log.channels.len() == 3);
}

#[test]
fn each_range_has_its_own_conversion() {
    let mut file = File::new("MDF     ", "4.10");
    let channel = file.channel(0, "p_A", "bar", [0, 0, 8, 16]);
    let with_time = file.channel(channel, "t", "s", [2, 4, 0, 64]);
    let linear = conversion(&mut file, 1, &[0.0, 0.125], &[]);
    let error = file.text("error");
    let ends = [0.0, 64_255.0, 64_256.0, 65_535.0];
    let parts = conversion(&mut file, 8, &ends, &[linear, error, 0]);
    link(&mut file, channel, 4, parts);
    let group = file.group(0, with_time, [0, 4, 10], false);
    let record =
        |(k, raw): (u8, u16)| [&f64::from(k).to_le_bytes()[..], &raw.to_le_bytes()].concat();
    let data: Vec<u8> = (0..).zip([8000, 64_255, 64_256, 65_535]).flat_map(record).collect();
    let data = file.block("##DT", &[], &data);
    let log = read(&path("parts.mf4", &file.finish(group, data, 0)), None).unwrap();
    let values = &log.channels[0].values;
    assert_eq!(values[..2], [1000.0, 8031.875]);
    assert!(values[2].is_nan() && values[3].is_nan(), "{values:?}");
}

/// Three records of a position in a file that `change` may modify; it receives the position of the channel's block.
fn three(change: impl FnOnce(&mut File, u64) -> Option<u64>) -> Vec<u8> {
    let mut file = File::new("MDF     ", "4.10");
    let stroke = file.channel(0, "stroke", "mm", [0, 0, 8, 8]);
    let channel = file.channel(stroke, "t", "s", [2, 4, 0, 64]);
    let group = file.group(0, channel, [0, 3, 9], false);
    let records: Vec<u8> =
        (0..3_u8).flat_map(|k| [&f64::from(k).to_le_bytes()[..], &[k]].concat()).collect();
    let data = file.block("##DT", &[], &records);
    let data = change(&mut file, stroke).unwrap_or(data);
    file.finish(group, data, 0)
}

#[test]
fn an_error_in_one_part_does_not_affect_others() {
    // a unit that cannot be read is none that may be guessed
    let damaged = three(|file, stroke| {
        link(file, stroke, 6, 7);
        None
    });
    let log = read(&path("unit.mf4", &damaged), None).unwrap();
    assert_eq!(log.channels[0].values, [0.0, 1.0, 2.0]);
    assert!(log.channels[0].unknown_unit.is_some());
    for (place, wanted) in [(2, "their names are damaged"), (1, "at byte 7 is no block")] {
        let damaged = three(|file, stroke| {
            link(file, stroke, place, 7);
            let other = file.channel(0, "p_A", "bar", [0, 0, 8, 8]);
            link(file, stroke, 0, other);
            None
        });
        let log = read(&path("part.mf4", &damaged), None).unwrap();
        assert_eq!(log.headings(), "p_A");
        assert!(log.remarks.iter().any(|r| r.contains(wanted)), "{:?}", log.remarks);
    }
    let by_columns = three(|file, _| Some(file.block("##LD", &[0, 0], &[0; 16])));
    let message = refused("columns.mf4", &by_columns);
    assert!(message.contains("stored by columns") && !message.contains("damaged"), "{message}");
    let nested = three(|file, stroke| {
        let parts = |inner, _| {
            let outer = file.channel(0, "a", "", [0, 0, 8, 8]);
            link(file, outer, 1, inner);
            outer
        };
        let parts = (0..9).fold(0, parts);
        link(file, stroke, 1, parts);
        None
    });
    let message = refused("nested.mf4", &nested);
    assert!(message.contains("nested more than 8 deep"), "{message}");
    // as many links as leave no room for the address of what follows them
    let many = three(|file, _| {
        let data = file.block("##DT", &[], &[0; 27]);
        let at = data as usize;
        file.bytes[at + 8..at + 16].copy_from_slice(&u64::MAX.to_le_bytes());
        file.bytes[at + 16..at + 24].copy_from_slice(&((u64::MAX - 24) / 8).to_le_bytes());
        Some(data)
    });
    assert!(refused("links.mf4", &many).contains("no signal"));
}

/// A time given by the record index, and one byte that never changes: four million records are compressed
/// into some hundred bytes.
#[test]
fn highly_compressed_records_are_all_read() {
    let count = 4_000_000_u64;
    let mut file = File::new("MDF     ", "4.20");
    let stroke = file.channel(0, "stroke", "mm", [0, 0, 0, 8]);
    let time = file.channel(stroke, "t", "s", [3, 0, 0, 0]);
    file.bytes[time as usize + 24 + 64 + 1] = 1;
    let milliseconds = conversion(&mut file, 1, &[0.0, 1e-3], &[]);
    link(&mut file, time, 4, milliseconds);
    let group = file.group(0, time, [0, count, 1], false);
    let records = zstd::encode_all(&vec![5; count as usize][..], 19).unwrap();
    let mut packed = b"DT\x02\0\0\0\0\0".to_vec();
    packed.extend([count, records.len() as u64].iter().flat_map(|n| n.to_le_bytes()));
    packed.extend(records);
    let data = file.block("##DZ", &[], &packed);
    let bytes = file.finish(group, data, 0);
    assert!(bytes.len() < 2000, "{}", bytes.len());
    let log = read(&path("constant.mf4", &bytes), None).unwrap();
    let stroke = log.channel("stroke").unwrap();
    assert!(stroke.values.iter().all(|v| *v == 5.0));
    let end = stroke.time[stroke.time.len() - 1];
    assert!(
        (end - 4000.0).abs() < 0.1,
        "{end} s of {} values, {:?}",
        stroke.values.len(),
        log.remarks
    );
}
