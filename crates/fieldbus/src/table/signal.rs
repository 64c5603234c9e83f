//! Rows of measured and commanded signals: location in the process data, scale, range and validity, checked.

use super::device::locate;
use super::problem::{Part, Problems};
use super::{
    BitCondition, COMMANDED, CommandedRow, DeviceRow, Invalid, MEASURED, MeasuredRow, NumberType,
    Pdo, Place, Scale, schema,
};
use hydroboom_control::measurement::AXES;

/// Common keys of measured and commanded signals.
struct Signal<'a> {
    /// Name of the list that the row is in.
    list: &'static str,
    /// Number of the row in its list, from 0.
    row: usize,
    /// Axis, from 0.
    axis: usize,
    /// Name of the device.
    device: &'a str,
    /// Index and subindex of the entry.
    entry: (u16, u8),
    /// Type of the counts.
    kind: NumberType,
    /// SI units per count.
    factor: f64,
    /// SI value at zero counts.
    offset: f64,
    /// Direction, 1 or -1.
    sign: i8,
    /// Lowest and highest SI value.
    range: [f64; 2],
    /// Source of the factor.
    provenance: &'a str,
}

/// Rows of measured signals.
pub(super) fn measured(
    file: &schema::File,
    devices: &[DeviceRow],
    problems: &mut Problems<'_>,
) -> Vec<MeasuredRow> {
    let mut rows: Vec<MeasuredRow> = Vec::new();
    for (position, row) in file.measured.iter().enumerate() {
        let key = |name: &'static str| [Part::from("measured"), position.into(), name.into()];
        let Some(number) = MEASURED.iter().position(|name| *name == row.signal) else {
            problems.refuse(&key("signal"), &row.signal, &MEASURED.join(", "));
            continue;
        };
        if rows.iter().any(|other| (other.axis, other.signal) == (row.axis, number)) {
            problems.add(&key("signal"), "the table has this signal already");
        }
        let signal = Signal {
            list: "measured",
            row: position,
            axis: row.axis,
            device: &row.device,
            entry: row.entry,
            kind: row.r#type,
            factor: row.factor,
            offset: row.offset,
            sign: row.sign,
            range: row.range,
            provenance: &row.provenance,
        };
        let resolved = resolve(&signal, devices, |device| &device.inputs, problems);
        let Some((place, scale)) = resolved else { continue };
        let mut invalid = Vec::new();
        for condition in &row.invalid {
            check_condition(&key("invalid"), condition.mask, condition.value, problems);
            let Some((bit, bits)) = locate(&devices[place.device].inputs, condition.entry) else {
                problems.add(&key("invalid"), "its entry is not among the inputs of the device");
                continue;
            };
            let place = Place { device: place.device, bit, bits };
            let meaning = match condition.means {
                schema::Meaning::WireBreak => Invalid::Absent,
                schema::Meaning::OutOfRange => Invalid::OutOfRange,
            };
            let bits = BitCondition { place, mask: condition.mask, value: condition.value };
            invalid.push((bits, meaning));
        }
        let provenance = row.provenance.clone();
        rows.push(MeasuredRow {
            axis: row.axis,
            signal: number,
            place,
            scale,
            invalid,
            provenance,
        });
    }
    // the signals of an axis that no controller can do without
    for (axis, signal) in (0..AXES).flat_map(|axis| MEASURED[..7].iter().map(move |s| (axis, s))) {
        let is_present = |row: &schema::Measured| row.axis == axis && row.signal == *signal;
        if !file.measured.iter().any(is_present) {
            problems.add(&["measured".into()], &format!("{signal} of axis {axis} is missing"));
        }
    }
    rows
}

