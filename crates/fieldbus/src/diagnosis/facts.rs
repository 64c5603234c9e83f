//! Facts of a bus, as read from registers and objects of its devices.

use crate::check::DeviceFacts;
use crate::statistics::Histogram;

/// Ports of a device controller (ETG.1000.4).
pub const PORTS: usize = 4;

/// Error counters of a device (ETG.1000.4, registers 0x0300 to 0x0313). They count from power-on, or since a
/// main device cleared them, and stop at 255.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ErrorCounters {
    /// Invalid frames (wrong check sequence) that no device before has marked, at each port: 0x0300 + 2 n.
    pub invalid_frames: [u8; PORTS],
    /// Errors of the physical layer, in frames and between them, at each port: 0x0301 + 2 n.
    pub receive_errors: [u8; PORTS],
    /// Forwarded errors: damaged frames that a device before has counted and marked, at each port: 0x0308 + n.
    pub forwarded: [u8; PORTS],
    /// Errors of the EtherCAT processing unit, 0x030C.
    pub processing_unit: u8,
    /// Errors of the process data interface (PDI) to the application, 0x030D.
    pub pdi: u8,
    /// Lost links, at each port: 0x0310 + n.
    pub lost_links: [u8; PORTS],
}

impl ErrorCounters {
    /// Decodes the registers from 0x0300 on.
    pub(crate) fn of(registers: [u8; 20]) -> Self {
        let port = |first: usize, step: usize| std::array::from_fn(|k| registers[first + step * k]);
        Self {
            invalid_frames: port(0, 2),
            receive_errors: port(1, 2),
            forwarded: port(8, 1),
            processing_unit: registers[12],
            pdi: registers[13],
            lost_links: port(16, 1),
        }
    }

    /// Number of frames, up to 255, that were damaged on the cable at a port, 0 to 3. Frames damaged on another cable
    /// count as forwarded only (ET1100 data sheet, section I, error counters).
    pub fn damaged(&self, port: usize) -> u8 {
        self.invalid_frames[port]
    }
}

/// A device as it was found in the line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LineDevice {
    /// Vendor ID, product code and revision number of its EEPROM; none where that could not be read.
    pub identity: Option<[u32; 3]>,
    /// Register 0x0110: links, loops and communication of its ports.
    pub ports: u16,
    /// AL status, register 0x0130: state, and bit 4 for an error.
    pub state: u16,
    /// AL status code, register 0x0134.
    pub code: u16,
    /// Error counters before the diagnosis changed anything.
    pub errors: ErrorCounters,
    /// Error counters at the end; none where they could not be read.
    pub errors_after: Option<ErrorCounters>,
    /// AL status and AL status code at the end; none where they could not be read.
    pub state_after: Option<[u16; 2]>,
}

impl LineDevice {
    /// Whether a port, 0 to 3, has a physical link: bit 4 + port of 0x0110 (ETG.1000.4).
    pub fn has_link(&self, port: usize) -> bool {
        self.ports >> (4 + port) & 1 != 0
    }
}

/// A sync manager for process data from the main device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SyncManager {
    /// Number, from 0; its registers begin at 0x0800 + 8 n.
    pub number: u16,
    /// Whether it triggers the process-data watchdog (bit 6 of its control byte).
    pub triggers_watchdog: bool,
}

