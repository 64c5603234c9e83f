//! Start-up: from a link to devices in SAFEOP or OP that exchange process data by their clocks.
//!
//! ```text
//! INIT -> PREOP    devices found and checked against the table, start-up SDOs, PDO mapping, watchdogs, clocks
//! PREOP -> SAFEOP  exchange of process data begins: inputs are valid, outputs stay safe
//! SAFEOP -> OP     requested while process data are exchanged, as drives refuse OP without them; at the start, or
//!                  once drives are to be enabled
//! ```

use crate::al_status_code::{Explanation, explanation};
use crate::bus::Bus;
use crate::check::{DeviceFacts, Mismatch, mismatches};
use crate::device_configuration::configure;
use crate::frame_ring::FrameRing;
use crate::link::Link;
use crate::pace::Pace;
use crate::statistics::Times;
use crate::table::{Sync, Table};
use crate::time::now;
use crate::wire::Wire;
use ethercrab::error::Error;
use ethercrab::subdevice_group::{DcConfiguration, HasDc, NoDc, PreOp, PreOpPdi, SafeOp};
use ethercrab::{
    DcSync, DefaultLock, MainDeviceConfig, RegisterAddress, SubDevice, SubDeviceGroup,
    SubDeviceState,
};
use std::fmt::{self, Display, Formatter};
use std::time::Duration;

/// Most devices on a bus.
pub const MOST_DEVICES: usize = 16;
/// Most process data of all devices \[byte\].
pub const LARGEST_IMAGE: usize = 512;

/// Devices in a state.
pub(crate) type Devices<S, C = HasDc> =
    SubDeviceGroup<MOST_DEVICES, LARGEST_IMAGE, DefaultLock, S, C>;

/// Time from the set-up of the clocks to the first SYNC0 \[ns\], in which the devices' registers are written.
const FIRST_PULSE: u64 = 100_000_000;
/// Timeout of the transition from SAFEOP to OP \[ns\]; drives that lock onto SYNC0 take hundreds of milliseconds.
pub(crate) const UNTIL_OP: u64 = 5_000_000_000;
/// Numbers of the states INIT, SAFEOP and OP in AL control and AL status.
const INIT: u8 = 1;
pub(crate) const SAFE_OP: u8 = 4;
pub(crate) const OP: u8 = 8;
/// Attempts to request INIT, as frames may be lost.
const ATTEMPTS: u32 = 3;
/// State of the devices once their bus has started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InitialState {
    /// SAFEOP: inputs are valid and outputs stay safe. OP is requested by the first command that enables drives, and
    /// by a person's reset of a fault.
    SafeOp,
    /// OP: outputs act from the first cycle on; drives are still without torque until a command enables them.
    Op,
}

/// Why a bus did not start.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StartError {
    /// The devices are not those of the table, or not set up as it says: one sentence each.
    Mismatch(Vec<String>),
    /// A part of the start-up failed: which, and why, in one sentence.
    Failed(String),
}

impl Display for StartError {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mismatch(sentences) => f.write_str(&sentences.join("\n")),
            Self::Failed(sentence) => f.write_str(sentence),
        }
    }
}

impl std::error::Error for StartError {}

fn failed(what: &str, error: impl Display) -> StartError {
    StartError::Failed(format!("{what}: {error}"))
}

impl<L: Link> Bus<L> {
    /// Starts the bus of a table on a link, and brings the devices to OP.
    ///
    /// # Errors
    ///
    /// As of [`start_in`](Self::start_in).
    pub fn start(table: Table, link: L) -> Result<Self, StartError> {
        Self::start_in(InitialState::Op, table, link)
    }

    /// Starts the bus of a table on a link, and brings the devices to a state.
    ///
    /// # Errors
    ///
    /// - [`StartError::Mismatch`] where the devices are not those of the table, or not set up as it says.
    /// - [`StartError::Failed`] where no device answers, a device refuses a state, or another part of the start-up
    ///   fails.
    pub fn start_in(state: InitialState, table: Table, link: L) -> Result<Self, StartError> {
        let frames = FrameRing::of(&table);
        let wire = Wire::new(link, MainDeviceConfig::default(), frames)
            .map_err(|error| failed("the main device could not be created", error))?;
        Self::start_on(state, table, wire)
    }

