//! Table of the bus: its devices, their set-up, and the mapping of their process data to the machine's signals.
//!
//! It is read from a file of its own ([`Table::parse`]) and checked there; the data that the devices report
//! are compared with it at start-up ([`check`](crate::check)).

mod device;
mod drive;
mod file;
mod problem;
mod scale;
mod schema;
mod signal;

pub use problem::TableError;
pub use scale::{NumberType, Scale};

/// The whole table, checked: lists are consistent with one another, and quantities are in SI units or \[ns\].
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Cycle and limits.
    pub bus: BusSettings,
    /// Devices in the order of their positions.
    pub devices: Vec<DeviceRow>,
    /// Measured signals.
    pub measured: Vec<MeasuredRow>,
    /// Commanded signals.
    pub commanded: Vec<CommandedRow>,
    /// Drives.
    pub drives: Vec<DriveRow>,
}

/// Cycle of the bus, and the number of losses that it tolerates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BusSettings {
    /// Period, which is that of control and of SYNC0 \[ns\], 0.25 to 10 ms.
    pub period: u64,
    /// Exchanges in a period: two, and a command acts one period after its measurement; or one, and it acts two
    /// periods after.
    pub exchanges: u32,
    /// Time from SYNC0 to the first exchange \[ns\], 1 us to less than a period.
    pub exchange: u64,
    /// Time from SYNC0 to the second exchange \[ns\], after the first one and within the period. Unused with one
    /// exchange.
    pub send: u64,
    /// Largest number of cycles with a lost frame, or with a low working counter, within the window; 0 to less than
    /// its length.
    pub lost_max: u32,
    /// Length of that window \[cycles\], 1 to 100000.
    pub window: u32,
    /// Time after a fault in which drives brake with torque before they are switched off \[ns\], 0 to 10 s.
    pub brake: u64,
}

impl BusSettings {
    /// A bus with two exchanges in a period of 1 ms.
    #[cfg(test)]
    pub(crate) const OF_TESTS: Self = Self {
        period: 1_000_000,
        exchanges: 2,
        exchange: 100_000,
        send: 700_000,
        lost_max: 3,
        window: 100,
        brake: 0,
    };

    /// Periods from sampling at SYNC0 to actuation at SYNC0: 1 with two exchanges, 2 with one.
    pub fn delay(&self) -> u32 {
        3 - self.exchanges
    }

    /// Time from SYNC0 to the begin of a control period \[ns\]: a third of the time from the first exchange to the one
    /// that sends the command. The answer has arrived by then, and most of the time is left to compute.
    pub fn control(&self) -> u64 {
        let end = if self.exchanges == 2 { self.send } else { self.period + self.exchange };
        self.exchange + (end - self.exchange) / 3
    }
}

/// Synchronisation of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sync {
    /// Without SYNC signals: by the sync manager event, or free run (ETG.1020).
    None,
    /// By SYNC0 (activation 0x0300).
    Sync0,
    /// By SYNC0 and SYNC1 (activation 0x0700), with the cycle of SYNC1 \[ns\].
    Sync01(u64),
}

impl Sync {
    /// AssignActivate word for registers 0x0980 and 0x0981, as the device's SII states it.
    pub fn activation(self) -> u16 {
        match self {
            Self::None => 0,
            Self::Sync0 => 0x0300,
            Self::Sync01(_) => 0x0700,
        }
    }
}

/// One entry of a PDO, as a mapping object has it (ETG.1000.6): index, subindex, bit length; index 0: padding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Index.
    pub index: u16,
    /// Subindex.
    pub sub: u8,
    /// Length \[bit\].
    pub bits: u8,
}

impl std::fmt::Display for Entry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.index {
            0 => write!(f, "padding of {} bit", self.bits),
            _ => write!(f, "0x{:04X}:{:02X} of {} bit", self.index, self.sub, self.bits),
        }
    }
}

/// Process data object (PDO): a mapping object with its entries in order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pdo {
    /// Index of the mapping object, 0x1600 or 0x1A00 and up.
    pub list: u16,
    /// Entries.
    pub entries: Vec<Entry>,
}

/// Start-up SDO: a value that is written in PREOP, before process data begin.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StartUp {
    /// Index.
    pub index: u16,
    /// Subindex.
    pub sub: u8,
    /// Type of the object.
    pub kind: NumberType,
    /// Value, within the range of its type.
    pub value: i64,
    /// Why it is written, for messages.
    pub reason: String,
}

/// Row of a device: its identity, and how it is set up.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeviceRow {
    /// Name, in messages and for the signals.
    pub name: String,
    /// Vendor ID, 0x1018:01.
    pub vendor: u32,
    /// Product code, 0x1018:02.
    pub product: u32,
    /// Lowest and highest revision number, 0x1018:03.
    pub revision: [u32; 2],
    /// Process-data watchdog (0x0420) \[ns\], two periods to 6.5 s; none: the device's own setting is kept.
    pub watchdog: Option<u64>,
    /// Synchronisation of its inputs and outputs: none, SYNC0, or SYNC0 and SYNC1.
    pub sync: Sync,
    /// Whether PDOs that differ are written; if not, they are a mismatch.
    pub is_mapping_written: bool,
    /// Start-up SDOs, in the order in which they are written.
    pub start_up: Vec<StartUp>,
    /// Outputs (RxPDO), in the order of 0x1C12.
    pub outputs: Vec<Pdo>,
    /// Inputs (TxPDO), in the order of 0x1C13.
    pub inputs: Vec<Pdo>,
}

