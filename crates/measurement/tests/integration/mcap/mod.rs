//! MCAP logs as people have them: several topics, nested messages, ROS 2's, and damaged ones.

pub mod written;

use self::written::{
    Channel, channel_and_messages, file, json, one_chunk, options, record, ros2, text,
};
use crate::temporary::folder;
use hydroboom_measurement::{Mapping, Measurement, Signal, Signals, TimeColumn, read};
use std::io::Read;
use std::path::PathBuf;

/// A time of logging: 14 November 2023.
const EPOCH: u64 = 1_700_000_000_000_000_000;
const PERIOD: u64 = 10_000_000;

fn path(name: &str, content: &[u8]) -> PathBuf {
    let path = folder(module_path!()).join(name);
    std::fs::write(&path, content).unwrap();
    path
}

fn log(name: &str, content: &[u8]) -> Measurement {
    read(&path(name, content), None).unwrap()
}

fn refused(name: &str, content: &[u8]) -> String {
    read(&path(name, content), None).unwrap_err().to_string()
}

/// JSON messages of one topic at 100 Hz.
fn course(count: u64, message: impl Fn(u64) -> String) -> Vec<(usize, u64, Vec<u8>)> {
    (0..count).map(|k| (0, EPOCH + k * PERIOD, message(k).into_bytes())).collect()
}

fn plain(count: u64) -> Vec<(usize, u64, Vec<u8>)> {
    course(count, |k| format!("{{\"stroke_mm\": {}, \"on\": true, \"state\": \"moves\"}}", 50 + k))
}

#[test]
fn topics_with_the_same_fields_are_both_addressed_by_topic() {
    let mut messages = Vec::new();
    for k in 0..20 {
        for (topic, sign) in [(0, 1.0), (1, -1.0)] {
            let text = format!("{{\"position_mm\": {}, \"pressure_a\": 5}}", sign * f64::from(k));
            messages.push((topic, EPOCH + u64::from(k as u32) * PERIOD, text.into_bytes()));
        }
        messages.push((2, EPOCH + u64::from(k as u32) * PERIOD, b"{\"speed_rpm\": 7}".to_vec()));
    }
    let log = log(
        "topics.mcap",
        &file(options(), &[json("/cyl1"), json("/cyl2"), json("/drive")], &messages),
    );
    assert_eq!(
        log.headings(),
        "/cyl1.position_mm, /cyl1.pressure_a, /cyl2.position_mm, /cyl2.pressure_a, speed_rpm"
    );
    // which cylinder is meant is not guessed
    assert!(!Mapping::guess(&log).entries.contains_key(&Signal::Stroke));
    let text = "[log]\nstroke = \"/cyl2.position_mm\"\n";
    let signals = Signals::of(&log, &Mapping::parse("map.toml", text).unwrap()).unwrap();
    let stroke = signals.get(Signal::Stroke).unwrap().at(0.055).unwrap();
    assert!((stroke + 5.5e-3).abs() < 1e-9, "{stroke}");
}

#[test]
fn nested_messages_are_flattened_and_later_fields_are_kept() {
    let messages = course(20, |k| {
        let late = if k < 10 { String::new() } else { format!(", \"late_bar\": {k}") };
        format!(
            "{{\"cyl\": {{\"stroke_mm\": {k}, \"p\": [1, {k}]}}, \"motor_speed_rpm\": 0{late}}}"
        )
    });
    let log = log("nested.mcap", &file(options(), &[json("/crane")], &messages));
    assert_eq!(log.headings(), "cyl.stroke_mm, cyl.p[0], cyl.p[1], motor_speed_rpm, late_bar");
    let late = &log.channel("late_bar").unwrap().values;
    assert!(late[9].is_nan() && late[10] == 10.0);
    // nanoseconds of the clock are not lost
    assert_eq!(log.channels[0].time[7], 0.07);
}

#[test]
fn a_nan_of_python_is_a_missing_sample_and_a_broken_message_is_counted() {
    let messages = course(20, |k| match k {
        4 => "{\"stroke_mm\": NaN, \"x\": -Infinity}".into(),
        7 => "{\"stroke_mm\": 5".into(),
        _ => format!("{{\"stroke_mm\": {k}, \"x\": 1}}"),
    });
    let log = log("nan.mcap", &file(options(), &[json("/crane")], &messages));
    assert_eq!(log.channels[0].values.len(), 18);
    assert!(log.remarks.iter().any(|r| r.starts_with("1 messages on /crane")), "{:?}", log.remarks);
    let with_nan = course(20, |k| match k {
        4 => "{\"stroke_mm\": NaN, \"x\": 2}".into(),
        _ => format!("{{\"stroke_mm\": {k}, \"x\": 1}}"),
    });
    let log = self::log("nan.mcap", &file(options(), &[json("/crane")], &with_nan));
    assert_eq!(log.channels[0].range().unwrap().missing, 1);
    assert_eq!(log.channels[1].range().unwrap().missing, 0);
}

