//! Start-up: from a link to devices in OP that exchange process data by their clocks.
//!
//! ```text
//! INIT -> PREOP    devices found and checked against the table, start-up SDOs, PDO mapping, watchdogs, clocks
//! PREOP -> SAFEOP  exchange of process data begins: inputs are valid, outputs stay safe
//! SAFEOP -> OP     requested while process data are exchanged, as drives refuse OP without them
//! ```
//!
//! SDOs are sent here only, never in a cycle: ethercrab 0.7.1 panics where an emergency comes in place of an answer
//! (`mailbox/coe/mod.rs:231`), and a panic of a start-up is caught and reported.

use crate::bus::{Bus, Times};
use crate::check::{DeviceFacts, Mismatch, mismatches};
use crate::frame_ring::FrameRing;
use crate::link::Link;
use crate::pace::Pace;
use crate::sii;
use crate::table::{DeviceRow, Entry, NumberType, Pdo, StartUp, Sync, Table};
use crate::time::now;
use crate::wire::Wire;
use ethercrab::error::{CoeAbortCode, Error, MailboxError};
use ethercrab::subdevice_group::{DcConfiguration, HasDc, NoDc, Op, PreOp, PreOpPdi, SafeOp};
use ethercrab::{
    AlStatusCode, DcSync, DefaultLock, EtherCrabWireReadSized, EtherCrabWireWrite,
    MainDeviceConfig, RegisterAddress, SubDevice, SubDeviceGroup, SubDeviceRef, SubDeviceState,
};
use std::fmt::{self, Display, Formatter};
use std::ops::Deref;
use std::panic::{AssertUnwindSafe, catch_unwind};
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
const UNTIL_OP: u64 = 5_000_000_000;
/// State INIT, as it is requested.
const INIT: u8 = 1;
/// Attempts to send the request for INIT, as frames may be lost.
const TRIES: u32 = 3;
/// Watchdog divider (0x0400) for a unit of 100 us: multiples of 40 ns, less two.
const WATCHDOG_DIVIDER: u16 = 2498;
/// Longest software version (0x100A) that is read \[byte\].
const SOFTWARE: usize = 64;
/// Unit of the process-data watchdog by that divider \[ns\].
const WATCHDOG_UNIT: u64 = 100_000;

