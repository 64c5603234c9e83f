//! Rows of devices: identity, watchdog, synchronisation, start-up SDOs and PDOs, checked.

use super::problem::{Part, Problems};
use super::{BusSettings, DeviceRow, Entry, Pdo, StartUp, Sync, schema};
use crate::start_up::{LARGEST_IMAGE, MOST_DEVICES};

/// Row of the device at a position.
pub(super) fn row(
    position: usize,
    device: &schema::Device,
    file: &schema::File,
    bus: &BusSettings,
    problems: &mut Problems<'_>,
) -> DeviceRow {
    let key = |name: &'static str| [Part::from("device"), position.into(), name.into()];
    if file.device.iter().take(position).any(|other| other.name == device.name) {
        problems.refuse(&key("name"), &device.name, "a name that no device before has");
    }
    if device.revision[0] > device.revision[1] {
        let read = format!("{} to {}", device.revision[0], device.revision[1]);
        problems.refuse(&key("revision"), read, "the lowest and the highest revision");
    }
    if let Some(time) = device.watchdog_ms {
        let shortest = (2 * bus.period).div_ceil(1_000_000).max(1);
        if !(shortest..=6500).contains(&u64::from(time)) {
            let allowed = format!("two periods to 6500 ms: {shortest} to 6500");
            problems.refuse(&key("watchdog_ms"), time, &allowed);
        }
    }
    let sync = match (device.sync, device.sync1_us) {
        (schema::Sync::None, _) => Sync::None,
        (schema::Sync::Sync0, _) => Sync::Sync0,
        (schema::Sync::Sync01, time) => {
            if time.is_none() {
                problems.add(&key("sync"), "sync01 needs the key sync1_us, the cycle of SYNC1");
            }
            Sync::Sync01(1000 * u64::from(time.unwrap_or(0)))
        }
    };
    DeviceRow {
        name: device.name.clone(),
        vendor: device.vendor,
        product: device.product,
        revision: device.revision,
        watchdog: device.watchdog_ms.map(|time| 1_000_000 * u64::from(time)),
        sync,
        is_mapping_written: device.mapping == schema::Mapping::Written,
        start_up: start_up_sdos(position, &device.sdo, problems),
        outputs: pdos(&device.outputs),
        inputs: pdos(&device.inputs),
    }
}

/// Start-up SDOs of the device at a position, each within the range of its type and with a reason.
fn start_up_sdos(
    position: usize,
    sdos: &[schema::Sdo],
    problems: &mut Problems<'_>,
) -> Vec<StartUp> {
    let mut start_up = Vec::new();
    for (number, sdo) in sdos.iter().enumerate() {
        let key = |name: &'static str| {
            [Part::from("device"), position.into(), "sdo".into(), number.into(), name.into()]
        };
        let [low, high] = sdo.r#type.range();
        if !(low..=high).contains(&sdo.value) {
            problems.refuse(&key("value"), sdo.value, &format!("{low} to {high} by its type"));
        }
        if sdo.reason.trim().is_empty() {
            problems.add(&key("reason"), "say why the value is written");
        }
        start_up.push(StartUp {
            index: sdo.index,
            sub: sdo.sub,
            kind: sdo.r#type,
            value: sdo.value,
            reason: sdo.reason.clone(),
        });
    }
    start_up
}

/// PDOs as the table lists them.
fn pdos(lists: &[schema::Pdo]) -> Vec<Pdo> {
    let entry =
        |(index, sub, bits): &(u16, u8, u8)| Entry { index: *index, sub: *sub, bits: *bits };
    lists
        .iter()
        .map(|pdo| Pdo { list: pdo.list, entries: pdo.entries.iter().map(entry).collect() })
        .collect()
}

/// Refuses more devices or process data than the main device has room for.
pub(super) fn check_sizes(devices: &[DeviceRow], problems: &mut Problems<'_>) {
    if devices.is_empty() || devices.len() > MOST_DEVICES {
        problems.refuse(&["device".into()], devices.len(), &format!("1 to {MOST_DEVICES} devices"));
    }
    let bytes: usize = devices.iter().map(|d| d.output_bytes() + d.input_bytes()).sum();
    if bytes > LARGEST_IMAGE {
        let read = format!("{bytes} bytes of process data");
        problems.refuse(&["device".into()], read, &format!("{LARGEST_IMAGE} bytes"));
    }
}

/// Offset and length \[bit\] of an entry, by index and subindex, in the process data of PDOs in their order. None
/// where it is not mapped; a gap has no index and is never found.
pub(super) fn locate(pdos: &[Pdo], (index, sub): (u16, u8)) -> Option<(usize, u8)> {
    let mut bit = 0;
    for entry in pdos.iter().flat_map(|pdo| &pdo.entries) {
        if index != 0 && (entry.index, entry.sub) == (index, sub) {
            return Some((bit, entry.bits));
        }
        bit += usize::from(entry.bits);
    }
    None
}
