//! Damaged files of binary formats: any file is read or refused, within seconds and bounded memory.
//!
//! 300 for each format; `HYDROBOOM_MUTATIONS=10000 cargo test -p hydroboom-measurement --release --test
//! binary_mutations` tries more.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

#[allow(dead_code, reason = "not all that other tests write is mutated")]
#[path = "integration/mat/written.rs"]
mod mat;
#[allow(dead_code, reason = "not all that other tests write is mutated")]
#[path = "integration/mcap/written.rs"]
mod mcap_files;
#[allow(dead_code, reason = "not all that other tests write is mutated")]
#[path = "integration/mdf/written.rs"]
mod mdf;

use hydroboom_measurement::{Channel, Mapping, Signals, TimeBase, read};
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::time::Duration;

/// An input is read within this.
const LONGEST: Duration = Duration::from_secs(10);
/// Memory that reading may take, of the whole process \[kB\].
const MOST_MEMORY: u64 = 500_000;

/// Numbers by a seed (SplitMix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, bound: usize) -> usize {
        (self.next() % bound.max(1) as u64) as usize
    }
}

/// One to four changes of a file: bits, numbers that are often wrong, parts that are gone, twice there or elsewhere.
fn mutated(file: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = file.to_vec();
    for _ in 0..=random.below(4) {
        if bytes.is_empty() {
            break;
        }
        let at = random.below(bytes.len());
        let size = 1 + random.below(40.min(bytes.len() - at));
        match random.below(8) {
            0 => bytes[at] ^= 1 << random.below(8),
            1 => bytes[at] = random.next() as u8,
            2 | 3 => {
                let value = match random.below(6) {
                    0 => 0,
                    1 => u64::MAX,
                    2 => 0x7fff_ffff,
                    3 => 1 << random.below(64),
                    4 => random.below(bytes.len()) as u64,
                    _ => random.below(300) as u64,
                };
                let width = [1, 2, 4, 8][random.below(4)].min(bytes.len() - at);
                bytes[at..at + width].copy_from_slice(&value.to_le_bytes()[..width]);
            }
            4 => bytes.truncate(at),
            5 => {
                bytes.drain(at..at + size);
            }
            6 => {
                let part = bytes[at..at + size].to_vec();
                bytes.splice(at..at, part);
            }
            _ => {
                let to = random.below(bytes.len() - size + 1);
                bytes.copy_within(at..at + size, to);
            }
        }
    }
    bytes
}

/// Reads a file as far as a command does; any answer is right.
fn use_file(path: &Path) {
    let Ok(log) = read(path, None) else { return };
    for channel in &log.channels {
        assert_eq!(channel.time.len(), channel.values.len(), "{}", channel.heading);
        assert!(
            channel.time.windows(2).all(|w| w[1] >= w[0]),
            "time of {} goes back",
            channel.heading
        );
        let _ = (TimeBase::of(&channel.time), Channel::range(channel));
    }
    let mapping = Mapping::guess(&log);
    let _ = (mapping.suspicions(&log, 0.5, 50.0), Signals::of(&log, &mapping));
}

/// Mutates files of a format in turn. An external process detects a reader that hangs.
fn survives(format: &str, seeds: &[Vec<u8>], then: fn(&Path)) {
    let count =
        std::env::var("HYDROBOOM_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(300);
    let name = format!("mutated.{format}");
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let (send, done) = mpsc::channel();
    let (work, inputs) = mpsc::channel::<PathBuf>();
    let reader = std::thread::spawn(move || {
        for path in inputs {
            then(&path);
            let _ = send.send(());
        }
    });
    for k in 0..count {
        let bytes = mutated(&seeds[k % seeds.len()], &mut Random(k as u64));
        std::fs::write(&path, bytes).unwrap();
        work.send(path.clone()).unwrap();
        match done.recv_timeout(LONGEST) {
            Ok(()) => {}
            Err(mpsc::RecvTimeoutError::Timeout) => {
                panic!("input {k} takes longer than {LONGEST:?}")
            }
            Err(mpsc::RecvTimeoutError::Disconnected) => panic!("the reader panicked at input {k}"),
        }
    }
    drop(work);
    reader.join().unwrap();
    let kilobytes = memory();
    assert!(kilobytes < MOST_MEMORY, "{kilobytes} kB");
}

/// The largest memory that this process ever took \[kB\]; zero where the system does not say.
fn memory() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|l| l.split_whitespace().next()?.parse().ok()).unwrap_or(0)
}

fn course() -> [Vec<f64>; 2] {
    let t: Vec<f64> = (0..30).map(|k| f64::from(k) * 0.01).collect();
    let x = t.iter().map(|t| 50.0 + t).collect();
    [t, x]
}