impl DeviceRow {
    /// Length of all outputs \[byte\]: the sum of their bits, rounded up; 0 without outputs.
    pub fn output_bytes(&self) -> usize {
        bytes(&self.outputs)
    }

    /// Length of all inputs \[byte\]: the sum of their bits, rounded up; 0 without inputs.
    pub fn input_bytes(&self) -> usize {
        bytes(&self.inputs)
    }

    /// Contribution to the working counter of an exchange by LRW: two for outputs, one for inputs (IEC 61158-4-12).
    pub fn working_counter(&self) -> u16 {
        2 * u16::from(self.output_bytes() > 0) + u16::from(self.input_bytes() > 0)
    }
}

fn bytes(lists: &[Pdo]) -> usize {
    let bits = lists.iter().flat_map(|list| &list.entries).map(|entry| usize::from(entry.bits));
    bits.sum::<usize>().div_ceil(8)
}

/// Location of a value in the inputs or the outputs of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Position of the device in the line, from 0.
    pub device: usize,
    /// First bit, from the beginning of its inputs or outputs; bit 0 is the lowest of the first byte.
    pub bit: usize,
    /// Length \[bit\]; of a longer one than 64 the first 64 count.
    pub bits: u8,
}

impl Place {
    /// The value there, without a sign; bits beyond the end of `bytes` are zero.
    pub fn read(&self, bytes: &[u8]) -> u64 {
        let bit =
            |k: usize| bytes.get((self.bit + k) / 8).map_or(0, |b| b >> ((self.bit + k) % 8) & 1);
        (0..usize::from(self.bits.min(64))).fold(0, |sum, k| sum | u64::from(bit(k)) << k)
    }

    /// Writes a value there; bits beyond its length or the end of `bytes` are left out.
    pub fn write(&self, bytes: &mut [u8], value: u64) {
        for k in 0..usize::from(self.bits.min(64)) {
            let at = self.bit + k;
            if let Some(byte) = bytes.get_mut(at / 8) {
                *byte = *byte & !(1 << (at % 8)) | ((value >> k & 1) as u8) << (at % 8);
            }
        }
    }
}

/// Status bits of an input: a condition that holds while the masked bits equal a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitCondition {
    /// Location of the status bits in the inputs.
    pub place: Place,
    /// Mask of the bits that are compared.
    pub mask: u64,
    /// Value of the masked bits at which the condition holds.
    pub value: u64,
}

impl BitCondition {
    /// Whether the condition holds for the inputs `bytes` of its device; bits beyond their end count as zero.
    pub fn is_set(&self, bytes: &[u8]) -> bool {
        self.place.read(bytes) & self.mask == self.value
    }
}

/// Why a signal is invalid, by its status bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Invalid {
    /// It is not measured: wire break, sensor or converter failed.
    Absent,
    /// It is beyond the sensor's range.
    OutOfRange,
}

/// A measured signal of an axis.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredRow {
    /// Axis, from 0.
    pub axis: usize,
    /// Which of the axis's signals, by its place in [`MEASURED`]; that after the last: the position switch of the
    /// load-holding valve, 1 open.
    pub signal: usize,
    /// Location in the inputs.
    pub place: Place,
    /// Counts to SI units.
    pub scale: Scale,
    /// Conditions under which it is invalid; the most severe one counts.
    pub invalid: Vec<(BitCondition, Invalid)>,
    /// Where the factor is from.
    pub provenance: String,
}

/// A commanded signal of an axis.
#[derive(Clone, Debug, PartialEq)]
pub struct CommandedRow {
    /// Axis, from 0.
    pub axis: usize,
    /// Which of the axis's commands, by its place in [`COMMANDED`].
    pub signal: usize,
    /// Location in the outputs.
    pub place: Place,
    /// Counts to SI units.
    pub scale: Scale,
    /// Where the factor is from.
    pub provenance: String,
}

/// Names of measured signals, each with its unit: those of an axis in their order, then the valve's position switch.
pub const MEASURED: [&str; 8] = [
    "stroke_m",
    "pressure_pump_a_pa",
    "pressure_a_pa",
    "pressure_b_pa",
    "pressure_pump_b_pa",
    "pressure_accumulator_pa",
    "motor_speed_rev_per_s",
    "holding_valve_open",
];

/// Names of commanded signals, each with its unit.
pub const COMMANDED: [&str; 2] = ["motor_speed_rev_per_s", "holding_valve"];

/// A drive by CiA 402, and the places of its objects in the process data.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveRow {
    /// Position of the device in the line, from 0.
    pub device: usize,
    /// Axis whose motor it is, from 0.
    pub axis: usize,
    /// Controlword, 0x6040.
    pub controlword: Place,
    /// Target velocity, 0x60FF, in the drive's unit of velocity.
    pub target: Place,
    /// Mode of operation, 0x6060; none: by SDO at start-up.
    pub mode: Option<Place>,
    /// Statusword, 0x6041.
    pub statusword: Place,
    /// Mode of operation display, 0x6061.
    pub mode_display: Place,
    /// Error code, 0x603F; none where it is not mapped.
    pub error: Option<Place>,
    /// Condition of an open stop circuit (safe torque off); none where the drive does not report it.
    pub stop_circuit: Option<BitCondition>,
}
