//! Basis of a commissioning, for which its record is valid: crane file, bus table, devices with firmware, program
//! version.

use crate::output;
use hydroboom_description::{Description, digest_of};
use hydroboom_fieldbus::check::DeviceFacts;
use hydroboom_fieldbus::table::Table;
use hydroboom_machine_interface::datagram::Peer;
use hydroboom_realtime::bus_task::BusTask;
use hydroboom_realtime::commissioning::record::{self, Basis, Device};
use miette::{IntoDiagnostic, Result, WrapErr, miette};
use std::path::Path;

/// Firmware of a device that does not state it.
const NOT_STATED: &str = "not stated";

/// Basis of a model without devices.
fn basis(model: &Description, is_simulated: bool) -> Basis {
    Basis {
        crane: model.digest(),
        bus_table: String::new(),
        devices: Vec::new(),
        version: env!("CARGO_PKG_VERSION").into(),
        is_simulated,
    }
}

/// Basis of a virtual crane; the digest of its crane file is the device's identity.
pub fn of_virtual(model: &Description, machine: &Description) -> Basis {
    let device = Device {
        name: machine.name.clone(),
        identity: format!("virtual crane, digest {}", machine.digest()),
        firmware: NOT_STATED.into(),
    };
    Basis { devices: vec![device], ..basis(model, true) }
}

/// Basis of a machine on the local interface, whose session has begun. Without a peer it is a real machine.
///
/// A machine on this interface states its kind and a firmware number only: two machines with the same ones do not
/// differ.
pub fn of_local(model: &Description, bus: &BusTask) -> Basis {
    let peer = bus.endpoint.machine().map_or(Peer::RealMachine, |(_, peer)| peer);
    let firmware = match bus.endpoint.firmware() {
        0 => NOT_STATED.into(),
        firmware => format!("{firmware:#018x}"),
    };
    let device = Device {
        name: "the machine".into(),
        identity: format!("{} on the local interface", peer.name()),
        firmware,
    };
    Basis { devices: vec![device], ..basis(model, peer == Peer::SimulatedMachine) }
}

/// Basis of the devices on a bus with its table. It is simulated if every device reports that it is.
pub fn of_bus(model: &Description, table: &Table, facts: &[DeviceFacts]) -> Basis {
    let devices = facts.iter().zip(&table.devices).map(|(device, row)| {
        let [vendor, product, revision] = device.identity;
        Device {
            name: row.name.clone(),
            identity: format!(
                "{}, vendor 0x{vendor:08X}, product 0x{product:08X}, revision 0x{revision:08X}, serial {}",
                device.name, device.serial
            ),
            firmware: device.software.clone().unwrap_or_else(|| NOT_STATED.into()),
        }
    });
    let is_simulated = !facts.is_empty() && facts.iter().all(DeviceFacts::is_simulated);
    Basis {
        bus_table: digest_of(&format!("{table:?}")),
        devices: devices.collect(),
        ..basis(model, is_simulated)
    }
}

/// Refuses to move a real machine that was not commissioned as it is now. A simulated one needs no record; one that is
/// named is checked all the same.
///
/// # Errors
///
/// If the record cannot be read or is of another basis, or a real machine has none.
pub fn demand(record: Option<&Path>, now: &Basis) -> Result<()> {
    match record {
        Some(path) => record::check(path, now).into_diagnostic().wrap_err(
            "the machine is not moved: `hydroboom commission` makes a record of the machine as it is now",
        ),
        None if now.is_simulated => {
            output::note("simulated machine: no record of a commissioning is needed");
            Ok(())
        }
        None => Err(miette!(
            help = "commission the machine (docs/how-to/commission-a-machine.md), then name its record with \
                    --commissioning FILE; run --listen logs without enabling",
            "this machine is real, or does not say that it is simulated, and no record of its commissioning is named"
        )),
    }
}