/// Rows of commanded signals; each axis needs all of them.
pub(super) fn commanded(
    file: &schema::File,
    devices: &[DeviceRow],
    problems: &mut Problems<'_>,
) -> Vec<CommandedRow> {
    let mut rows: Vec<CommandedRow> = Vec::new();
    for (position, row) in file.commanded.iter().enumerate() {
        let key = |name: &'static str| [Part::from("commanded"), position.into(), name.into()];
        let Some(number) = COMMANDED.iter().position(|name| *name == row.signal) else {
            problems.refuse(&key("signal"), &row.signal, &COMMANDED.join(", "));
            continue;
        };
        if rows.iter().any(|other| (other.axis, other.signal) == (row.axis, number)) {
            problems.add(&key("signal"), "the table has this signal already");
        }
        let signal = Signal {
            list: "commanded",
            row: position,
            axis: row.axis,
            device: &row.device,
            entry: row.entry,
            kind: row.r#type,
            factor: row.factor,
            offset: row.offset,
            sign: row.sign,
            range: row.range,
            provenance: &row.provenance,
        };
        let resolved = resolve(&signal, devices, |device| &device.outputs, problems);
        let Some((place, scale)) = resolved else { continue };
        let provenance = row.provenance.clone();
        rows.push(CommandedRow { axis: row.axis, signal: number, place, scale, provenance });
    }
    for (axis, signal) in (0..AXES).flat_map(|axis| COMMANDED.iter().map(move |s| (axis, s))) {
        let is_present = |row: &schema::Commanded| row.axis == axis && row.signal == *signal;
        if !file.commanded.iter().any(is_present) {
            problems.add(&["commanded".into()], &format!("{signal} of axis {axis} is missing"));
        }
    }
    rows
}

/// Place and scale of a signal in the PDOs of one direction; none where device or entry do not exist. Scale and range
/// are checked in any case.
fn resolve(
    signal: &Signal<'_>,
    devices: &[DeviceRow],
    pdos: impl Fn(&DeviceRow) -> &[Pdo],
    problems: &mut Problems<'_>,
) -> Option<(Place, Scale)> {
    let key = |name: &'static str| [Part::from(signal.list), signal.row.into(), name.into()];
    if signal.axis >= AXES {
        problems.refuse(&key("axis"), signal.axis, &format!("0 to {}", AXES - 1));
        return None;
    }
    check_scale(signal, problems);
    if signal.provenance.trim().is_empty() {
        problems.add(
            &key("provenance"),
            "say where the factor is from: a data sheet, an object, a calibration",
        );
    }
    let Some(device) = devices.iter().position(|device| device.name == signal.device) else {
        let names: Vec<&str> = devices.iter().map(|device| device.name.as_str()).collect();
        problems.refuse(&key("device"), signal.device, &names.join(", "));
        return None;
    };
    let Some((bit, bits)) = locate(pdos(&devices[device]), signal.entry) else {
        let (index, sub) = signal.entry;
        let read = format!("0x{index:04X}:{sub:02X}");
        problems.refuse(&key("entry"), read, &format!("an entry of the PDOs of {}", signal.device));
        return None;
    };
    if bits != signal.kind.bits() {
        let read = format!("a type of {} bit", signal.kind.bits());
        problems.refuse(&key("type"), read, &format!("one of {bits} bit, as the entry has"));
    }
    let scale = Scale {
        kind: signal.kind,
        factor: f64::from(signal.sign) * signal.factor,
        offset: signal.offset,
        range: signal.range,
    };
    Some((Place { device, bit, bits }, scale))
}

/// Refuses a factor, an offset, a sign or a range that is none.
fn check_scale(signal: &Signal<'_>, problems: &mut Problems<'_>) {
    let key = |name: &'static str| [Part::from(signal.list), signal.row.into(), name.into()];
    if !matches!(signal.sign, 1 | -1) {
        problems.refuse(&key("sign"), signal.sign, "1 or -1");
    }
    if !(signal.factor.is_finite() && signal.factor > 0.0) {
        problems.refuse(
            &key("factor"),
            signal.factor,
            "a positive number; the direction is `sign`",
        );
    }
    if !signal.offset.is_finite() {
        problems.refuse(&key("offset"), signal.offset, "a number");
    }
    let [low, high] = signal.range;
    if !(low.is_finite() && high.is_finite() && low < high) {
        problems.refuse(
            &key("range"),
            format!("{low} to {high}"),
            "the lowest and the highest value",
        );
    }
    // the safe command is limited to it, too
    if signal.list == "commanded" && !(low..=high).contains(&0.0) {
        problems.refuse(
            &key("range"),
            format!("{low} to {high}"),
            "a range with 0, the safe command",
        );
    }
}

/// Refuses a condition that never or always holds: a value with bits outside the mask, or an empty mask.
pub(super) fn check_condition<const N: usize>(
    key: &[Part; N],
    mask: u64,
    value: u64,
    problems: &mut Problems<'_>,
) {
    if mask == 0 || value & !mask != 0 {
        let read = format!("value 0x{value:X} under mask 0x{mask:X}");
        problems.refuse(key, read, "a mask with bits, and a value of bits of the mask");
    }
}