    /// Starts the bus anew, with its link.
    pub(crate) fn start_on(
        state: InitialState,
        table: Table,
        mut wire: Wire<L>,
    ) -> Result<Self, StartError> {
        // of an earlier start
        wire.frames.freeze(false);
        let times = Times::new()
            .ok_or_else(|| StartError::Failed("no memory for the timing histograms".into()))?;
        let main = wire.main;
        let group: Devices<PreOp, NoDc> =
            wire.run(main.init_single_group(now)).map_err(|error| {
                failed("the search for devices failed; check cable and supply", error)
            })?;
        if group.is_empty() {
            return Err(StartError::Failed(
                "no device answers: check the cable and the supply of the first device".into(),
            ));
        }
        let facts = prepare(&mut wire, &group, &table)?;
        let (group, mut pace) = into_safe_op(&mut wire, group, &table)?;
        if state == InitialState::Op {
            into_op(&mut wire, &group, &mut pace, &table)?;
        }
        Ok(Self::running(state, table, wire, group, pace, facts, times))
    }
}

/// Checks devices, writes SDOs and watchdogs; returns the data that the devices report.
fn prepare<L: Link>(
    wire: &mut Wire<L>,
    group: &Devices<PreOp, NoDc>,
    table: &Table,
) -> Result<Vec<DeviceFacts>, StartError> {
    let main = wire.main;
    let mut facts = Vec::new();
    for position in 0..group.len() {
        let device = group
            .subdevice(main, position)
            .map_err(|e| failed("a device could not be addressed", e))?;
        facts.push(identity(&device));
    }
    // nothing is written to a device that is not the table's
    if facts.len() != table.devices.len() || !identities_fit(table, &facts) {
        return Err(mismatch(&mismatches(table, &facts)));
    }
    for (position, row) in table.devices.iter().enumerate() {
        let device = group
            .subdevice(main, position)
            .map_err(|e| failed("a device could not be addressed", e))?;
        let is_drive = table.drives.iter().any(|drive| drive.device == position);
        facts[position] = configure(wire, &device, row, is_drive).map_err(|(what, e)| {
            failed(&format!("{what} of {} (position {position})", row.name), e)
        })?;
    }
    match mismatches(table, &facts) {
        found if found.is_empty() => Ok(facts),
        found => Err(mismatch(&found)),
    }
}

fn mismatch(found: &[Mismatch]) -> StartError {
    StartError::Mismatch(found.iter().map(ToString::to_string).collect())
}

pub(crate) fn identity(device: &SubDevice) -> DeviceFacts {
    let identity = device.identity();
    DeviceFacts {
        name: device.name().into(),
        identity: [identity.vendor_id, identity.product_id, identity.revision],
        serial: identity.serial,
        has_clock: device.dc_support().any(),
        ..DeviceFacts::default()
    }
}

pub(crate) fn identities_fit(table: &Table, facts: &[DeviceFacts]) -> bool {
    table.devices.iter().zip(facts).all(|(row, device)| {
        let [vendor, product, revision] = device.identity;
        (vendor, product) == (row.vendor, row.product)
            && (row.revision[0]..=row.revision[1]).contains(&revision)
    })
}

/// Maps process data, and sets the clocks up.
pub(crate) fn with_clocks<L: Link>(
    wire: &mut Wire<L>,
    mut group: Devices<PreOp, NoDc>,
    table: &Table,
) -> Result<Devices<PreOpPdi>, StartError> {
    let main = wire.main;
    for (mut device, row) in group.iter_mut(main).zip(&table.devices) {
        device.set_dc_sync(match row.sync {
            Sync::None => DcSync::Disabled,
            Sync::Sync0 => DcSync::Sync0,
            Sync::Sync01(time) => DcSync::Sync01 { sync1_period: Duration::from_nanos(time) },
        });
    }
    let clocks = DcConfiguration {
        start_delay: Duration::from_nanos(FIRST_PULSE),
        sync0_period: Duration::from_nanos(table.bus.period),
        sync0_shift: Duration::ZERO,
    };
    let group = wire
        .run(group.into_pre_op_pdi(main))
        .map_err(|e| failed("process data could not be mapped", e))?;
    wire.run(group.configure_dc_sync(main, clocks)).map_err(|e| {
        let what = "the distributed clocks could not be set up; does at least one device support distributed clocks?";
        failed(what, e)
    })
}

