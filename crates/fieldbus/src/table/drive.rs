//! Rows of drives: the objects of CiA 402 in the process data of a device with that profile, checked.

use super::device::locate;
use super::problem::{Part, Problems};
use super::signal::check_condition;
use super::{BitCondition, CommandedRow, DeviceRow, DriveRow, Pdo, Place, schema};
use crate::cia402::CYCLIC_VELOCITY;

/// Rows of the devices with `profile = "cia402"`. Each needs controlword, target velocity, statusword and mode display
/// among its process data, mode 9, and a commanded motor speed.
pub(super) fn rows(
    file: &schema::File,
    devices: &[DeviceRow],
    commanded: &[CommandedRow],
    problems: &mut Problems<'_>,
) -> Vec<DriveRow> {
    let mut rows: Vec<DriveRow> = Vec::new();
    for (device, row) in file.device.iter().enumerate() {
        if row.profile != Some(schema::Profile::Cia402) {
            continue;
        }
        let key = |name: &'static str| [Part::from("device"), device.into(), name.into()];
        let pdos = &devices[device];
        let place = |pdos: &[Pdo], index: u16, sub: u8| {
            locate(pdos, (index, sub)).map(|(bit, bits)| Place { device, bit, bits })
        };
        let output = |index| place(&pdos.outputs, index, 0);
        let input = |index| place(&pdos.inputs, index, 0);
        let objects = (output(0x6040), output(0x60ff), input(0x6041), input(0x6061));
        let (Some(controlword), Some(target), Some(statusword), Some(mode_display)) = objects
        else {
            let message = "a drive by CiA 402 needs 0x6040 and 0x60FF among its outputs, 0x6041 and \
            0x6061 among its inputs";
            problems.add(&key("profile"), message);
            continue;
        };
        let mode = output(0x6060);
        let sets_mode =
            |sdo: &schema::Sdo| sdo.index == 0x6060 && sdo.value == i64::from(CYCLIC_VELOCITY);
        if mode.is_none() && !row.sdo.iter().any(sets_mode) {
            let message = "mode 9 has to be set by 0x6060, among the outputs or as a start-up SDO";
            problems.add(&key("profile"), message);
        }
        let is_target = |row: &&CommandedRow| row.signal == 0 && row.place == target;
        let Some(axis) = commanded.iter().find(is_target).map(|row| row.axis) else {
            problems.add(
                &key("profile"),
                "no row of [[commanded]] has motor_speed_rev_per_s at its 0x60FF",
            );
            continue;
        };
        let stop_circuit = row.stop_circuit.as_ref().and_then(|condition| {
            check_condition(&key("stop_circuit"), condition.mask, condition.value, problems);
            let place = place(&pdos.inputs, condition.entry.0, condition.entry.1);
            if place.is_none() {
                problems
                    .add(&key("stop_circuit"), "its entry is not among the inputs of the device");
            }
            place.map(|place| BitCondition { place, mask: condition.mask, value: condition.value })
        });
        rows.push(DriveRow {
            device,
            axis,
            controlword,
            target,
            mode,
            statusword,
            mode_display,
            error: input(0x603f),
            stop_circuit,
        });
    }
    // outside a CiA 402 drive a motor speed would be written whatever the state of the drive
    for (row, commanded) in commanded.iter().enumerate().filter(|(_, row)| row.signal == 0) {
        if !rows.iter().any(|drive| drive.target == commanded.place) {
            let key = [Part::from("commanded"), row.into(), "entry".into()];
            problems
                .add(&key, "a motor speed has to be 0x60FF of a device with profile = \"cia402\"");
        }
    }
    rows
}
