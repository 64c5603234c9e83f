//! Keys of the table's file, as `serde` reads them from TOML: names and types only. Ranges are checked where the rows
//! of the [`Table`](super::Table) are made.
//!
//! Units are in the names of the keys. An unknown key is an error.

use super::NumberType;
use serde::Deserialize;

/// A table's file, or the table `[machine.ethercat]` of a crane file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub(super) bus: Bus,
    pub(super) device: Vec<Device>,
    pub(super) measured: Vec<Measured>,
    pub(super) commanded: Vec<Commanded>,
}

/// The part of a crane file that is read here.
#[derive(Deserialize)]
pub(super) struct CraneFile {
    pub(super) machine: Option<Machine>,
}

/// Table `[machine]` of a crane file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Machine {
    pub(super) ethercat: Option<File>,
}

/// `[bus]`: cycle and limits.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Bus {
    pub(super) period_us: u32,
    pub(super) exchanges: u32,
    pub(super) exchange_us: u32,
    #[serde(default)]
    pub(super) send_us: u32,
    pub(super) lost_frames_max: u32,
    pub(super) window_cycles: u32,
    pub(super) brake_ms: u32,
}

/// `sync` of a device: SYNC signals of its distributed clock.
#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Sync {
    None,
    Sync0,
    Sync01,
}

/// `mapping` of a device: whether PDOs that differ are written.
#[derive(Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Mapping {
    #[default]
    Checked,
    Written,
}

/// `profile` of a device.
#[derive(Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Profile {
    Cia402,
}

/// `[[device]]`: a device, in the order of the line.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Device {
    pub(super) name: String,
    pub(super) vendor: u32,
    pub(super) product: u32,
    pub(super) revision: [u32; 2],
    pub(super) watchdog_ms: Option<u32>,
    pub(super) sync: Sync,
    pub(super) sync1_us: Option<u32>,
    pub(super) profile: Option<Profile>,
    pub(super) stop_circuit: Option<Condition>,
    #[serde(default)]
    pub(super) mapping: Mapping,
    #[serde(default)]
    pub(super) sdo: Vec<Sdo>,
    #[serde(default)]
    pub(super) outputs: Vec<Pdo>,
    #[serde(default)]
    pub(super) inputs: Vec<Pdo>,
}

/// `sdo` of a device: a value that is written at start-up.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Sdo {
    pub(super) index: u16,
    pub(super) sub: u8,
    pub(super) r#type: NumberType,
    pub(super) value: i64,
    pub(super) reason: String,
}

/// `outputs` and `inputs` of a device: index of the mapping object; index, subindex and bits of each entry.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Pdo {
    pub(super) list: u16,
    pub(super) entries: Vec<(u16, u8, u8)>,
}

/// `stop_circuit` of a device: an entry, by index and subindex, whose masked bits have a value.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Condition {
    pub(super) entry: (u16, u8),
    pub(super) mask: u64,
    pub(super) value: u64,
}

/// `invalid` of a measured signal: a condition, and what it means.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct InvalidCondition {
    pub(super) entry: (u16, u8),
    pub(super) mask: u64,
    pub(super) value: u64,
    pub(super) means: Meaning,
}

/// `means` of an invalid condition.
#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Meaning {
    WireBreak,
    OutOfRange,
}

/// `[[measured]]`: a signal in the inputs of a device.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Measured {
    pub(super) axis: usize,
    pub(super) signal: String,
    pub(super) device: String,
    pub(super) entry: (u16, u8),
    pub(super) r#type: NumberType,
    pub(super) factor: f64,
    #[serde(default)]
    pub(super) offset: f64,
    #[serde(default = "positive")]
    pub(super) sign: i8,
    pub(super) range: [f64; 2],
    #[serde(default)]
    pub(super) invalid: Vec<InvalidCondition>,
    pub(super) provenance: String,
}

/// `[[commanded]]`: a signal in the outputs of a device.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Commanded {
    pub(super) axis: usize,
    pub(super) signal: String,
    pub(super) device: String,
    pub(super) entry: (u16, u8),
    pub(super) r#type: NumberType,
    pub(super) factor: f64,
    #[serde(default)]
    pub(super) offset: f64,
    #[serde(default = "positive")]
    pub(super) sign: i8,
    pub(super) range: [f64; 2],
    pub(super) provenance: String,
}

/// `sign` where it is left out.
fn positive() -> i8 {
    1
}