/// Why a bus did not start.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StartError {
    /// The devices are not those of the table, or not set up as it says: one sentence each.
    Mismatch(Vec<String>),
    /// A part of the start-up failed.
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
    /// Starts the bus of a table on a link.
    ///
    /// # Errors
    ///
    /// [`StartError`], which says what to do.
    pub fn start(table: Table, link: L) -> Result<Self, StartError> {
        let frames = FrameRing::of(&table);
        let wire = Wire::new(link, MainDeviceConfig::default(), frames)
            .map_err(|error| failed("the main device could not be made", error))?;
        Self::start_on(table, wire)
    }

    pub(crate) fn start_on(table: Table, mut wire: Wire<L>) -> Result<Self, StartError> {
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
        let (group, pace) = into_op(&mut wire, group, &table)?;
        Ok(Self::running(table, wire, group, pace, facts, times))
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
        facts[position] = prepare_device(wire, &device, row, is_drive).map_err(|(what, e)| {
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

/// Writes SDOs, PDO mapping and watchdog of a device. Returns the data that it reports, or the failed part and its
/// cause.
pub(crate) fn prepare_device<L: Link, S: Deref<Target = SubDevice>>(
    wire: &mut Wire<L>,
    device: &SubDeviceRef<'_, S>,
    row: &DeviceRow,
    is_drive: bool,
) -> Result<DeviceFacts, (String, Trouble)> {
    let told = |what: &str| {
        let what = what.to_string();
        move |trouble: Trouble| (what, trouble)
    };
    let mut known = identity(device);
    for value in &row.start_up {
        let what =
            format!("start-up SDO 0x{:04X}:{:02X} ({})", value.index, value.sub, value.reason);
        write(wire, device, value).map_err(told(&what))?;
    }
    let sii = sii::read(wire, device).map_err(Trouble::Bus).map_err(told("the EEPROM"))?;
    known.activations = sii.activations;
    let has_mailbox = has_mailbox(row, wire, device);
    if has_mailbox {
        // a device without a software version is no error
        known.software = software(wire, device).unwrap_or(None);
    }
    (known.outputs, known.inputs) = match has_mailbox {
        false => (sii.outputs, sii.inputs),
        true => (
            lists(wire, device, 0x1c12, &row.outputs, row).map_err(told("0x1C12"))?,
            lists(wire, device, 0x1c13, &row.inputs, row).map_err(told("0x1C13"))?,
        ),
    };
    if is_drive {
        known.modes = optional(wire, device, 0x6502, 0).map_err(told("0x6502"))?;
        for (reaction, index) in known.reactions.iter_mut().zip([0x605a, 0x605e, 0x6007]) {
            *reaction = optional(wire, device, index, 0).map_err(told("a stop reaction"))?;
        }
        known.velocity_unit = velocity_unit(wire, device).map_err(told("the velocity unit"))?;
    }
    if let Some(time) = row.watchdog {
        watchdog(wire, device, time).map_err(told("the watchdog"))?;
    }
    Ok(known)
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
        failed("the distributed clocks could not be set up; does a device have one?", e)
    })
}

/// Exchanges process data in SAFEOP, as drives refuse OP without them; returns the phase of SYNC0 once it runs.
pub(crate) fn settle<L: Link>(wire: &mut Wire<L>, group: &Devices<SafeOp>, table: &Table) -> Pace {
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

/// Sets up the clocks, and brings the devices to SAFEOP and OP.
fn into_op<L: Link>(
    wire: &mut Wire<L>,
    group: Devices<PreOp, NoDc>,
    table: &Table,
) -> Result<(Devices<Op>, Pace), StartError> {
    let main = wire.main;
    let group = with_clocks(wire, group, table)?;
    let group = match wire.run(group.into_safe_op(main)) {
        Ok(group) => group,
        Err(error) => {
            return Err(failed("the devices did not go to SAFEOP", refusals(wire, table, error)));
        }
    };
    let mut pace = settle(wire, &group, table);
    let group = match wire.run(group.request_into_op(main)) {
        Ok(group) => group,
        Err(error) => {
            return Err(failed("the devices did not go to OP", refusals(wire, table, error)));
        }
    };
    let end = now() + UNTIL_OP;
    loop {
        let sent = now();
        let answer = wire.run_until(group.tx_rx_dc(main), sent + table.bus.period);
        let answer = answer.and_then(Result::ok);
        pace.update(sent, answer.as_ref().map(|answer| answer.extra.dc_system_time));
        if answer.is_some_and(|answer| answer.is_in_state(SubDeviceState::Op)) {
            return Ok((group, pace));
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
                found.push(format!("{} (position {position}) reports {}", row.name, al_text(code)))
            }
            Err(_) => found.push(format!("{} (position {position}) does not answer", row.name)),
        }
    }
    if found.is_empty() { error.to_string() } else { found.join("; ") }
}

/// Requests INIT of all devices, so that their watchdogs do not expire. A device that misses the request is stopped by
/// its watchdog.
pub(crate) fn to_init<L: Link>(wire: &mut Wire<L>, period: u64) {
    let main = wire.main;
    let init = ethercrab::Command::bwr(RegisterAddress::AlControl.into());
    for _ in 0..TRIES {
        let end = now() + period;
        let sent = wire.run_until(init.send(main, [INIT, 0]), end);
        if sent.is_some_and(|sent| sent.is_ok()) {
            return;
        }
    }
}

/// Text of an AL status code.
pub(crate) fn al_text(code: u16) -> String {
    use ethercrab::EtherCrabWireRead;
    AlStatusCode::unpack_from_slice(&code.to_le_bytes())
        .map_or_else(|_| format!("{code:#06x}"), |code| code.to_string())
}

/// Failure of an SDO or of a register access.
#[derive(Clone, Debug)]
pub(crate) enum Trouble {
    Bus(Error),
    /// ethercrab panicked: an emergency came in place of an answer.
    Panic,
    /// A register does not read back the value that was written.
    NotKept(&'static str),
}

impl Display for Trouble {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bus(error) => error.fmt(f),
            Self::Panic => f.write_str(
                "the device sent an emergency in place of an answer: it has a fault; remove its cause (see \
                its display or manual), then start again",
            ),
            Self::NotKept(what) => write!(f, "{what} does not read back the value that was written: \
            the device does not have this watchdog; leave watchdog_ms out"),
        }
    }
}

