//! Content of the EEPROM (SII): identity, mailboxes, and categories for strings, general data, FMMUs, sync managers,
//! process data and clocks.
//!
//! Source: ETG.1000.6, slave information interface; ETG.2010.

use super::settings::{Area, MAILBOX_CONTROL, PROCESS_DATA_CONTROL, Settings};
use crate::object_dictionary::ObjectDictionary;

/// Suffix of the name of each simulated device in its EEPROM, so that nobody takes it for a real one.
const SIMULATED: &str = " (simulated)";
/// Bytes before the first category.
const CATEGORIES: usize = 0x80;
/// Size of the EEPROM in kbit, less one, as its header states.
const SIZE: u16 = 15;

/// Content of a device's EEPROM, in bytes, from its settings and the process data of its dictionary.
pub fn content(settings: &Settings, dictionary: &ObjectDictionary) -> Vec<u8> {
    let mut bytes = vec![0; CATEGORIES];
    let mut put = |word: usize, value: &[u8]| {
        bytes[2 * word..2 * word + value.len()].copy_from_slice(value);
    };
    // interface, of which a checksum is made: an application's bus, or 16 digital channels
    put(
        0,
        &[
            if settings.has_device_emulation { 0x04 } else { 0x05 },
            if settings.has_device_emulation { 1 } else { 0 },
        ],
    );
    let identity = settings.identity;
    for (k, number) in [identity.vendor, identity.product, identity.revision, identity.serial]
        .into_iter()
        .enumerate()
    {
        put(8 + 2 * k, &number.to_le_bytes());
    }
    if let Some([request, answer]) = settings.mailbox {
        for (k, area) in [request, answer].into_iter().enumerate() {
            put(0x18 + 2 * k, &area.start.to_le_bytes());
            put(0x19 + 2 * k, &area.length.to_le_bytes());
        }
        put(0x1c, &[0x04, 0]);
    }
    put(0x3e, &SIZE.to_le_bytes());
    put(0x3f, &[1, 0]);
    let check = checksum(&bytes[..14]);
    bytes[14] = check;

    let name = format!("{}{SIMULATED}", settings.name);
    category(&mut bytes, 10, &strings(&[&name]));
    category(&mut bytes, 30, &general(settings));
    category(&mut bytes, 40, &fmmu_usages(settings));
    category(&mut bytes, 41, &sync_managers(settings));
    for (kind, assignment, area) in [(50, 0x1c13, settings.inputs), (51, 0x1c12, settings.outputs)]
    {
        if let Some(area) = area {
            category(&mut bytes, kind, &process_data(dictionary, assignment, area));
        }
    }
    let synchronisation = settings.synchronisation;
    if synchronisation.has_sync0 {
        let mut modes = clock_mode(0x0300);
        if synchronisation.has_sync1 {
            modes.extend(clock_mode(0x0700));
        }
        category(&mut bytes, 60, &modes);
    }
    bytes.extend([0xff; 2]);
    bytes
}

/// Checksum of words 0 to 6: CRC-8 with x^8 + x^2 + x + 1, initial value 0xFF (ETG.1000.6).
fn checksum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0xff, |sum, byte| {
        (0..8).fold(sum ^ byte, |sum, _| if sum & 0x80 != 0 { sum << 1 ^ 0x07 } else { sum << 1 })
    })
}

/// Adds a category: its number, its length in words, its data.
fn category(to: &mut Vec<u8>, kind: u16, data: &[u8]) {
    to.extend(kind.to_le_bytes());
    to.extend((data.len().div_ceil(2) as u16).to_le_bytes());
    to.extend(data);
    if data.len() % 2 == 1 {
        to.push(0);
    }
}

/// Category 10: number of strings, then each with its length \[byte\] before it.
fn strings(all: &[&str]) -> Vec<u8> {
    let mut bytes = vec![all.len() as u8];
    for text in all {
        bytes.push(text.len() as u8);
        bytes.extend(text.bytes());
    }
    bytes
}

/// Category 30, general data: the name for group, image, order and device; CoE details where there is a mailbox.
fn general(settings: &Settings) -> Vec<u8> {
    let mut bytes = vec![0; 32];
    bytes[..4].fill(1);
    // SDO; assignment and configuration of PDOs
    bytes[5] = if settings.mailbox.is_some() { 0x0d } else { 0 };
    // two ports by MII
    bytes[16..18].copy_from_slice(&0x0011_u16.to_le_bytes());
    bytes
}

/// Category 40, usage of each FMMU: 1 outputs, 2 inputs, 3 state of the mailbox.
fn fmmu_usages(settings: &Settings) -> Vec<u8> {
    let usages =
        [settings.outputs.map(|_| 1), settings.inputs.map(|_| 2), settings.mailbox.map(|_| 3)];
    usages.into_iter().flatten().collect()
}

/// Category 41, each sync manager: start, length, control, activation, type (1 to 4).
fn sync_managers(settings: &Settings) -> Vec<u8> {
    let [request, answer] =
        settings.mailbox.map_or([None; 2], |[request, answer]| [Some(request), Some(answer)]);
    let all = [
        (request, MAILBOX_CONTROL[0], 1),
        (answer, MAILBOX_CONTROL[1], 2),
        (settings.outputs, PROCESS_DATA_CONTROL[0], 3),
        (settings.inputs, PROCESS_DATA_CONTROL[1], 4),
    ];
    let areas: Vec<(Area, u8, u8)> =
        all.into_iter().filter_map(|(area, control, kind)| Some((area?, control, kind))).collect();
    let count = areas.iter().map(|(area, ..)| area.sync_manager + 1).max().unwrap_or(0);
    let bytes = |number: u16| {
        let used = areas.iter().find(|(area, ..)| area.sync_manager == number);
        // the place in the list is the number: one that is not used has its place too
        let Some((area, control, kind)) = used else { return [0; 8] };
        let [start, length] = [area.start, area.length].map(u16::to_le_bytes);
        // the length of process data is what is mapped
        let length = if *kind < 3 { length } else { [0; 2] };
        [start[0], start[1], length[0], length[1], *control, 0, 1, *kind]
    };
    (0..count).flat_map(bytes).collect()
}

/// Categories 50 and 51: the PDOs that are assigned after power-on, with their entries.
fn process_data(dictionary: &ObjectDictionary, assignment: u16, area: Area) -> Vec<u8> {
    let mut bytes = Vec::new();
    for number in 1..=dictionary.unsigned((assignment, 0)) as u8 {
        let list = dictionary.unsigned((assignment, number)) as u16;
        let count = dictionary.unsigned((list, 0)) as u8;
        bytes.extend(list.to_le_bytes());
        bytes.extend([count, area.sync_manager as u8, 0, 0, 0, 0]);
        for sub in 1..=count {
            let entry = dictionary.unsigned((list, sub)) as u32;
            bytes.extend(((entry >> 16) as u16).to_le_bytes());
            bytes.extend([(entry >> 8) as u8, 0, 0, entry as u8, 0, 0]);
        }
    }
    bytes
}

/// Category 60, a mode of the distributed clock: AssignActivate, to be written to 0x0980 and 0x0981; cycles and shifts
/// are the main device's.
fn clock_mode(assign_activate: u16) -> Vec<u8> {
    let mut bytes = vec![0; 24];
    bytes[14..16].copy_from_slice(&assign_activate.to_le_bytes());
    bytes
}