#[test]
fn a_clock_set_back_starts_a_segment_and_strays_are_left_out() {
    let mut messages = plain(900);
    for k in 0..900 {
        // the clock of the second half restarts; one of its messages arrives late
        let time = EPOCH + if k == 500 { 0 } else { k } * PERIOD;
        messages.push((0, time, format!("{{\"stroke_mm\": {}}}", 950 + k).into_bytes()));
    }
    let log = log("reset.mcap", &file(options(), &[json("/crane")], &messages));
    let stroke = log.channel("stroke_mm").unwrap();
    assert_eq!((*stroke.breaks).to_vec(), [900]);
    assert_eq!(stroke.values.len(), 1799);
    assert!((stroke.segments()[1].end - stroke.segments()[1].begin - 8.99).abs() < 1e-9);
    for wanted in ["the clock goes back", "1 rows whose time is out of order"] {
        assert!(log.remarks.iter().any(|r| r.contains(wanted)), "{:?}", log.remarks);
    }
}

/// Bytes of CDR, little endian, each number at a multiple of its size.
#[derive(Default)]
struct Cdr(Vec<u8>);

impl Cdr {
    fn put(mut self, bytes: &[u8]) -> Self {
        self.0.resize(self.0.len().next_multiple_of(bytes.len()), 0);
        self.0.extend(bytes);
        self
    }

    fn u32(self, value: u32) -> Self {
        self.put(&value.to_le_bytes())
    }

    fn f64s(self, values: &[f64]) -> Self {
        let counted = self.u32(values.len() as u32);
        values.iter().fold(counted, |cdr, v| cdr.put(&v.to_le_bytes()))
    }

    fn text(self, text: &str) -> Self {
        let mut cdr = self.u32(text.len() as u32 + 1);
        cdr.0.extend(text.as_bytes());
        cdr.0.push(0);
        cdr
    }

    fn message(self) -> Vec<u8> {
        [vec![0, 1, 0, 0], self.0].concat()
    }
}

const HEADER: &str = "\n================================================================================\n\
    MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n\
    ================================================================================\n\
    MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";

#[test]
fn ros_2_messages_are_read_by_their_schemas() {
    let joints = format!(
        "# the state of joints\nstd_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n\
         float64[] effort{HEADER}"
    );
    let channels = [
        ros2("/joint_states", "sensor_msgs/msg/JointState", &joints),
        ros2("/pressure_a_bar", "std_msgs/msg/Float64", "float64 data"),
        ros2(
            "/strange",
            "crane_msgs/msg/State",
            "uint8 MODE=1\nbool on\nint16 n\nfloat32[2] x\nuint8[] picture",
        ),
    ];
    let mut messages = Vec::new();
    for k in 0..20_u32 {
        let x = f64::from(k);
        let head = Cdr::default().u32(1_700_000_000).u32(k * 20_000_000).text("base");
        let joints =
            head.u32(2).text("boom").text("cylinder").f64s(&[0.1, x]).f64s(&[]).f64s(&[0.0, 5.0]);
        messages.push((0, EPOCH + u64::from(k) * PERIOD, joints.message()));
        let pressure = Cdr::default().put(&(68.0 + x).to_le_bytes());
        messages.push((1, EPOCH + u64::from(k) * PERIOD, pressure.message()));
        let strange = Cdr::default().put(&[1]).put(&(-3_i16).to_le_bytes());
        let strange = strange.put(&1.5_f32.to_le_bytes()).put(&2.5_f32.to_le_bytes());
        let strange = (0..1000).fold(strange.u32(1000), |cdr, _| cdr.put(&[7]));
        messages.push((2, EPOCH + u64::from(k) * PERIOD, strange.message()));
    }
    let path = path("ros2.mcap", &file(options(), &channels, &messages));
    let log = read(&path, None).unwrap();
    let values = |name: &str| {
        &log.channel(name).unwrap_or_else(|| panic!("{name} in {}", log.headings())).values
    };
    assert_eq!(values("position[cylinder]")[7], 7.0);
    assert_eq!(values("position[boom]")[7], 0.1);
    assert_eq!(values("effort[cylinder]")[7], 5.0);
    assert_eq!(values("/pressure_a_bar")[7], 75.0);
    assert_eq!(log.channel("/pressure_a_bar").unwrap().unit.map(|u| u.name), Some("bar"));
    assert_eq!((values("on")[0], values("n")[0], values("x[1]")[0]), (1.0, -3.0, 2.5));
    // a stamp may be the time: it runs half as fast here
    let time = TimeColumn { column: Some("header.stamp".into()), ..TimeColumn::default() };
    let stamped = read(&path, Some(&time)).unwrap();
    assert_eq!(stamped.channel("position[boom]").unwrap().time[7], 0.14);
    let scaled = TimeColumn { scale: 2.0, offset: 3.0, ..time };
    let scaled = read(&path, Some(&scaled)).unwrap();
    let scaled = scaled.channel("position[boom]").unwrap().time[7];
    // stamps are since 1970 and shown from the first one: the offset is taken off with it
    assert!((scaled - 0.28).abs() < 1e-6, "{scaled}");
    assert!(stamped.channel("/pressure_a_bar").is_none());
    assert!(stamped.remarks.iter().any(|r| r.contains("have no time")), "{:?}", stamped.remarks);
}

