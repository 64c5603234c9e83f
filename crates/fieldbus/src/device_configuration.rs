//! Configuration of a device in PREOP: start-up SDOs, PDO assignment and mapping, process-data watchdog, and the objects
//! that are compared with the table.
//!
//! SDOs are sent here only, never in a cycle: ethercrab 0.7.1 panics where an emergency comes in place of an answer
//! (`mailbox/coe/mod.rs:231`), and a panic of a start-up is caught and reported.

use crate::check::DeviceFacts;
use crate::link::Link;
use crate::sii;
use crate::start_up::identity;
use crate::table::{DeviceRow, Entry, NumberType, Pdo, StartUp};
use crate::wire::Wire;
use ethercrab::error::{CoeAbortCode, Error, MailboxError};
use ethercrab::{
    EtherCrabWireReadSized, EtherCrabWireWrite, RegisterAddress, SubDevice, SubDeviceRef,
};
use std::fmt::{self, Display, Formatter};
use std::ops::Deref;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Watchdog divider (0x0400) for a unit of 100 us: multiples of 40 ns, less two.
const WATCHDOG_DIVIDER: u16 = 2498;
/// Longest software version (0x100A) that is read \[byte\].
const SOFTWARE: usize = 64;
/// Unit of the process-data watchdog by that divider \[ns\].
const WATCHDOG_UNIT: u64 = 100_000;

/// Writes start-up SDOs, PDO mapping and watchdog of a device. Returns the data that it reports, or the failed part and
/// its cause.
pub(crate) fn configure<L: Link, S: Deref<Target = SubDevice>>(
    wire: &mut Wire<L>,
    device: &SubDeviceRef<'_, S>,
    row: &DeviceRow,
    is_drive: bool,
) -> Result<DeviceFacts, (String, AccessError)> {
    let part = |name: &str| {
        let name = name.to_string();
        move |cause: AccessError| (name, cause)
    };
    let mut known = identity(device);
    for value in &row.start_up {
        let what =
            format!("start-up SDO 0x{:04X}:{:02X} ({})", value.index, value.sub, value.reason);
        write(wire, device, value).map_err(part(&what))?;
    }
    let sii = sii::read(wire, device).map_err(AccessError::Bus).map_err(part("the EEPROM"))?;
    known.activations = sii.activations;
    let has_mailbox = has_mailbox(row, wire, device);
    if has_mailbox {
        // a device without a software version is no error
        known.software = software(wire, device).unwrap_or(None);
    }
    (known.outputs, known.inputs) = match has_mailbox {
        false => (sii.outputs, sii.inputs),
        true => (
            assignment(wire, device, 0x1c12, &row.outputs, row).map_err(part("0x1C12"))?,
            assignment(wire, device, 0x1c13, &row.inputs, row).map_err(part("0x1C13"))?,
        ),
    };
    if is_drive {
        known.modes = optional(wire, device, 0x6502, 0).map_err(part("0x6502"))?;
        for (reaction, index) in known.reactions.iter_mut().zip([0x605a, 0x605e, 0x6007]) {
            *reaction = optional(wire, device, index, 0).map_err(part("a stop reaction"))?;
        }
        known.velocity_unit = velocity_unit(wire, device).map_err(part("the velocity unit"))?;
    }
    if let Some(time) = row.watchdog {
        watchdog(wire, device, time).map_err(part("the watchdog"))?;
    }
    Ok(known)
}

/// Failure of an SDO or of a register access.
#[derive(Clone, Debug)]
pub(crate) enum AccessError {
    Bus(Error),
    /// ethercrab panicked: an emergency came in place of an answer.
    Panic,
    /// A register does not read back the value that was written.
    ReadbackMismatch(&'static str),
}

impl Display for AccessError {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bus(error) => error.fmt(f),
            Self::Panic => f.write_str(
                "the device sent an emergency in place of an answer: it has a fault; remove its cause (see \
                its display or manual), then start again",
            ),
            Self::ReadbackMismatch(what) => write!(f, "{what} does not read back the value that was written: \
            the device has no process-data watchdog; command no actuator through it unless its manual states another \
            reaction to missing frames; then leave watchdog_ms out"),
        }
    }
}

/// Waits for an SDO; a panic of ethercrab is caught. State that it left incomplete is not used again before the next
/// INIT.
fn sdo<L: Link, T>(
    wire: &mut Wire<L>,
    future: impl Future<Output = Result<T, Error>>,
) -> Result<T, AccessError> {
    match catch_unwind(AssertUnwindSafe(|| wire.run(future))) {
        Ok(answer) => answer.map_err(AccessError::Bus),
        Err(_) => Err(AccessError::Panic),
    }
}

/// Reads an object.
fn read<L: Link, S: Deref<Target = SubDevice>, T: EtherCrabWireReadSized>(
    wire: &mut Wire<L>,
    device: &SubDeviceRef<'_, S>,
    index: u16,
    sub: u8,
) -> Result<T, AccessError> {
    sdo(wire, device.sdo_read(index, sub))
}