/// How a device is set up, after the table's values were written.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SetUp {
    /// Propagation delay from the reference clock to the device (0x0928) \[ns\]; 0 without a clock.
    pub delay: u32,
    /// Process-data watchdog by registers 0x0400 and 0x0420 \[ns\]; 0 is switched off, none without outputs or where
    /// it was not read.
    pub watchdog: Option<u64>,
    /// PDI watchdog by registers 0x0400 and 0x0410 \[ns\]; 0 is switched off, none where it was not read.
    pub pdi_watchdog: Option<u64>,
    /// Registers 0x0980 (owner of the SYNC unit) and 0x0981 (activation); none before clocks are set up.
    pub dc_activation: Option<[u8; 2]>,
    /// Synchronisation types of outputs (0x1C32:01) and inputs (0x1C33:01), by ETG.1020; none without the object.
    pub sync_types: [Option<u16>; 2],
    /// Cycle time, 0x1C32:02 \[ns\].
    pub cycle: Option<u32>,
    /// Shortest cycle time, 0x1C32:05 \[ns\].
    pub shortest_cycle: Option<u32>,
    /// Calc and copy time, 0x1C32:06 \[ns\]; its meaning differs between manufacturers.
    pub calc_and_copy: Option<u32>,
    /// Outputs and inputs by its sync managers \[byte\].
    pub sizes: Option<[usize; 2]>,
    /// Sync managers of outputs, in SAFEOP.
    pub output_managers: Vec<SyncManager>,
    /// Difference of its system time from the reference, register 0x092C \[ns\], after the exchange of frames;
    /// negative where it is behind.
    pub clock_difference: Option<i64>,
}

/// Percentiles of a distribution of times \[ns\]; all 0 without a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Percentiles {
    /// Smallest.
    pub min: u64,
    /// 1st percentile: 1 % of the samples are at most this long.
    pub p1: u64,
    /// Median.
    pub p50: u64,
    /// 99th percentile.
    pub p99: u64,
    /// Largest.
    pub max: u64,
}

impl Percentiles {
    /// Percentiles of a histogram \[ns\].
    pub(crate) fn of(times: &Histogram) -> Self {
        let at = |share: f64| times.value_at_quantile(share);
        Self { min: times.min(), p1: at(0.01), p50: at(0.5), p99: at(0.99), max: times.max() }
    }
}

/// Statistics of the frames in SAFEOP.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Listening {
    /// Cycles.
    pub cycles: u64,
    /// Exchanges.
    pub exchanges: u64,
    /// Exchanges that did not come back in time.
    pub lost: u64,
    /// Whether more were lost in a window than the table allows.
    pub has_too_many_lost: bool,
    /// Exchanges with another working counter than the table's.
    pub wrong_working_counter: u64,
    /// Working counter of the last of these.
    pub last_wrong_working_counter: u16,
    /// Working counter by the table.
    pub working_counter: u16,
    /// Outputs that passed the reference clock after the SYNC0 at which they were to be applied.
    pub late_outputs: u64,
    /// Whether more were late in a window than the table allows lost frames.
    pub has_too_many_late: bool,
    /// Margin of the outputs to SYNC0, at the reference clock \[ns\].
    pub margin: Percentiles,
    /// Time from SYNC0 to the passage of the first exchange of a cycle at the reference clock \[ns\].
    pub phase: Percentiles,
    /// Time from the sending of a frame to its return, by this computer's clock \[ns\].
    pub round_trip: Percentiles,
    /// Delay with which this computer sent the first frame of a cycle \[ns\].
    pub late_by: Percentiles,
    /// Time from the first exchange of a cycle to that of the next, as they were sent \[ns\].
    pub period: Percentiles,
}

/// Facts of a bus, as far as the diagnosis came; fields of later stages are empty or none before them.
#[derive(Clone, Debug, Default)]
pub struct BusFacts {
    /// The devices, in the order of their positions.
    pub line: Vec<LineDevice>,
    /// Data that they report, as far as it was read; named "a device" before that.
    pub devices: Vec<DeviceFacts>,
    /// How they are set up; empty where they are not those of the table.
    pub set_up: Vec<SetUp>,
    /// Why they did not go to PREOP.
    pub pre_op_refused: Option<String>,
    /// Failures of the start-up: position of the device, failed part, cause.
    pub failed: Vec<(usize, String, String)>,
    /// Why clocks could not be set up.
    pub clocks_refused: Option<String>,
    /// Why the devices did not go to SAFEOP.
    pub safe_op_refused: Option<String>,
    /// Statistics of the frames in SAFEOP; none where it was not reached.
    pub listening: Option<Listening>,
}