#[test]
fn unread_topics_are_named_with_encoding_and_schema() {
    let foreign = |encoding, schema| Channel { topic: "/crane", encoding, schema };
    let messages: Vec<_> = (0..5).map(|k| (0, EPOCH + k, vec![0, 1, 0, 0, 5])).collect();
    for (encoding, schema, wanted) in [
        ("protobuf", ("foxglove.Pose", "protobuf", ""), "protobuf, protobuf foxglove.Pose"),
        ("cdr", ("crane_msgs/msg/State", "ros2idl", ""), "cdr, ros2idl crane_msgs/msg/State"),
        ("cbor", ("", "", ""), "cbor without a schema"),
        ("cdr", ("a/msg/B", "ros2msg", "float64 x"), "shorter than its schema says"),
        ("cdr", ("a/msg/B", "ros2msg", "Unknown x"), "does not say what a/Unknown is"),
    ] {
        let message =
            refused("foreign.mcap", &file(options(), &[foreign(encoding, schema)], &messages));
        assert!(message.contains("5 messages on /crane") && message.contains(wanted), "{message}");
    }
}

#[test]
fn damaged_chunks_are_reported_and_intact_ones_kept() {
    let whole = file(options(), &[json("/crane")], &plain(500));
    let log = log("whole.mcap", &whole);
    assert_eq!(log.channels[0].values.len(), 500);
    // wherever a byte in the data changes, no value does: it is missing, and that is reported
    let packed = whole.windows(4).enumerate().filter(|(_, w)| *w == [0x28, 0xb5, 0x2f, 0xfd]);
    let chunks: Vec<usize> = packed.map(|(at, _)| at).collect();
    assert!(chunks.len() > 5);
    for at in [chunks[2] + 30, chunks[4] + 100] {
        let mut damaged = whole.clone();
        damaged[at] ^= 0x10;
        let log = self::log("damaged.mcap", &damaged);
        let channel = &log.channels[0];
        assert!(
            channel.values.len() < 500 && channel.values.len() > 300,
            "{}",
            channel.values.len()
        );
        for (time, value) in channel.time.iter().zip(&channel.values) {
            assert!((value - 50.0 - time * 100.0).abs() < 1e-6, "{value} at {time}");
        }
        assert!(log.remarks.iter().any(|r| r.contains("damaged chunks")), "{:?}", log.remarks);
    }
    // where a record's length is damaged, the next one cannot be found
    let mut lengthy = whole.clone();
    lengthy[chunks[3] - 45] ^= 0x10;
    let log = self::log("lengthy.mcap", &lengthy);
    assert!(log.remarks.iter().any(|r| r.contains("up to there")), "{:?}", log.remarks);
    let log = self::log("cut_off.mcap", &whole[..whole.len() / 2]);
    assert!(log.remarks.iter().any(|r| r.contains("cut off")), "{:?}", log.remarks);
    let message = refused("eight.mcap", &whole[..8]);
    assert!(
        message.contains("no topic has two messages") && message.contains("cut off"),
        "{message}"
    );
    // messages outside of chunks have the file's checksum only
    let mut open = file(options().use_chunks(false), &[json("/crane")], &plain(50));
    assert_eq!(self::log("open.mcap", &open).channels[0].values.len(), 50);
    let five = open.windows(5).position(|w| w == b": 75,").unwrap();
    open[five + 2] = b'9';
    let message = refused("open.mcap", &open);
    assert!(message.contains("checksum"), "{message}");
}

