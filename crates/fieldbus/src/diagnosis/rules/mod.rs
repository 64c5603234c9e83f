//! Rules: from facts to findings, errors first, in the order of stages: causes before their effects.

mod cable;
mod devices;
mod host;
mod state;
mod synchronisation;
mod timing;
mod watchdog;

use super::facts::BusFacts;
use super::finding::{Finding, Severity, Stage};
use super::host::HostFacts;
use crate::check::{Subject, mismatches};
use crate::start_up::identities_fit;
use crate::table::Table;

/// All findings: errors before warnings, and within a severity causes before effects; empty where nothing is wrong. A
/// cause of delay in this computer is an error where frames are late, else a warning.
pub fn findings(table: &Table, bus: &BusFacts, host: &HostFacts) -> Vec<Finding> {
    let mut found = cable::findings(table, bus);
    found.extend(devices::findings(table, bus));
    found.extend(start_up(table, bus));
    // devices that could not be read completely are not compared
    if bus.set_up.len() == table.devices.len() && bus.failed.is_empty() {
        found.extend(mismatches(table, &bus.devices).into_iter().map(|found| {
            let stage = match found.subject {
                Subject::Devices => Stage::Devices,
                Subject::ProcessData => Stage::ProcessData,
                Subject::Synchronisation => Stage::Synchronisation,
                Subject::Drive => Stage::Drive,
            };
            Finding::error(stage, found.cause, found.advice)
        }));
        found.extend(sizes(table, bus));
        found.extend(watchdog::findings(table, bus));
        found.extend(synchronisation::findings(table, bus));
    }
    found.extend(state::findings(table, bus));
    let timing = timing::findings(table, bus, &found);
    // a cause of delay in this computer is an error where frames are late
    let is_late = timing::is_delayed(bus, &found);
    let host_findings = host::findings(host).into_iter();
    found.extend(host_findings.map(|finding| match is_late {
        true => Finding { severity: Severity::Error, ..finding },
        false => finding,
    }));
    found.extend(timing);
    // stable: what was found first of a stage stays before what was found later
    found.sort_by_key(|finding| (finding.severity, finding.stage));
    found
}

/// Whether number, vendors, products and revisions are those of the table.
fn identities_match(table: &Table, bus: &BusFacts) -> bool {
    bus.devices.len() == table.devices.len() && identities_fit(table, &bus.devices)
}

/// A device in messages: the table's name where it is the table's device.
fn name(table: &Table, bus: &BusFacts, position: usize) -> String {
    let matches_table = identities_match(table, bus);
    let row = table.devices.get(position).filter(|_| matches_table);
    let name = match (row, bus.devices.get(position)) {
        (Some(row), _) => &row.name,
        (None, Some(device)) => &device.name,
        (None, None) => return format!("position {position}"),
    };
    format!("{name} (position {position})")
}

/// Objects and registers that could not be written or read at start-up.
fn start_up(table: &Table, bus: &BusFacts) -> Vec<Finding> {
    let failed = bus.failed.iter().map(|(position, what, why)| {
        Finding::error(
            Stage::StartUp,
            format!("{what} of {} failed: {why}", name(table, bus, *position)),
            "compare it with the manual of the device, and correct the table",
        )
    });
    failed.collect()
}

/// Sizes of process data by the sync managers, against the table.
fn sizes(table: &Table, bus: &BusFacts) -> Vec<Finding> {
    let mut found = Vec::new();
    for (position, (row, set_up)) in table.devices.iter().zip(&bus.set_up).enumerate() {
        let Some(sizes) = set_up.sizes else { continue };
        let expected = [row.output_bytes(), row.input_bytes()];
        for ((side, is), expected) in ["outputs", "inputs"].into_iter().zip(sizes).zip(expected) {
            if is != expected {
                found.push(Finding::error(
                    Stage::ProcessData,
                    format!(
                        "{side} of {} have {is} bytes by its sync manager, {expected} by the table",
                        name(table, bus, position)
                    ),
                    "correct the PDOs of the table by the device's manual",
                ));
            }
        }
    }
    found
}