#[test]
fn damaged_mat_files_are_read_or_refused() {
    let [t, x] = course();
    let inner =
        mat::structure("", &["time", "label"], &[vec![mat::row("", &t), mat::text("", "p_A")]]);
    let with_time = mat::structure(
        "s",
        &["time", "signals"],
        &[vec![
            mat::row("", &t),
            mat::structure(
                "",
                &["values", "label"],
                &[vec![mat::row("", &x), mat::text("", "x_mm")]],
            ),
        ]],
    );
    let variables = [
        mat::row("t", &t),
        mat::doubles("p", &[2, 30], &[x.clone(), x.clone()].concat()),
        mat::integers("n", &[5; 30]),
        mat::structure("log", &["inner", "x_mm"], &[vec![inner, mat::row("", &x)]]),
        with_time,
        mat::cells("names", &["a", "b"]),
        mat::object("out", "timeseries"),
    ];
    let packed: Vec<Vec<u8>> = variables.iter().map(|v| mat::packed(v)).collect();
    let trajectory = [
        mat::level_4_texts("Aclass", &["Atrajectory", "1.1", "", "binTrans"], false),
        mat::level_4_texts("name", &["time", "x"], true),
        mat::level_4_texts("description", &["Time in [s]", "x [m]"], true),
        mat::level_4("dataInfo", 20, 4, &[0.0, 1.0, 0.0, -1.0, 2.0, 2.0, 0.0, -1.0]),
        mat::level_4("data_1", 0, 2, &[0.0; 4]),
        mat::level_4("data_2", 0, 2, &(0..60).map(f64::from).collect::<Vec<f64>>()),
    ];
    let seeds = [mat::file(&variables), mat::file(&packed), trajectory.concat()];
    survives("mat", &seeds, use_file);
}

#[test]
fn damaged_mat_files_of_level_7_3_are_read_or_refused() {
    let files = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/integration/mat/files");
    let read = |name: &str| std::fs::read(files.join(name)).unwrap();
    survives("7_3.mat", &["arrays_7_3.mat", "scope_7_3.mat", "groups_7_3.mat"].map(read), use_file);
}

#[cfg(feature = "parquet")]
#[test]
fn damaged_parquet_files_are_read_or_refused() {
    let files = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/integration/parquet/files");
    let read = |name: &str| std::fs::read(files.join(format!("{name}.parquet"))).unwrap();
    survives("parquet", &["stamped", "seconds", "milliseconds"].map(read), use_file);
}

#[test]
fn damaged_mdf_files_are_read_or_refused() {
    let files = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/integration/mdf/files");
    let mut seeds: Vec<Vec<u8>> = ["plain", "transposed", "packed_list", "conversions", "zstd"]
        .iter()
        .map(|name| std::fs::read(files.join(format!("{name}.mf4"))).unwrap())
        .collect();
    let mut file = mdf::File::new("UnFinMF ", "4.10");
    let stroke = file.channel(0, "stroke", "mm", [0, 1, 8, 16]);
    let channel = file.channel(stroke, "t", "s", [2, 4, 0, 64]);
    // ranges that are converted each in its own way
    let linear = [&[1, 0, 0, 0, 0, 0, 2, 0][..], &[0; 16], &[0; 8], &0.5_f64.to_le_bytes()];
    let linear = file.block("##CC", &[0; 4], &linear.concat());
    let ends = [0.0, 2.0, 5.0, 9.0_f64].map(f64::to_le_bytes).concat();
    let ranges = [&[8, 0, 0, 0, 3, 0, 4, 0][..], &[0; 16], &ends].concat();
    let ranges = file.block("##CC", &[0, 0, 0, 0, linear, linear, 0], &ranges);
    let conversion = stroke as usize + 24 + 4 * 8;
    file.bytes[conversion..conversion + 8].copy_from_slice(&ranges.to_le_bytes());
    let group = file.group(0, channel, [1, 20, 10], false);
    let record = |k: u8| [vec![1], f64::from(k).to_le_bytes().to_vec(), vec![k, k]].concat();
    let data: Vec<u8> = (0..20).flat_map(record).collect();
    let data = file.block("##DT", &[], &data);
    seeds.push(file.finish(group, data, 1));
    survives("mf4", &seeds, use_file);
}

#[test]
fn damaged_mcap_files_are_read_or_refused() {
    let texts: Vec<String> = (0..30)
        .map(|k| format!("{{\"a\": {{\"x_mm\": {k}}}, \"p\": [1, NaN], \"on\": true}}"))
        .collect();
    let messages: Vec<(u64, &str)> =
        texts.iter().enumerate().map(|(k, t)| (k as u64 * 10_000_000, t.as_str())).collect();
    let records = mcap_files::channel_and_messages("/crane", &messages);
    let size = records.len() as u64;
    let joints = "std_msgs/Header header\nstring[] name\nfloat64[] position\n===\nMSG: std_msgs/Header\n\
                  builtin_interfaces/Time stamp\nstring frame_id\n";
    let mut message = vec![0, 1, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0, b'a', 0, 0, 0];
    message.extend([1, 0, 0, 0, 2, 0, 0, 0, b'b', 0, 0, 0, 1, 0, 0, 0]);
    message.extend([0; 8]);
    let cdr: Vec<(usize, u64, Vec<u8>)> =
        (0..20).map(|k| (0, k * 1_000_000, message.clone())).collect();
    let channel = mcap_files::ros2("/joints", "sensor_msgs/msg/JointState", joints);
    let seeds = [
        // without checksums, damage is detected only by later checks
        mcap_files::one_chunk("", size, 0, &records),
        mcap_files::one_chunk("zstd", size, 0, &zstd::encode_all(&records[..], 3).unwrap()),
        mcap_files::file(
            mcap_files::options().use_chunks(false).calculate_data_section_crc(false),
            &[channel],
            &cdr,
        ),
        mcap_files::file(
            mcap_files::options(),
            &[mcap_files::json("/crane")],
            &[(0, 0, b"{\"x\": 1}".to_vec())],
        ),
    ];
    survives("mcap", &seeds, use_file);
}