#[test]
fn a_chunk_of_large_declared_size_takes_no_memory() {
    let small = channel_and_messages("/crane", &[(0, "{\"x\": 1}"), (PERIOD, "{\"x\": 2}")]);
    let packed = zstd::encode_all(&small[..], 3).unwrap();
    let message = refused("bomb.mcap", &one_chunk("zstd", 3 << 30, 0, &packed));
    assert!(message.contains("a chunk of 3072 MB") && message.contains("128 MB"), "{message}");
    // one that is more than it says ends where that is
    let bomb = zstd::encode_all(std::io::repeat(0).take(64 << 20), 3).unwrap();
    assert!(bomb.len() < 100_000);
    let message = refused("liar.mcap", &one_chunk("zstd", 1000, 0, &bomb));
    assert!(message.contains("has not the 1000 bytes"), "{message}");
    // a record that is longer than the file
    let mut long = b"\x89MCAP0\r\n".to_vec();
    long.extend(&record(5, &[0; 30])[..20]);
    assert!(refused("long.mcap", &long).contains("cut off"));
}

#[test]
fn chunks_are_read_with_every_compression() {
    use std::io::Write;
    let records = channel_and_messages("/crane", &[(0, "{\"x\": 1}"), (PERIOD, "{\"x\": 2}")]);
    let crc = crc32fast::hash(&records);
    let zstd = zstd::encode_all(&records[..], 3).unwrap();
    let mut lz4 = lz4_flex::frame::FrameEncoder::new(Vec::new());
    lz4.write_all(&records).unwrap();
    let lz4 = lz4.finish().unwrap();
    for (compression, packed) in [("", &records), ("zstd", &zstd), ("lz4", &lz4)] {
        let log = log("packed.mcap", &one_chunk(compression, records.len() as u64, crc, packed));
        assert_eq!(log.channels[0].values, [1.0, 2.0], "{compression}");
    }
    let message = refused("brotli.mcap", &one_chunk("brotli", 10, 0, &[0; 10]));
    assert!(message.contains("brotli"), "{message}");
}

#[test]
fn the_unit_of_a_time_field_follows_from_its_name_or_numbers() {
    let messages = course(200, |k| {
        format!(
            "{{\"timestamp\": {}, \"clock_us\": {}, \"x_mm\": {k}}}",
            1_700_000_000_000 + 20 * k,
            20_000 * k
        )
    });
    let path = path("field.mcap", &file(options(), &[json("/crane")], &messages));
    let named = |column: &str| TimeColumn { column: Some(column.into()), ..TimeColumn::default() };
    for (column, expected) in [("timestamp", "milliseconds since 1970"), ("clock_us", "")] {
        let log = read(&path, Some(&named(column))).unwrap();
        let time = &log.channel("x_mm").unwrap().time;
        assert_eq!(time.len(), 200);
        assert!((time[150] - 3.0).abs() < 1e-6, "{column}: {}", time[150]);
        let is_reported =
            log.remarks.iter().any(|r| r.contains("has no unit") && r.contains(expected));
        assert_eq!(is_reported, !expected.is_empty(), "{:?}", log.remarks);
    }
    let message = read(&path, Some(&named("x_mm"))).unwrap_err().to_string();
    assert!(message.contains("mm is a length, not a time"), "{message}");
    // few messages are judged too
    let few = file(options(), &[json("/crane")], &messages[..3]);
    std::fs::write(&path, few).unwrap();
    let log = read(&path, Some(&named("timestamp"))).unwrap();
    assert!((log.channel("x_mm").unwrap().time[2] - 0.04).abs() < 1e-6);
}

