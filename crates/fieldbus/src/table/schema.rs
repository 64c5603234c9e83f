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
    /// `[bus]`.
    pub(super) bus: Bus,
    /// `[[device]]`, in the order of their positions.
    pub(super) device: Vec<Device>,
    /// `[[measured]]`.
    pub(super) measured: Vec<Measured>,
    /// `[[commanded]]`.
    pub(super) commanded: Vec<Commanded>,
}

/// The part of a crane file that is read here.
#[derive(Deserialize)]
pub(super) struct CraneFile {
    /// `[machine]`; none where the crane file has none.
    pub(super) machine: Option<Machine>,
}

/// Table `[machine]` of a crane file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Machine {
    /// `[machine.ethercat]`; none where the machine is not on EtherCAT.
    pub(super) ethercat: Option<File>,
}

/// `[bus]`: cycle and limits.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Bus {
    /// Cycle of the bus, of SYNC0 and of control \[us\], 250 to 10000.
    pub(super) period_us: u32,
    /// Exchanges of process data in a cycle, 1 or 2.
    pub(super) exchanges: u32,
    /// First exchange after SYNC0 \[us\], 1 to the period less 1.
    pub(super) exchange_us: u32,
    /// Second exchange after SYNC0 \[us\], between the first and the end of the period; ignored with one exchange.
    #[serde(default)]
    pub(super) send_us: u32,
    /// Cycles with a loss that are tolerated in the window, less than its length.
    pub(super) lost_frames_max: u32,
    /// Length of the window \[cycles\], 1 to 100000.
    pub(super) window_cycles: u32,
    /// Time after a fault in which enabled drives brake with torque \[ms\], 0 to 10000.
    pub(super) brake_ms: u32,
}

/// `sync` of a device: SYNC signals of its distributed clock.
#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Sync {
    /// No SYNC signal: free run, or by the sync manager event.
    None,
    /// SYNC0.
    Sync0,
    /// SYNC0 and SYNC1, whose cycle is `sync1_us`.
    Sync01,
}

/// `mapping` of a device: whether PDOs that differ are written.
#[derive(Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Mapping {
    /// A difference is a mismatch.
    #[default]
    Checked,
    /// The table is written by SDO in PREOP.
    Written,
}

/// `profile` of a device.
#[derive(Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Profile {
    /// Drive by CiA 402 in cyclic synchronous velocity.
    Cia402,
}

/// `[[device]]`: a device, in the order of their positions.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Device {
    /// Name in messages and in the rows of signals; each device has another.
    pub(super) name: String,
    /// Vendor ID, object 0x1018:01.
    pub(super) vendor: u32,
    /// Product code, object 0x1018:02.
    pub(super) product: u32,
    /// Lowest and highest revision, object 0x1018:03.
    pub(super) revision: [u32; 2],
    /// Process-data watchdog \[ms\], two periods to 6500; none: the device keeps its own.
    pub(super) watchdog_ms: Option<u32>,
    /// SYNC signals.
    pub(super) sync: Sync,
    /// Cycle of SYNC1 \[us\].
    pub(super) sync1_us: Option<u32>,
    /// Profile of a drive.
    pub(super) profile: Option<Profile>,
    /// Status bits of an open stop circuit, among the inputs.
    pub(super) stop_circuit: Option<Condition>,
    /// Whether PDOs that differ are written.
    #[serde(default)]
    pub(super) mapping: Mapping,
    /// Start-up SDOs, in the order in which they are written.
    #[serde(default)]
    pub(super) sdo: Vec<Sdo>,
    /// RxPDOs, as 0x1C12 assigns them.
    #[serde(default)]
    pub(super) outputs: Vec<Pdo>,
    /// TxPDOs, as 0x1C13 assigns them.
    #[serde(default)]
    pub(super) inputs: Vec<Pdo>,
}

/// `sdo` of a device: a value that is written at start-up.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Sdo {
    /// Index of the object.
    pub(super) index: u16,
    /// Subindex of the object.
    pub(super) sub: u8,
    /// Type of the object.
    pub(super) r#type: NumberType,
    /// Value, within the range of the type.
    pub(super) value: i64,
    /// Why it is written, for messages.
    pub(super) reason: String,
}

/// `outputs` and `inputs` of a device: index of the mapping object; index, subindex and bits of each entry.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Pdo {
    /// Index of the mapping object, 0x1600 or 0x1A00 and up.
    pub(super) list: u16,
    /// Index, subindex and length \[bit\] of each entry; index 0 is a gap.
    pub(super) entries: Vec<(u16, u8, u8)>,
}

/// `stop_circuit` of a device: an entry, by index and subindex, whose masked bits have a value.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Condition {
    /// Index and subindex, among the inputs of the device.
    pub(super) entry: (u16, u8),
    /// Bits that are compared, not 0.
    pub(super) mask: u64,
    /// Their value, within the mask.
    pub(super) value: u64,
}

/// `invalid` of a measured signal: a condition, and what it means.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct InvalidCondition {
    /// Index and subindex, among the inputs of the device.
    pub(super) entry: (u16, u8),
    /// Bits that are compared, not 0.
    pub(super) mask: u64,
    /// Their value, within the mask.
    pub(super) value: u64,
    /// Cause.
    pub(super) means: Meaning,
}

/// `means` of an invalid condition.
#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Meaning {
    /// The signal is not measured.
    WireBreak,
    /// The signal is beyond the range of its sensor.
    OutOfRange,
}

/// `[[measured]]`: a signal in the inputs of a device.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Measured {
    /// Axis, from 0.
    pub(super) axis: usize,
    /// Name with unit, one of `MEASURED`.
    pub(super) signal: String,
    /// Name of the device.
    pub(super) device: String,
    /// Index and subindex among its inputs.
    pub(super) entry: (u16, u8),
    /// Type of the counts, as long as the entry.
    pub(super) r#type: NumberType,
    /// SI units per count, positive.
    pub(super) factor: f64,
    /// SI value at zero counts.
    #[serde(default)]
    pub(super) offset: f64,
    /// Direction, 1 or -1.
    #[serde(default = "positive")]
    pub(super) sign: i8,
    /// Lowest and highest SI value.
    pub(super) range: [f64; 2],
    /// Status bits that make it invalid.
    #[serde(default)]
    pub(super) invalid: Vec<InvalidCondition>,
    /// Source of the factor: data sheet, object or calibration.
    pub(super) provenance: String,
}

/// `[[commanded]]`: a signal in the outputs of a device.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Commanded {
    /// Axis, from 0.
    pub(super) axis: usize,
    /// Name with unit, one of `COMMANDED`.
    pub(super) signal: String,
    /// Name of the device.
    pub(super) device: String,
    /// Index and subindex among its outputs.
    pub(super) entry: (u16, u8),
    /// Type of the counts, as long as the entry.
    pub(super) r#type: NumberType,
    /// SI units per count, positive.
    pub(super) factor: f64,
    /// SI value at zero counts.
    #[serde(default)]
    pub(super) offset: f64,
    /// Direction, 1 or -1.
    #[serde(default = "positive")]
    pub(super) sign: i8,
    /// Lowest and highest SI value, with 0 between.
    pub(super) range: [f64; 2],
    /// Source of the factor: data sheet, object or calibration.
    pub(super) provenance: String,
}

/// `sign` where it is left out.
fn positive() -> i8 {
    1
}
