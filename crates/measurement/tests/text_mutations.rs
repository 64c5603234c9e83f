//! Files that were damaged at random: read or refused, without a panic, within 10 s each and 500 MB in all.
//!
//! 300 of each kind; `HYDROBOOM_MUTATIONS` sets another number.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

use hydroboom_measurement::{Mapping, Signals, TimeColumn, read};
use std::path::PathBuf;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

/// Longest time that a file takes.
const LONGEST: Duration = Duration::from_secs(10);
/// Largest memory of the process \[kB\].
const LARGEST: u64 = 500_000;

fn count() -> u64 {
    let asked = std::env::var("HYDROBOOM_MUTATIONS").ok().and_then(|text| text.parse().ok());
    asked.unwrap_or(300)
}

/// Numbers of xorshift.
struct Chance(u64);

impl Chance {
    fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    fn below(&mut self, most: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % most.max(1)
    }
}

const PIECES: [&[u8]; 28] = [
    b"\"",
    b"\0",
    b"\n",
    b"\r",
    b",",
    b";",
    b"\t",
    b":",
    b"|",
    b" ",
    b"-",
    b".",
    b"#",
    b"NaN",
    b"inf",
    b"1e308",
    b"-1e-308",
    b"99999999999999999999",
    b"\xff\xfe",
    b"\xc3",
    b"[",
    b"]",
    b"(",
    b"=",
    b"'",
    b"\"\"\"",
    b"Name",
    b"EOF",
];

/// A file with some damage.
fn damaged(whole: &[u8], chance: &mut Chance) -> Vec<u8> {
    let mut bytes = whole.to_vec();
    for _ in 0..=chance.below(8) {
        let (from, to) = (chance.below(bytes.len()), chance.below(bytes.len()));
        let (from, to) = (from.min(to), from.max(to).min(from.min(to) + 3000));
        match chance.below(7) {
            0 => bytes.truncate(to),
            1 => drop(bytes.drain(from..to)),
            2 => {
                let part = bytes[from..to].to_vec();
                bytes.splice(to..to, part);
            }
            3 => {
                let part = bytes[from..to].to_vec();
                let place = chance.below(bytes.len());
                bytes.splice(place..place, part);
            }
            4 if !bytes.is_empty() => bytes[from] ^= 1 << chance.below(8),
            _ => {
                let piece = PIECES[chance.below(PIECES.len())];
                bytes.splice(from..from, piece.iter().copied());
            }
        }
    }
    bytes
}

/// Runs a task for each seed in another thread, which must end.
fn each(name: &'static str, task: fn(u64)) {
    let (done, seeds) = mpsc::channel();
    let worker = std::thread::spawn(move || {
        for seed in 0..count() {
            task(seed);
            done.send(seed).unwrap();
        }
    });
    for seed in 0..count() {
        match seeds.recv_timeout(LONGEST) {
            Ok(_) => {}
            Err(RecvTimeoutError::Timeout) => {
                panic!("{name}: seed {seed} takes longer than {LONGEST:?}")
            }
            // the panic says what was wrong
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    worker.join().unwrap();
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let peak: Option<u64> =
        peak.and_then(|text| text.trim().trim_end_matches("kB").trim().parse().ok());
    assert!(peak.is_none_or(|peak| peak < LARGEST), "{name}: {peak:?} kB");
}

fn tables() -> [Vec<u8>; 4] {
    let row = |k: u32, sign: &str, comma: bool| {
        let t = f64::from(k) * 0.01;
        let numbers = [t, 50.0 + 20.0 * t, 69.5 - t, 3.0 - 0.125 * t, 400.0 * t];
        let row = numbers.map(|v| v.to_string()).join(sign);
        if comma { row.replace('.', ",") } else { row }
    };
    let rows = |sign: &str, comma: bool| -> String {
        (0..300).map(|k| row(k, sign, comma) + "\n").collect()
    };
    let plain = format!("time_s,stroke_mm,p_A [bar],p_B (MPa),n / rpm\n{}", rows(",", false));
    let german = format!("# von Hand\nZeit;Weg;p_A;p_B;n\ns;mm;bar;bar;1/min\n{}", rows(";", true));
    let scope = format!(
        "Name\tScope Project\nStarttime of export\t132961725843760000\n\nName\tGVL.fStroke\tGVL.fPa\tGVL.fPb\tGVL.fSpeed\n\
         SampleTime[ms]\t10\t10\t10\t10\nUnit\tmm (Length)\tbar\tbar\trpm\n\n{}EOF\n",
        rows("\t", false)
    );
    let wide: Vec<u8> = plain.encode_utf16().flat_map(u16::to_le_bytes).collect();
    [plain.into_bytes(), german.into_bytes(), scope.into_bytes(), wide]
}

#[test]
fn damaged_tables_are_read_or_refused() {
    each("CSV", |seed| {
        let mut chance = Chance::new(seed);
        let whole = tables();
        let bytes = damaged(&whole[seed as usize % whole.len()], &mut chance);
        let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("damaged.csv");
        std::fs::write(&path, bytes).unwrap();
        let counted = TimeColumn { sample_time: Some(0.01), ..TimeColumn::default() };
        for time in [None, Some(&counted)] {
            let Ok(log) = read(&path, time) else { continue };
            for channel in &log.channels {
                assert_eq!(channel.time.len(), channel.values.len(), "seed {seed}");
                assert!(
                    channel.time.windows(2).all(|w| w[0] < w[1]),
                    "seed {seed}: time goes back"
                );
                assert!(channel.breaks.iter().all(|b| *b < channel.time.len()), "seed {seed}");
            }
            if let Ok(mapping) = Mapping::default().completed(&log) {
                let signals = Signals::of(&log, &mapping).unwrap();
                assert!(mapping.suspicions(&log, 0.5, 50.0).len() < 100);
                let _ = (signals, mapping.assumptions(&log));
            }
        }
    });
}

#[test]
fn damaged_mappings_are_understood_or_refused_in_few_words() {
    each("TOML", |seed| {
        let whole = "[log]\nsample_time_ms = 10\npressure_b = \"p#2\"\n[log.time]\ncolumn = \"t\"\nunit = \"ms\"\nscale = 2.0\noffset = 1\n\
                     [log.stroke]\ncolumn = \"x\"\nunit = \"mm\"\nsign = -1\noffset = 250.0\nscale = 0.1\ndelay_ms = 4.0\ndrift_ppm = 200\nfilter_ms = 20.0\n";
        let bytes = damaged(whole.as_bytes(), &mut Chance::new(seed));
        let text = String::from_utf8_lossy(&bytes);
        match Mapping::parse("damaged.toml", &text) {
            // what is understood is written so that it is understood again
            Ok(mapping) => {
                let again = Mapping::parse("again.toml", &mapping.to_toml());
                let again = again.unwrap_or_else(|e| panic!("seed {seed}: {e}"));
                assert_eq!(again.entries.len(), mapping.entries.len(), "seed {seed}");
            }
            Err(error) => assert!(error.to_string().len() < 2000, "seed {seed}: {error}"),
        }
    });
}

#[test]
fn a_mapping_of_brackets_is_refused_in_few_words() {
    for text in [
        "[log]\na = ".to_string() + &"[".repeat(200_000),
        "[".repeat(200_000),
        "\"".repeat(200_001),
    ] {
        let error = Mapping::parse("brackets.toml", &text).unwrap_err().to_string();
        assert!(error.len() < 500, "{} bytes", error.len());
    }
}
