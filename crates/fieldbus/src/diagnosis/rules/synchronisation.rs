//! Synchronisation: activation by the EEPROM and by register 0x0981, objects 0x1C32 and 0x1C33, clock difference.

use super::name;
use crate::diagnosis::facts::{BusFacts, SetUp};
use crate::diagnosis::finding::{Finding, Stage};
use crate::table::{DeviceRow, Sync, Table};

/// Synchronisation type of 0x1C32:01 and 0x1C33:01 (ETG.1020): by SYNC0.
const BY_SYNC0: u16 = 2;
/// By SYNC1.
const BY_SYNC1: u16 = 3;
/// Inputs by the sync manager event of the outputs.
const BY_OUTPUTS: u16 = 0x22;
/// Difference from the reference clock beyond which a clock does not follow it \[ns\]: far above the microsecond that
/// devices keep to.
const LARGEST_DIFFERENCE: i64 = 20_000;

/// Findings of clocks and synchronisation objects, for devices that were set up.
pub(super) fn findings(table: &Table, bus: &BusFacts) -> Vec<Finding> {
    let mut found = Vec::new();
    let reference = bus.devices.iter().position(|device| device.has_clock);
    for (position, (row, set_up)) in table.devices.iter().zip(&bus.set_up).enumerate() {
        let this = name(table, bus, position);
        let modes = bus.devices.get(position).map_or(&[][..], |device| &device.activations);
        found.extend(activation(&this, row, set_up, modes));
        found.extend(types(&this, row, set_up));
        found.extend(cycles(&this, table, row, set_up));
        // the reference clock follows no other: its register 0x092C is not updated
        if reference != Some(position) {
            found.extend(clock(&this, row, set_up));
        }
    }
    if let Some(why) = &bus.clocks_refused {
        found.push(Finding::error(
            Stage::Synchronisation,
            why.clone(),
            "at least one device needs a distributed clock; the first one that has it is the reference",
        ));
    }
    found
}

/// Registers 0x0980 and 0x0981 against the modes of the EEPROM: the low byte of a mode is for 0x0980, the high one for
/// 0x0981.
fn activation(this: &str, row: &DeviceRow, set_up: &SetUp, modes: &[u16]) -> Option<Finding> {
    let [unit, is] = set_up.dc_activation?;
    let [_, expected] = row.sync.activation().to_le_bytes();
    if is != expected {
        return Some(Finding::error(
            Stage::Synchronisation,
            format!(
                "register 0x0981 of {this} is 0x{is:02X}, its sync in the table requires 0x{expected:02X}"
            ),
            "read in its manual which activations it supports, and set sync",
        ));
    }
    let matching = || modes.iter().filter(|mode| *mode & 0x0700 == row.sync.activation());
    let lacks_unit_bits = |mode: &u16| *mode as u8 & !unit != 0;
    let is_unwritten = expected != 0 && matching().count() > 0 && matching().all(lacks_unit_bits);
    is_unwritten.then(|| {
        let mode = matching().next().copied().unwrap_or_default();
        Finding::warning(
            Stage::Synchronisation,
            format!(
                "{this} asks for the activation 0x{mode:04X} in its EEPROM, and register 0x0980 is \
                0x{unit:02X}, which this program does not write"
            ),
            "check whether it follows SYNC0 nevertheless; some devices do",
        )
    })
}