/// Waits for an SDO; a panic of ethercrab is caught. State that it left incomplete is not used again before the next
/// INIT.
fn sdo<L: Link, T>(
    wire: &mut Wire<L>,
    future: impl Future<Output = Result<T, Error>>,
) -> Result<T, Trouble> {
    match catch_unwind(AssertUnwindSafe(|| wire.run(future))) {
        Ok(answer) => answer.map_err(Trouble::Bus),
        Err(_) => Err(Trouble::Panic),
    }
}

fn read<L: Link, S: Deref<Target = SubDevice>, T: EtherCrabWireReadSized>(
    wire: &mut Wire<L>,
    device: &SubDeviceRef<'_, S>,
    index: u16,
    sub: u8,
) -> Result<T, Trouble> {
    sdo(wire, device.sdo_read(index, sub))
}

/// Reads an optional object; none where the device does not have it.
pub(crate) fn optional<L: Link, S: Deref<Target = SubDevice>, T: EtherCrabWireReadSized>(
    wire: &mut Wire<L>,
    device: &SubDeviceRef<'_, S>,
    index: u16,
    sub: u8,
) -> Result<Option<T>, Trouble> {
    match read(wire, device, index, sub) {
        Ok(value) => Ok(Some(value)),
        Err(Trouble::Bus(Error::Mailbox(MailboxError::Aborted {
            code: CoeAbortCode::NotFound | CoeAbortCode::SubIndexNotFound,
            ..
        }))) => Ok(None),
        Err(trouble) => Err(trouble),
    }
}

fn put<L: Link, S: Deref<Target = SubDevice>>(
    wire: &mut Wire<L>,
    device: &SubDeviceRef<'_, S>,
    index: u16,
    sub: u8,
    value: impl EtherCrabWireWrite,
) -> Result<(), Trouble> {
    sdo(wire, device.sdo_write(index, sub, value))
}

fn write<L: Link, S: Deref<Target = SubDevice>>(
    wire: &mut Wire<L>,
    device: &SubDeviceRef<'_, S>,
    what: &StartUp,
) -> Result<(), Trouble> {
    let (index, sub, value) = (what.index, what.sub, what.value);
    match what.kind {
        NumberType::Bool | NumberType::U8 | NumberType::I8 => {
            put(wire, device, index, sub, value as u8)
        }
        NumberType::U16 | NumberType::I16 => put(wire, device, index, sub, value as u16),
        NumberType::U32 | NumberType::I32 => put(wire, device, index, sub, value as u32),
    }
}

/// Version of the device's software (0x100A), without control characters.
fn software<L: Link, S: Deref<Target = SubDevice>>(
    wire: &mut Wire<L>,
    device: &SubDeviceRef<'_, S>,
) -> Result<Option<String>, Trouble> {
    let read: Option<heapless::Vec<u8, SOFTWARE>> = optional(wire, device, 0x100a, 0)?;
    Ok(read.map(|bytes| {
        let text = String::from_utf8_lossy(&bytes);
        text.chars().filter(|c| !c.is_control()).collect()
    }))
}

/// Whether process data are described by objects: 0x1C12 or 0x1C13 can be read.
fn has_mailbox<L: Link, S: Deref<Target = SubDevice>>(
    row: &DeviceRow,
    wire: &mut Wire<L>,
    device: &SubDeviceRef<'_, S>,
) -> bool {
    let has_data = row.output_bytes() + row.input_bytes() > 0;
    let is_absent = |trouble: &Trouble| {
        matches!(
            trouble,
            Trouble::Bus(Error::Mailbox(
                MailboxError::NoReadMailbox | MailboxError::NoWriteMailbox
            ))
        )
    };
    has_data
        && !matches!(&read::<_, _, u8>(wire, device, 0x1c12, 0), Err(trouble) if is_absent(trouble))
}

