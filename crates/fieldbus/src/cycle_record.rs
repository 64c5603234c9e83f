//! Record of a cycle of the bus, for the log: times, working counters, AL states, process image, fault.

use crate::fault::Fault;
use crate::start_up::MOST_DEVICES;
use crate::table::Table;
use ethercrab::SubDeviceState;
use hydroboom_control::measurement::AXES;

/// Largest process image that is recorded \[byte\]; a longer one is truncated. A drive and a dozen terminals have
/// about 100.
pub const LARGEST_IMAGE: usize = 256;

/// One cycle of the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CycleRecord {
    /// Number of the newest measurement.
    pub measurement: u64,
    /// SYNC0 of the cycle \[ns\]: by this computer's clock, and by the devices' system time (0x0910).
    pub sync0: [u64; 2],
    /// Exchanges: one or two.
    pub exchanges: [Exchange; 2],
    /// AL state of each device, as received last: 1 INIT, 2 PREOP, 4 SAFEOP, 8 OP, 0 where it did not answer.
    pub states: [u8; MOST_DEVICES],
    /// Statusword (0x6041) and error code (0x603F, 0 where it is not mapped) of each drive, as received last.
    pub drives: [[u16; 2]; AXES],
    /// Process data as sent last and as received last.
    pub image: ProcessImage,
    /// The fault that stopped the machine; none without one.
    pub fault: Option<Fault>,
}

/// Process data of all devices in the order of their positions, each with its outputs before its inputs \[byte\]; those
/// beyond [`LARGEST_IMAGE`] are left out.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct ProcessImage([u8; LARGEST_IMAGE]);

impl Default for ProcessImage {
    fn default() -> Self {
        Self([0; LARGEST_IMAGE])
    }
}

impl std::fmt::Debug for ProcessImage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ProcessImage").finish_non_exhaustive()
    }
}

impl ProcessImage {
    /// Copies outputs and inputs of each device.
    pub(crate) fn record(&mut self, outputs: &[Vec<u8>], inputs: &[Vec<u8>]) {
        let bytes = outputs.iter().zip(inputs).flat_map(|(out, into)| out.iter().chain(into));
        self.0.iter_mut().zip(bytes).for_each(|(to, byte)| *to = *byte);
    }

    /// Name, outputs and inputs of each device of the table whose data were recorded completely.
    pub fn devices<'a>(
        &'a self,
        table: &'a Table,
    ) -> impl Iterator<Item = (&'a str, &'a [u8], &'a [u8])> {
        let mut rest = &self.0[..];
        table.devices.iter().map_while(move |row| {
            let (outputs, after) = rest.split_at_checked(row.output_bytes())?;
            let (inputs, after) = after.split_at_checked(row.input_bytes())?;
            rest = after;
            Some((row.name.as_str(), outputs, inputs))
        })
    }
}

/// One exchange of process data: a frame and its answer.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Exchange {
    /// Time from SYNC0 to the passage of its frame at the reference clock \[ns\]; none where it was lost.
    pub phase: Option<u32>,
    /// Its working counter; none where it was lost.
    pub working_counter: Option<u16>,
}

/// Number of a device that filled in no state.
pub(crate) const NO_STATE: u8 = 0;

/// AL state by its number in AL status, register 0x0130 (ETG.1000.6); 0 where the device did not answer.
pub(crate) fn number(state: SubDeviceState) -> u8 {
    match state {
        SubDeviceState::None => NO_STATE,
        SubDeviceState::Init => 1,
        SubDeviceState::PreOp => 2,
        SubDeviceState::Bootstrap => 3,
        SubDeviceState::SafeOp => 4,
        SubDeviceState::Op => 8,
        SubDeviceState::Other(number) => number,
    }
}