/// 0x1C32:01 and 0x1C33:01 against the table's sync.
fn types(this: &str, row: &DeviceRow, set_up: &SetUp) -> Vec<Finding> {
    let (expected, name) = match row.sync {
        Sync::None => (None, "none"),
        Sync::Sync0 => (Some(BY_SYNC0), "sync0"),
        Sync::Sync01(_) => (Some(BY_SYNC1), "sync01"),
    };
    let mut found = Vec::new();
    for ((object, is), side) in ["0x1C32", "0x1C33"].into_iter().zip(set_up.sync_types).zip([0, 1])
    {
        let Some(is) = is else { continue };
        let by_clock = matches!(is, BY_SYNC0 | BY_SYNC1);
        let cause = format!(
            "{object}:01 of {this} is {is} ({}), the table has sync = \"{name}\"",
            type_name(is)
        );
        match expected {
            None if by_clock => found.push(Finding::error(
                Stage::Synchronisation,
                cause,
                "set sync of the table, or write 0 into the object as a start-up SDO",
            )),
            Some(expected) if !by_clock && side == 0 => found.push(Finding::error(
                Stage::Synchronisation,
                cause,
                format!("write {expected} into {object}:01 as a start-up SDO"),
            )),
            Some(expected) if is != expected && is != BY_OUTPUTS && !(side == 1 && by_clock) => {
                found.push(Finding::warning(
                    Stage::Synchronisation,
                    cause,
                    format!("write {expected} into {object}:01 as a start-up SDO where the device allows it"),
                ));
            }
            _ => {}
        }
    }
    found
}

/// Name of a synchronisation type of 0x1C32:01 or 0x1C33:01 (ETG.1020).
fn type_name(kind: u16) -> &'static str {
    match kind {
        0 => "free run",
        1 => "by the sync manager event",
        BY_SYNC0 => "by SYNC0",
        BY_SYNC1 => "by SYNC1",
        BY_OUTPUTS => "by the sync manager event of the outputs",
        _ => "manufacturer-specific",
    }
}

/// Compares the period with the device's cycle times, and its calc and copy time with the send time of outputs.
fn cycles(this: &str, table: &Table, row: &DeviceRow, set_up: &SetUp) -> Vec<Finding> {
    if row.sync == Sync::None {
        return Vec::new();
    }
    let mut found = Vec::new();
    let (period, us) = (table.bus.period, |ns: u64| 1e-3 * ns as f64);
    let stated = |time: Option<u32>| time.map(u64::from).filter(|time| *time > 0);
    if let Some(shortest) = stated(set_up.shortest_cycle).filter(|shortest| *shortest > period) {
        found.push(Finding::error(
            Stage::Synchronisation,
            format!(
                "the shortest cycle of {this} is {} us (0x1C32:05), bus.period_us is {}",
                us(shortest),
                us(period)
            ),
            "lengthen bus.period_us and the control period, or use a faster device",
        ));
    }
    if let Some(cycle) = stated(set_up.cycle).filter(|cycle| *cycle != period) {
        found.push(Finding::warning(
            Stage::Synchronisation,
            format!(
                "the cycle of {this} is {} us (0x1C32:02), bus.period_us is {}",
                us(cycle),
                us(period)
            ),
            format!("write {period} into 0x1C32:02 as a start-up SDO"),
        ));
    }
    // two exchanges: outputs are sent by the second one before SYNC0; one: by the first after the SYNC0 before
    let before = match table.bus.exchanges {
        2 => period.saturating_sub(table.bus.send),
        _ => period.saturating_sub(table.bus.exchange),
    };
    // some manufacturers state other times there, as the smallest one between SYNC0 and SYNC1
    if let Some(time) = stated(set_up.calc_and_copy).filter(|time| *time > before) {
        found.push(Finding::warning(
            Stage::Synchronisation,
            format!(
                "calc and copy time 0x1C32:06 of {this} is {} us, outputs are sent {} us before SYNC0",
                us(time),
                us(before)
            ),
            "see the device's manual for its meaning; if outputs have to arrive so long before SYNC0, lower \
            bus.send_us, or bus.exchange_us with one exchange",
        ));
    }
    found
}

/// A clock that does not follow the reference.
fn clock(this: &str, row: &DeviceRow, set_up: &SetUp) -> Option<Finding> {
    let difference = set_up.clock_difference.filter(|_| row.sync != Sync::None)?;
    (difference.abs() > LARGEST_DIFFERENCE).then(|| {
        Finding::error(
            Stage::Synchronisation,
            format!(
                "the clock of {this} is {:.1} us off the reference (0x092C) and does not follow it",
                1e-3 * difference as f64
            ),
            "replace the device, or set its sync to \"none\" where its manual allows it",
        )
    })
}