/// Reads an optional object; none where the device does not have it.
pub(crate) fn optional<L: Link, S: Deref<Target = SubDevice>, T: EtherCrabWireReadSized>(
    wire: &mut Wire<L>,
    device: &SubDeviceRef<'_, S>,
    index: u16,
    sub: u8,
) -> Result<Option<T>, AccessError> {
    match read(wire, device, index, sub) {
        Ok(value) => Ok(Some(value)),
        Err(AccessError::Bus(Error::Mailbox(MailboxError::Aborted {
            code: CoeAbortCode::NotFound | CoeAbortCode::SubIndexNotFound,
            ..
        }))) => Ok(None),
        Err(error) => Err(error),
    }
}

/// Writes an object.
fn put<L: Link, S: Deref<Target = SubDevice>>(
    wire: &mut Wire<L>,
    device: &SubDeviceRef<'_, S>,
    index: u16,
    sub: u8,
    value: impl EtherCrabWireWrite,
) -> Result<(), AccessError> {
    sdo(wire, device.sdo_write(index, sub, value))
}

/// Writes the value of a start-up SDO with the size of its type.
fn write<L: Link, S: Deref<Target = SubDevice>>(
    wire: &mut Wire<L>,
    device: &SubDeviceRef<'_, S>,
    what: &StartUp,
) -> Result<(), AccessError> {
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
) -> Result<Option<String>, AccessError> {
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
    let is_absent = |error: &AccessError| {
        matches!(
            error,
            AccessError::Bus(Error::Mailbox(
                MailboxError::NoReadMailbox | MailboxError::NoWriteMailbox
            ))
        )
    };
    has_data
        && !matches!(&read::<_, _, u8>(wire, device, 0x1c12, 0), Err(error) if is_absent(error))
}

/// PDOs that 0x1C12 or 0x1C13 assigns, with their mappings. Where they differ and `mapping` is `written`, the table's
/// are written first.
fn assignment<L: Link, S: Deref<Target = SubDevice>>(
    wire: &mut Wire<L>,
    device: &SubDeviceRef<'_, S>,
    object: u16,
    wanted: &[Pdo],
    row: &DeviceRow,
) -> Result<Vec<Pdo>, AccessError> {
    let is = read_assignment(wire, device, object)?;
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
    read_assignment(wire, device, object)
}

/// PDOs that 0x1C12 or 0x1C13 assigns, as the device reports them.
fn read_assignment<L: Link, S: Deref<Target = SubDevice>>(
    wire: &mut Wire<L>,
    device: &SubDeviceRef<'_, S>,
    object: u16,
) -> Result<Vec<Pdo>, AccessError> {
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

/// Relative tolerance between feed constant and encoder resolution, for rounding.
const RATIO_TOLERANCE: f64 = 1e-9;

/// Unit of velocity \[rev/s\]; none where the device does not have the objects that state it (CiA 402-2), or where its
/// feed constant (0x6092) states other units of position than encoder increments.
fn velocity_unit<L: Link, S: Deref<Target = SubDevice>>(
    wire: &mut Wire<L>,
    device: &SubDeviceRef<'_, S>,
) -> Result<Option<f64>, AccessError> {
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
    let mut ratio = |index: u16| -> Result<Option<f64>, AccessError> {
        let (Some(over), Some(under)) = (
            optional::<_, _, u32>(wire, device, index, 1)?,
            optional::<_, _, u32>(wire, device, index, 2)?,
        ) else {
            return Ok(None);
        };
        Ok((over != 0 && under != 0).then(|| f64::from(over) / f64::from(under)))
    };
    let Some(resolution) = ratio(0x608f)? else { return Ok(None) };
    let is_other = |feed: f64| (feed / resolution - 1.0).abs() > RATIO_TOLERANCE;
    if ratio(0x6092)?.is_some_and(is_other) {
        return Ok(None);
    }
    let (gear, factor) = (ratio(0x6091)?.unwrap_or(1.0), ratio(0x6096)?.unwrap_or(1.0));
    Ok(Some(gear / factor / resolution))
}

/// Sets the process-data watchdog, and reads it back.
fn watchdog<L: Link, S>(
    wire: &mut Wire<L>,
    device: &SubDeviceRef<'_, S>,
    time: u64,
) -> Result<(), AccessError> {
    let units = (time / WATCHDOG_UNIT) as u16;
    let registers = [
        (RegisterAddress::WatchdogDivider, WATCHDOG_DIVIDER, "register 0x0400"),
        (RegisterAddress::SyncManagerWatchdog, units, "register 0x0420"),
    ];
    for (register, value, name) in registers {
        let address: u16 = register.into();
        wire.run(device.register_write(address, value)).map_err(AccessError::Bus)?;
        let kept: u16 = wire.run(device.register_read(address)).map_err(AccessError::Bus)?;
        if kept != value {
            return Err(AccessError::ReadbackMismatch(name));
        }
    }
    Ok(())
}