#[test]
fn channels_of_one_topic_are_read_each_by_its_own_schema() {
    let channels = [
        ros2("/state", "crane_msgs/msg/Old", "float64 x"),
        ros2("/state", "crane_msgs/msg/New", "float32 a\nfloat32 b"),
        ros2("/state", "crane_msgs/msg/Odd", "Unknown x"),
    ];
    let mut messages = Vec::new();
    for k in 0..20_u32 {
        let time = EPOCH + u64::from(k) * PERIOD;
        messages.push((0, time, Cdr::default().put(&f64::from(k).to_le_bytes()).message()));
        let new = Cdr::default().put(&(k as f32).to_le_bytes()).put(&2.5_f32.to_le_bytes());
        messages.push((1, time, new.message()));
        messages.push((2, time, vec![0, 1, 0, 0]));
    }
    let log = log("schemas.mcap", &file(options(), &channels, &messages));
    assert_eq!(log.headings(), "x, a, b");
    assert_eq!((log.channels[0].values[7], log.channels[1].values[7]), (7.0, 7.0));
    assert!(log.channels[2].values.iter().all(|b| *b == 2.5));
    assert!(log.remarks.iter().any(|r| r.contains("20 messages on /state (crane_msgs/msg/Odd)")));
}

/// A file of records, the last one the checksum of all before.
fn closed(records: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = b"\x89MCAP0\r\n".to_vec();
    records.iter().for_each(|record| bytes.extend(record));
    let crc = crc32fast::hash(&bytes);
    bytes.extend(record(15, &crc.to_le_bytes()));
    bytes
}

#[test]
fn a_large_attachment_is_skipped() {
    let messages = channel_and_messages("/crane", &[(0, "{\"x\": 1}")]);
    let message = |text: &str| {
        let times = PERIOD.to_le_bytes();
        record(5, &[&[1, 0, 0, 0, 0, 0], &times[..], &times, text.as_bytes()].concat())
    };
    let attached = record(9, &vec![7; (128 << 20) + 1]);
    let mut whole = closed(&[messages, attached, message("{\"x\": 2}")]);
    let log = log("attached.mcap", &whole);
    assert_eq!(log.channels[0].values, [1.0, 2.0]);
    assert!(log.remarks.is_empty(), "{:?}", log.remarks);
    // skipped records are included in the file's checksum
    let at = whole.len() / 2;
    whole[at] ^= 1;
    assert!(refused("attached.mcap", &whole).contains("checksum"));
    whole.truncate(at);
    let reported = refused("attached.mcap", &whole);
    assert!(reported.contains("a record of 128 MB where 128 MB are the most"), "{reported}");
    std::fs::remove_file(path("attached.mcap", &[])).unwrap();
}

#[test]
fn number_and_size_of_schemas_are_bounded() {
    let schema = |id: u16, size: usize| {
        let data = [(size as u32).to_le_bytes().to_vec(), vec![b'#'; size]].concat();
        record(3, &[id.to_le_bytes().to_vec(), text("a/msg/B"), text("ros2msg"), data].concat())
    };
    let many: Vec<Vec<u8>> = (1..=10_001).map(|id| schema(id, 0)).collect();
    let message = refused("schemas.mcap", &closed(&many));
    assert!(message.contains("more than 10000 schemas"), "{message}");
    let large: Vec<u8> = (1..=70).flat_map(|id| schema(id, 1 << 20)).collect();
    let packed = zstd::encode_all(&large[..], 3).unwrap();
    let message = refused("schemas.mcap", &one_chunk("zstd", large.len() as u64, 0, &packed));
    assert!(message.contains("more than 64 MB of schemas"), "{message}");
}

#[test]
fn each_loss_is_reported_with_its_cause_and_time() {
    let magic = 8;
    let good = channel_and_messages("/crane", &[(0, "{\"x\": 1}"), (PERIOD, "{\"x\": 2}")]);
    // a message of a channel that is not described
    let mut stranger = good.clone();
    stranger.extend(record(5, &[[9, 0].to_vec(), vec![0; 20], b"{}".to_vec()].concat()));
    let chunk = |crc: u32, span: (u64, u64)| {
        let mut file = one_chunk("", stranger.len() as u64, crc, &stranger);
        file[magic + 9..magic + 17].copy_from_slice(&span.0.to_le_bytes());
        file[magic + 17..magic + 25].copy_from_slice(&span.1.to_le_bytes());
        file[magic..file.len() - 13].to_vec()
    };
    let damaged = [chunk(1, (0, 0)), chunk(1, (EPOCH, EPOCH + 1_000_000_000)), chunk(0, (0, 0))];
    let log = log("losses.mcap", &closed(&damaged));
    assert_eq!(log.channels[0].values, [1.0, 2.0]);
    for wanted in [
        "2 damaged chunks are left out, of 1.000 s (its checksum does not match)",
        "1 damaged messages are left out (a channel that is not described)",
    ] {
        assert!(log.remarks.iter().any(|r| r == wanted), "{:?}", log.remarks);
    }
}