/// The PDOs that 0x1C12 or 0x1C13 assigns. Where they differ and `mapping` is `written`, the table's are written
/// first.
fn lists<L: Link, S: Deref<Target = SubDevice>>(
    wire: &mut Wire<L>,
    device: &SubDeviceRef<'_, S>,
    object: u16,
    wanted: &[Pdo],
    row: &DeviceRow,
) -> Result<Vec<Pdo>, Trouble> {
    let is = assigned(wire, device, object)?;
    if !row.is_mapping_written || is == wanted {
        return Ok(is);
    }
    put(wire, device, object, 0, 0_u8)?;
    for pdo in wanted {
        put(wire, device, pdo.list, 0, 0_u8)?;
        for (sub, entry) in (1_u8..).zip(&pdo.entries) {
            let Entry { index, sub: of, bits } = *entry;
            let value = u32::from(index) << 16 | u32::from(of) << 8 | u32::from(bits);
            put(wire, device, pdo.list, sub, value)?;
        }
        put(wire, device, pdo.list, 0, pdo.entries.len() as u8)?;
    }
    for (sub, pdo) in (1_u8..).zip(wanted) {
        put(wire, device, object, sub, pdo.list)?;
    }
    put(wire, device, object, 0, wanted.len() as u8)?;
    assigned(wire, device, object)
}

fn assigned<L: Link, S: Deref<Target = SubDevice>>(
    wire: &mut Wire<L>,
    device: &SubDeviceRef<'_, S>,
    object: u16,
) -> Result<Vec<Pdo>, Trouble> {
    let mut lists = Vec::new();
    for number in 1..=optional::<_, _, u8>(wire, device, object, 0)?.unwrap_or(0) {
        let list: u16 = read(wire, device, object, number)?;
        let mut entries = Vec::new();
        for sub in 1..=read::<_, _, u8>(wire, device, list, 0)? {
            let entry: u32 = read(wire, device, list, sub)?;
            entries.push(Entry {
                index: (entry >> 16) as u16,
                sub: (entry >> 8) as u8,
                bits: entry as u8,
            });
        }
        lists.push(Pdo { list, entries });
    }
    Ok(lists)
}

/// Units of 0x60A9 (CiA 303-2): revolutions, seconds, minutes.
const REVOLUTION: u8 = 0xb4;
const SECOND: u8 = 0x03;
const MINUTE: u8 = 0x47;

/// Unit of velocity \[rev/s\]; none where the device does not have the objects that state it (CiA 402-2).
fn velocity_unit<L: Link, S: Deref<Target = SubDevice>>(
    wire: &mut Wire<L>,
    device: &SubDeviceRef<'_, S>,
) -> Result<Option<f64>, Trouble> {
    if let Some(unit) = optional::<_, _, u32>(wire, device, 0x60a9, 0)? {
        let [_, per, of, prefix] = unit.to_le_bytes();
        let time = match per {
            SECOND => 1.0,
            MINUTE => 60.0,
            _ => return Ok(None),
        };
        let size = 10_f64.powi(i32::from(prefix as i8)) / time;
        return Ok((of == REVOLUTION).then_some(size));
    }
    let mut ratio = |index: u16| -> Result<Option<f64>, Trouble> {
        let (Some(over), Some(under)) = (
            optional::<_, _, u32>(wire, device, index, 1)?,
            optional::<_, _, u32>(wire, device, index, 2)?,
        ) else {
            return Ok(None);
        };
        Ok((over != 0 && under != 0).then(|| f64::from(over) / f64::from(under)))
    };
    let Some(resolution) = ratio(0x608f)? else { return Ok(None) };
    let (gear, factor) = (ratio(0x6091)?.unwrap_or(1.0), ratio(0x6096)?.unwrap_or(1.0));
    Ok(Some(gear / factor / resolution))
}

/// Sets the process-data watchdog, and reads it back.
fn watchdog<L: Link, S>(
    wire: &mut Wire<L>,
    device: &SubDeviceRef<'_, S>,
    time: u64,
) -> Result<(), Trouble> {
    let units = (time / WATCHDOG_UNIT) as u16;
    let registers = [
        (RegisterAddress::WatchdogDivider, WATCHDOG_DIVIDER, "register 0x0400"),
        (RegisterAddress::SyncManagerWatchdog, units, "register 0x0420"),
    ];
    for (register, value, name) in registers {
        let address: u16 = register.into();
        wire.run(device.register_write(address, value)).map_err(Trouble::Bus)?;
        let kept: u16 = wire.run(device.register_read(address)).map_err(Trouble::Bus)?;
        if kept != value {
            return Err(Trouble::NotKept(name));
        }
    }
    Ok(())
}
