//! Number, order and identity of the devices: which are missing, which are not in the table.

use super::name;
use crate::check::{DeviceFacts, Subject, mismatches};
use crate::diagnosis::facts::{BusFacts, PORTS};
use crate::diagnosis::finding::{Finding, Stage};
use crate::diagnosis::scan::MOST_POSITIONS;
use crate::start_up::MOST_DEVICES;
use crate::table::{DeviceRow, Table};

/// Findings of number, order and identity.
pub(super) fn findings(table: &Table, bus: &BusFacts) -> Vec<Finding> {
    let mut found: Vec<Finding> = too_many(table, bus).into_iter().collect();
    found.extend(compare(table, bus));
    found
}

/// More devices than a bus of this program may have: none of them is set up, and only the scan is judged.
fn too_many(table: &Table, bus: &BusFacts) -> Option<Finding> {
    let answering = bus.line.len();
    // the scan ends at its last position, whether or not devices follow
    let or_more = if answering == usize::from(MOST_POSITIONS) { " or more" } else { "" };
    (answering > MOST_DEVICES).then(|| {
        Finding::error(
            Stage::Devices,
            format!(
                "{answering}{or_more} devices answer, the table has {} and this program allows {MOST_DEVICES} on \
                a bus, so that none was set up",
                table.devices.len()
            ),
            "remove the devices that are not in the table, or connect them to a network interface of their own",
        )
    })
}

/// The devices against the rows of the table.
fn compare(table: &Table, bus: &BusFacts) -> Vec<Finding> {
    let (rows, devices) = (&table.devices, &bus.devices);
    if devices.is_empty() {
        return Vec::new();
    }
    let error = |cause: String, advice: &str| vec![Finding::error(Stage::Devices, cause, advice)];
    let counts = format!("{} devices answer, the table has {}", devices.len(), rows.len());
    let (missing, extra) = unmatched(rows, devices);
    match (missing.as_slice(), extra.as_slice()) {
        ([], []) => identity_mismatches(table, bus),
        ([first, ..], []) if *first == devices.len() => {
            let row = &rows[*first];
            let others = match missing.len() {
                1 => "is missing",
                _ => "and all behind it are missing",
            };
            error(
                format!(
                    "{} (position {first}) {others}: {counts}, and {}",
                    row.name,
                    link_behind(table, bus, first - 1)
                ),
                "check the cable in front of it and its supply",
            )
        }
        (_, []) => error(
            format!(
                "{} missing: {counts}",
                with_verb(missing.iter().map(|k| row_text(&rows[*k], *k)))
            ),
            "connect it, or delete it from the table",
        ),
        ([], _) => error(
            format!(
                "{} not in the table: {counts}",
                with_verb(extra.iter().map(|k| device_text(&devices[*k], *k)))
            ),
            "remove it from the bus, or add it to the table",
        ),
        _ if devices.len() == rows.len() && have_the_same_products(rows, devices) => {
            let places = devices.iter().enumerate().filter(|(k, device)| !fits(&rows[*k], device));
            let places =
                places.map(|(k, device)| format!("position {k} is {}", table_name(rows, device)));
            error(
                format!(
                    "the devices are in a different order than in the table: {}",
                    places.collect::<Vec<_>>().join(", ")
                ),
                "connect them in the table's order, or change the order in the table",
            )
        }
        _ if devices.len() == rows.len() => identity_mismatches(table, bus),
        _ => error(
            format!(
                "{counts}: {} missing, {} not in the table",
                with_verb(missing.iter().map(|k| row_text(&rows[*k], *k))),
                with_verb(extra.iter().map(|k| device_text(&devices[*k], *k)))
            ),
            "compare the devices with the table, position by position",
        ),
    }
}

/// The first identity that differs.
fn identity_mismatches(table: &Table, bus: &BusFacts) -> Vec<Finding> {
    mismatches(table, &bus.devices)
        .into_iter()
        .filter(|found| found.subject == Subject::Devices)
        .map(|found| Finding::error(Stage::Devices, found.cause, found.advice))
        .collect()
}

/// Whether vendor and product of a device are those of a row, whatever its revision.
fn fits(row: &DeviceRow, device: &DeviceFacts) -> bool {
    device.identity[..2] == [row.vendor, row.product]
}

/// Whether both are the same devices, in some order.
fn have_the_same_products(rows: &[DeviceRow], devices: &[DeviceFacts]) -> bool {
    let mut expected: Vec<[u32; 2]> = rows.iter().map(|row| [row.vendor, row.product]).collect();
    let mut found: Vec<&[u32]> = devices.iter().map(|device| &device.identity[..2]).collect();
    expected.sort_unstable();
    found.sort_unstable();
    expected.iter().map(|kind| &kind[..]).eq(found)
}

/// Rows without a device and devices without a row, by a longest common subsequence of vendor and product.
fn unmatched(rows: &[DeviceRow], devices: &[DeviceFacts]) -> (Vec<usize>, Vec<usize>) {
    let (n, m) = (rows.len(), devices.len());
    // longest common subsequence of what follows
    let mut longest = vec![vec![0_usize; m + 1]; n + 1];
    for i in (0..n).rev() {
        for j in (0..m).rev() {
            longest[i][j] = match fits(&rows[i], &devices[j]) {
                true => 1 + longest[i + 1][j + 1],
                false => longest[i + 1][j].max(longest[i][j + 1]),
            };
        }
    }
    let (mut i, mut j, mut missing, mut extra) = (0, 0, Vec::new(), Vec::new());
    while i < n || j < m {
        if i < n && j < m && fits(&rows[i], &devices[j]) {
            (i, j) = (i + 1, j + 1);
        } else if j >= m || i < n && longest[i + 1][j] >= longest[i][j + 1] {
            missing.push(i);
            i += 1;
        } else {
            extra.push(j);
            j += 1;
        }
    }
    (missing, extra)
}

/// Link behind the last device that answers.
fn link_behind(table: &Table, bus: &BusFacts, last: usize) -> String {
    let this = name(table, bus, last);
    let has_link = |port: &usize| bus.line.get(last).is_some_and(|device| device.has_link(*port));
    match (1..PORTS).find(has_link) {
        Some(port) => format!("{this} has a link at port {port}, behind which no device answers"),
        None => format!("{this} has no link behind it"),
    }
}

/// Name of a row with its position.
fn row_text(row: &DeviceRow, position: usize) -> String {
    format!("{} (position {position})", row.name)
}

/// Name of a device with its position, vendor and product.
fn device_text(device: &DeviceFacts, position: usize) -> String {
    let [vendor, product, _] = device.identity;
    format!(
        "{} at position {position} (vendor 0x{vendor:08X}, product 0x{product:08X})",
        device.name
    )
}

/// The table's name of a device with this vendor and product.
fn table_name(rows: &[DeviceRow], device: &DeviceFacts) -> String {
    let row = rows.iter().find(|row| fits(row, device));
    row.map_or_else(|| device.name.clone(), |row| row.name.clone())
}

/// Names with their verb.
fn with_verb(names: impl ExactSizeIterator<Item = String>) -> String {
    let verb = if names.len() == 1 { "is" } else { "are" };
    format!("{} {verb}", names.collect::<Vec<_>>().join(", "))
}
