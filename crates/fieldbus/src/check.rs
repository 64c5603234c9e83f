//! Check of the table against the data that the devices report, before clocks and process data are set up. Each
//! mismatch is one sentence that says what to do.

use crate::cia402::HAS_CYCLIC_VELOCITY;
use crate::table::{DeviceRow, Pdo, Sync, Table};
use std::fmt::{self, Display, Formatter};

/// Data that a device reports: EEPROM (SII, ETG.2010), CoE objects (ETG.1000.6, CiA 402) and registers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DeviceFacts {
    /// Name in its EEPROM.
    pub name: String,
    /// Vendor ID, product code, revision number: words 8, 10 and 12 of its EEPROM, as 0x1018:01 to 03.
    pub identity: [u32; 3],
    /// Serial number in its EEPROM (word 14); 0 where it states none.
    pub serial: u32,
    /// Version of its software (0x100A); none where it has no such object.
    pub software: Option<String>,
    /// Outputs, by 0x1C12 and mapping objects, or by its EEPROM where it has no mailbox.
    pub outputs: Vec<Pdo>,
    /// Inputs, by 0x1C13 and mapping objects, or by its EEPROM.
    pub inputs: Vec<Pdo>,
    /// Whether it has a distributed clock (register 0x0008, bit 2).
    pub has_clock: bool,
    /// AssignActivate words of its clock modes, from category 60 of its EEPROM; empty where it states none.
    pub activations: Vec<u16>,
    /// Supported drive modes (0x6502), bit 0 for mode 1; none where it has no such object.
    pub modes: Option<u32>,
    /// Drives: reactions to a quick stop (0x605A), to a fault (0x605E) and to a lost connection (0x6007), for reports.
    pub reactions: [Option<i16>; 3],
    /// One unit of 0x60FF and 0x606C \[rev/s\], from 0x60A9, or from 0x608F, 0x6091 and 0x6096; none where the drive
    /// states no unit of velocity, or a feed constant (0x6092) in other units than encoder increments.
    pub velocity_unit: Option<f64>,
}

/// Suffix of the name of a simulated device, in its EEPROM.
pub const SIMULATED: &str = " (simulated)";

impl DeviceFacts {
    /// Whether the device says that it is simulated.
    pub fn is_simulated(&self) -> bool {
        self.name.ends_with(SIMULATED)
    }
}

/// Subject of a mismatch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subject {
    /// Number, order and identity of the devices.
    Devices,
    /// Lists of process data.
    ProcessData,
    /// Distributed clock and its modes.
    Synchronisation,
    /// Mode of operation and velocity unit of a drive.
    Drive,
}

/// Difference between a device and its row of the table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mismatch {
    /// Its subject.
    pub subject: Subject,
    /// What differs.
    pub cause: String,
    /// What to do.
    pub advice: String,
}

impl Display for Mismatch {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.cause, self.advice)
    }
}

/// Relative tolerance of velocity units, for decimal factors of a table.
const UNIT_TOLERANCE: f64 = 1e-6;
/// Target velocity and velocity actual value.
const VELOCITIES: [u16; 2] = [0x60ff, 0x606c];

/// All mismatches between the table and the devices in the order of their positions; empty where they fit.
///
/// Later checks need the earlier ones: after a wrong number or identity nothing else is compared, and drives are
/// compared only where process data and clocks fit.
pub fn mismatches(table: &Table, facts: &[DeviceFacts]) -> Vec<Mismatch> {
    let mut found = Vec::new();
    if facts.len() != table.devices.len() {
        let names: Vec<&str> = facts.iter().map(|device| device.name.as_str()).collect();
        found.push(Mismatch {
            subject: Subject::Devices,
            cause: format!(
                "{} devices answer ({}), the table has {}",
                facts.len(),
                names.join(", "),
                table.devices.len()
            ),
            advice: "check cables and supply behind the last of them, or correct the table".into(),
        });
    }
    let rows = || table.devices.iter().zip(facts).enumerate();
    found.extend(rows().find_map(|(position, (row, device))| identity(position, row, device)));
    // data of a device that is not the table's cannot be compared
    if !found.is_empty() {
        return found;
    }
    for (position, (row, device)) in rows() {
        found.extend(process_data(position, row, device));
        found.extend(synchronisation(position, row, device));
    }
    if found.is_empty() {
        for drive in &table.drives {
            let (row, device) = (&table.devices[drive.device], &facts[drive.device]);
            found.extend(mode_of_operation(drive.device, row, device));
            found.extend(velocity_units(table, drive.device, device));
        }
    }
    found
}

/// Vendor and product have to be those of the row, and the revision within its range.
fn identity(position: usize, row: &DeviceRow, device: &DeviceFacts) -> Option<Mismatch> {
    let [vendor, product, revision] = device.identity;
    let [low, high] = row.revision;
    let described = format!(
        "position {position} is {} (vendor 0x{vendor:08X}, product 0x{product:08X}, revision \
        0x{revision:08X})",
        device.name
    );
    if (vendor, product) != (row.vendor, row.product) {
        return Some(Mismatch {
            subject: Subject::Devices,
            cause: format!(
                "{described}, the table has {} (vendor 0x{:08X}, product 0x{:08X}) there",
                row.name, row.vendor, row.product
            ),
            advice: "check the order of the devices, or correct the table".into(),
        });
    }
    (!(low..=high).contains(&revision)).then(|| Mismatch {
        subject: Subject::Devices,
        cause: format!("{described}, the table allows revisions 0x{low:08X} to 0x{high:08X}"),
        advice: "read in its release notes what changed, then widen the range".into(),
    })
}