/// Exchanges process data in SAFEOP, as drives refuse OP without them; returns the phase of SYNC0 once it runs.
pub(crate) fn exchange_until_sync0<L: Link>(
    wire: &mut Wire<L>,
    group: &Devices<SafeOp>,
    table: &Table,
) -> Pace {
    let main = wire.main;
    let mut pace = Pace::new(&table.bus);
    let first = now() + 2 * FIRST_PULSE;
    while now() < first {
        let sent = now();
        let answer = wire.run_until(group.tx_rx_dc(main), sent + table.bus.period);
        pace.update(sent, answer.and_then(Result::ok).map(|answer| answer.extra.dc_system_time));
        wire.link.wait(pace.next_exchange());
    }
    pace
}

/// Sets up the clocks, brings the devices to SAFEOP, and exchanges process data there; returns the phase of SYNC0.
fn into_safe_op<L: Link>(
    wire: &mut Wire<L>,
    group: Devices<PreOp, NoDc>,
    table: &Table,
) -> Result<(Devices<SafeOp>, Pace), StartError> {
    let main = wire.main;
    let group = with_clocks(wire, group, table)?;
    match wire.run(group.into_safe_op(main)) {
        Ok(group) => {
            let pace = exchange_until_sync0(wire, &group, table);
            Ok((group, pace))
        }
        Err(error) => Err(failed("the devices did not go to SAFEOP", refusals(wire, table, error))),
    }
}

/// Brings the devices from SAFEOP to OP, while process data are exchanged. The type of `group` stays that of the state
/// in which the exchange began.
fn into_op<L: Link>(
    wire: &mut Wire<L>,
    group: &Devices<SafeOp>,
    pace: &mut Pace,
    table: &Table,
) -> Result<(), StartError> {
    let main = wire.main;
    let end = now() + UNTIL_OP;
    let mut is_requested = false;
    loop {
        if !is_requested {
            is_requested = request(wire, OP, now() + table.bus.period);
        }
        let sent = now();
        let answer = wire.run_until(group.tx_rx_dc(main), sent + table.bus.period);
        let answer = answer.and_then(Result::ok);
        pace.update(sent, answer.as_ref().map(|answer| answer.extra.dc_system_time));
        if answer.is_some_and(|answer| answer.is_in_state(SubDeviceState::Op)) {
            return Ok(());
        }
        if now() > end {
            return Err(failed(
                "the devices did not go to OP",
                refusals(wire, table, Error::StateTransition),
            ));
        }
        wire.link.wait(pace.next_exchange());
    }
}

/// The devices that refused a state, with their AL status codes.
fn refusals<L: Link>(wire: &mut Wire<L>, table: &Table, error: Error) -> String {
    let main = wire.main;
    let mut found = Vec::new();
    for (position, row) in (0_u16..).zip(&table.devices) {
        let read = ethercrab::Command::aprd(position, RegisterAddress::AlStatusCode.into());
        match wire.run(read.receive::<u16>(main)) {
            Ok(0) => {}
            Ok(code) => {
                let Explanation { cause, advice, .. } = explanation(code);
                found.push(format!(
                    "{} (position {position}) reports AL status code 0x{code:04X}: {cause}; {advice}",
                    row.name
                ));
            }
            Err(_) => found.push(format!("{} (position {position}) does not answer", row.name)),
        }
    }
    if found.is_empty() { error.to_string() } else { found.join("; ") }
}

/// Requests INIT of all devices, so that their watchdogs do not expire. A device that misses the request is stopped by
/// its watchdog.
pub(crate) fn to_init<L: Link>(wire: &mut Wire<L>, period: u64) {
    for _ in 0..ATTEMPTS {
        if request(wire, INIT, now() + period) {
            return;
        }
    }
}

/// Requests a state of all devices by one broadcast to AL control, and waits for the frame until a time \[ns\]; returns
/// whether the frame came back.
pub(crate) fn request<L: Link>(wire: &mut Wire<L>, state: u8, end: u64) -> bool {
    let main = wire.main;
    let control = ethercrab::Command::bwr(RegisterAddress::AlControl.into());
    wire.run_until(control.send(main, [state, 0]), end).is_some_and(|sent| sent.is_ok())
}
