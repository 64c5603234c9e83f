//! Text that is damaged at random, and what reading it may take.
//!
//! 300 of each kind; `HYDROBOOM_MUTATIONS` sets another number.

use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

/// Longest time that a file takes.
const LONGEST: Duration = Duration::from_secs(10);
/// Largest memory of the process \[kB\].
const LARGEST: u64 = 500_000;

/// How many are tried of each kind.
pub fn count() -> u64 {
    let asked = std::env::var("HYDROBOOM_MUTATIONS").ok().and_then(|text| text.parse().ok());
    asked.unwrap_or(300)
}

/// Numbers of xorshift.
pub struct Chance(u64);

impl Chance {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    /// A random integer from 0 to `most` − 1.
    pub fn below(&mut self, most: usize) -> usize {
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
pub fn damaged(whole: &[u8], chance: &mut Chance) -> Vec<u8> {
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
pub fn each(name: &'static str, task: fn(u64)) {
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