/// PDOs by 0x1C12 and 0x1C13, or by the EEPROM, have to be those of the row.
fn process_data(position: usize, row: &DeviceRow, device: &DeviceFacts) -> Vec<Mismatch> {
    let sides = [
        ("outputs", "0x1C12", &row.outputs, &device.outputs),
        ("inputs", "0x1C13", &row.inputs, &device.inputs),
    ];
    sides
        .into_iter()
        .filter(|(_, _, table, device)| !is_same_mapping(table, device))
        .map(|(side, object, table, device)| Mismatch {
            subject: Subject::ProcessData,
            cause: format!(
                "{side} of {} (position {position}) are {} ({object} or EEPROM), the table has {}",
                row.name,
                mapping_text(device),
                mapping_text(table)
            ),
            advice: match row.is_mapping_written {
                true => "it did not accept the mapping that was written: correct the table by its manual",
                false => {
                    "correct the table, or set mapping = \"written\" where the device allows it"
                }
            }
            .into(),
        })
        .collect()
}

/// Whether both have the same entries in the same order. PDOs without entries are ignored.
fn is_same_mapping(one: &[Pdo], other: &[Pdo]) -> bool {
    let used = |lists: &[Pdo]| -> Vec<Pdo> {
        lists.iter().filter(|list| !list.entries.is_empty()).cloned().collect()
    };
    used(one) == used(other)
}

/// PDOs and their entries, for messages.
fn mapping_text(lists: &[Pdo]) -> String {
    let list = |pdo: &Pdo| {
        let entries: Vec<String> = pdo.entries.iter().map(ToString::to_string).collect();
        format!("0x{:04X} [{}]", pdo.list, entries.join(", "))
    };
    if lists.is_empty() {
        "none".into()
    } else {
        lists.iter().map(list).collect::<Vec<_>>().join(", ")
    }
}

/// SYNC signals of the row need a distributed clock, and an AssignActivate word of the EEPROM (category 60) that
/// activates the same ones.
fn synchronisation(position: usize, row: &DeviceRow, device: &DeviceFacts) -> Option<Mismatch> {
    let subject = Subject::Synchronisation;
    let expected = row.sync.activation();
    if expected == 0 {
        return None;
    }
    if !device.has_clock {
        return Some(Mismatch {
            subject,
            cause: format!(
                "{} (position {position}) has no distributed clock, and the table sets sync for it",
                row.name
            ),
            advice: "set sync = \"none\"".into(),
        });
    }
    let is_supported = device.activations.iter().any(|mode| mode & 0x0700 == expected);
    let modes: Vec<String> =
        device.activations.iter().map(|mode| format!("0x{mode:04X}")).collect();
    let name = match row.sync {
        Sync::Sync01(_) => "SYNC0 and SYNC1",
        _ => "SYNC0",
    };
    (!is_supported && !device.activations.is_empty()).then(|| Mismatch {
        subject,
        cause: format!(
            "the EEPROM of {} (position {position}) lists AssignActivate {}, the table requires \
            0x{expected:04X} ({name})",
            row.name,
            modes.join(", ")
        ),
        advice: "set sync to one of its DC modes".into(),
    })
}

/// A drive has to support cyclic synchronous velocity (0x6502, bit 8).
fn mode_of_operation(position: usize, row: &DeviceRow, device: &DeviceFacts) -> Option<Mismatch> {
    let modes = device.modes?;
    (modes & HAS_CYCLIC_VELOCITY == 0).then(|| Mismatch {
        subject: Subject::Drive,
        cause: format!(
            "{} (position {position}) does not support cyclic synchronous velocity (0x6502 is \
            0x{modes:08X}, bit 8 is 0)",
            row.name
        ),
        advice: "enable it in the drive, or use another drive".into(),
    })
}

/// Compares the velocity unit that a drive states with the table's factors.
fn velocity_units(table: &Table, position: usize, device: &DeviceFacts) -> Vec<Mismatch> {
    let Some(unit) = device.velocity_unit else { return Vec::new() };
    let row = &table.devices[position];
    let place = |lists: &[Pdo], index: u16| {
        let mut bit = 0;
        for entry in lists.iter().flat_map(|list| &list.entries) {
            if entry.index == index {
                return Some(bit);
            }
            bit += usize::from(entry.bits);
        }
        None
    };
    let commanded = table.commanded.iter().map(|row| (row.place, row.scale, VELOCITIES[0]));
    let measured = table.measured.iter().map(|row| (row.place, row.scale, VELOCITIES[1]));
    commanded
        .chain(measured)
        .filter(|(at, _, index)| {
            let lists = if *index == VELOCITIES[0] { &row.outputs } else { &row.inputs };
            at.device == position && Some(at.bit) == place(lists, *index)
        })
        .filter(|(_, scale, _)| (scale.factor.abs() / unit - 1.0).abs() > UNIT_TOLERANCE)
        .map(|(_, scale, index)| Mismatch {
            subject: Subject::Drive,
            cause: format!(
                "one unit of 0x{index:04X} of {} (position {position}) is {unit:e} rev/s by its objects \
                0x60A9 or 0x608F, 0x6091 and 0x6096, the table's factor is {:e}",
                row.name,
                scale.factor.abs()
            ),
            advice: "set factor to the drive's unit".into(),
        })
        .collect()
}
