//! Applications of devices: a servo drive, an analogue input, a digital output, a coupler.

mod analogue_input;
mod coupler;
mod digital_output;
mod drive_state;
mod servo_drive;
mod velocity_unit;

pub use analogue_input::{AnalogueInput, CurrentSource};
pub use coupler::coupler;
pub use digital_output::DigitalOutput;
pub use drive_state::DriveState;
pub use servo_drive::{
    DriveSettings, INJECTED_FAULT, IdealMotor, Motor, SAFE_STOP_TIME, SAFE_TORQUE_OFF, ServoDrive,
};
pub use velocity_unit::VelocityUnit;

use crate::object_dictionary::{Mapping, ObjectAccess, ObjectDictionary};

/// Adds a list of process data: entries as index, subindex and bits, an index of 0 for a gap.
pub(crate) fn add_process_data(
    dictionary: &mut ObjectDictionary,
    [assignment, list]: [u16; 2],
    entries: &[(u16, u8, u8)],
    access: ObjectAccess,
) {
    let mut add = |key, value: &[u8]| dictionary.add(key, value, access, Mapping::None);
    add((assignment, 0), &[1]);
    add((assignment, 1), &list.to_le_bytes());
    add((list, 0), &[entries.len() as u8]);
    for (number, (index, sub, bits)) in (1..).zip(entries) {
        let entry = u32::from(*index) << 16 | u32::from(*sub) << 8 | u32::from(*bits);
        add((list, number), &entry.to_le_bytes());
    }
}

/// Adds the objects of every device with a mailbox: device type, error register, name, version, identity, and the types
/// of the sync managers (0x1C00), by which main devices find the process data.
pub fn add_identity(
    dictionary: &mut ObjectDictionary,
    settings: &crate::device::Settings,
    device_type: u32,
) {
    let identity = settings.identity;
    let mut add = |key, value: &[u8]| {
        dictionary.add(key, value, ObjectAccess::ReadOnly, Mapping::None);
    };
    add((0x1000, 0), &device_type.to_le_bytes());
    add((0x1001, 0), &[0]);
    add((0x1008, 0), settings.name.as_bytes());
    add((0x100a, 0), settings.software.as_bytes());
    add((0x1018, 0), &[4]);
    let numbers = [identity.vendor, identity.product, identity.revision, identity.serial];
    for (sub, number) in (1..).zip(numbers) {
        add((0x1018, sub), &number.to_le_bytes());
    }
    // what the sync managers are for: requests, answers, outputs, inputs
    add((0x1c00, 0), &[4]);
    for sub in 1..=4 {
        add((0x1c00, sub), &[sub]);
    }
}
