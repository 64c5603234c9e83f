//! Reads a table from the text of a file, and checks it.

use super::problem::{Part, Problems};
use super::{
    Bits, BusSettings, COMMANDED, CommandedRow, DeviceRow, DriveRow, Entry, Invalid, MEASURED,
    MeasuredRow, NumberType, Pdo, Place, Scale, StartUp, Sync, Table, TableError,
};
use crate::cia402::CYCLIC_VELOCITY;
use crate::start_up::{LARGEST_IMAGE, MOST_DEVICES};
use hydroboom_control::measurement::AXES;
use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    bus: Bus,
    device: Vec<Device>,
    measured: Vec<Measured>,
    commanded: Vec<Commanded>,
}

/// The part of a crane file that is read here.
#[derive(Deserialize)]
struct CraneFile {
    machine: Option<Machine>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Machine {
    ethercat: Option<File>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Bus {
    period_us: u32,
    exchanges: u32,
    exchange_us: u32,
    #[serde(default)]
    send_us: u32,
    lost_frames_max: u32,
    window_cycles: u32,
    brake_ms: u32,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum SyncName {
    None,
    Sync0,
    Sync01,
}

#[derive(Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum MappingName {
    #[default]
    Checked,
    Written,
}

#[derive(Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Profile {
    Cia402,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Device {
    name: String,
    vendor: u32,
    product: u32,
    revision: [u32; 2],
    watchdog_ms: Option<u32>,
    sync: SyncName,
    sync1_us: Option<u32>,
    profile: Option<Profile>,
    stop_circuit: Option<Condition>,
    #[serde(default)]
    mapping: MappingName,
    #[serde(default)]
    sdo: Vec<Sdo>,
    #[serde(default)]
    outputs: Vec<List>,
    #[serde(default)]
    inputs: Vec<List>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Sdo {
    index: u16,
    sub: u8,
    r#type: NumberType,
    value: i64,
    reason: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct List {
    list: u16,
    entries: Vec<(u16, u8, u8)>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Condition {
    entry: (u16, u8),
    mask: u64,
    value: u64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct InvalidBits {
    entry: (u16, u8),
    mask: u64,
    value: u64,
    means: Meaning,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Meaning {
    WireBreak,
    OutOfRange,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Measured {
    axis: usize,
    signal: String,
    device: String,
    entry: (u16, u8),
    r#type: NumberType,
    factor: f64,
    #[serde(default)]
    offset: f64,
    #[serde(default = "plus")]
    sign: i8,
    range: [f64; 2],
    #[serde(default)]
    invalid: Vec<InvalidBits>,
    provenance: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Commanded {
    axis: usize,
    signal: String,
    device: String,
    entry: (u16, u8),
    r#type: NumberType,
    factor: f64,
    #[serde(default)]
    offset: f64,
    #[serde(default = "plus")]
    sign: i8,
    range: [f64; 2],
    provenance: String,
}

fn plus() -> i8 {
    1
}

/// Common keys of measured and commanded signals.
struct Signal<'a> {
    list: &'static str,
    row: usize,
    axis: usize,
    device: &'a str,
    entry: (u16, u8),
    kind: NumberType,
    factor: f64,
    offset: f64,
    sign: i8,
    range: [f64; 2],
    provenance: &'a str,
}

impl Table {
    /// Reads a table from the text of a file.
    ///
    /// # Errors
    ///
    /// [`TableError`] with file, line and key of each problem, what was read and what is allowed.
    pub fn parse(file: &str, text: &str) -> Result<Self, TableError> {
        let problems = Problems::new(file, text, &[]);
        let read: File = toml::from_str(text).map_err(|error| problems.syntax(&error))?;
        Self::checked(&read, problems)
    }

    /// Reads the table `[machine.ethercat]` from the text of a crane file; none where it has none.
    ///
    /// # Errors
    ///
    /// As of [`parse`](Self::parse).
    pub fn parse_in_crane_file(file: &str, text: &str) -> Result<Option<Self>, TableError> {
        let problems = Problems::new(file, text, &["machine", "ethercat"]);
        let read: CraneFile = toml::from_str(text).map_err(|error| problems.syntax(&error))?;
        let table = read.machine.and_then(|machine| machine.ethercat);
        table.map(|read| Self::checked(&read, problems)).transpose()
    }

    /// The table that was read, if it has no problem.
    fn checked(read: &File, problems: Problems<'_>) -> Result<Self, TableError> {
        let mut problems = problems;
        let bus = bus(&read.bus, &mut problems);
        let devices: Vec<DeviceRow> = read
            .device
            .iter()
            .enumerate()
            .map(|(at, row)| device(at, row, read, &bus, &mut problems))
            .collect();
        sizes(&devices, &mut problems);
        let measured = measured(read, &devices, &mut problems);
        let commanded = commanded(read, &devices, &mut problems);
        let drives = drives(read, &devices, &commanded, &mut problems);
        problems.into_result(Self { bus, devices, measured, commanded, drives })
    }
}

fn bus(bus: &Bus, problems: &mut Problems<'_>) -> BusSettings {
    let mut check = |name: &'static str, value: u32, low: u32, high: u32| {
        if !(low..=high).contains(&value) {
            problems.refuse(&["bus".into(), name.into()], value, &format!("{low} to {high}"));
        }
    };
    check("period_us", bus.period_us, 250, 10_000);
    check("exchanges", bus.exchanges, 1, 2);
    let period = bus.period_us.max(2);
    check("exchange_us", bus.exchange_us, 1, period - 1);
    if bus.exchanges == 2 {
        let first = bus.exchange_us.saturating_add(1).min(period - 1);
        check("send_us", bus.send_us, first, period - 1);
    }
    check("window_cycles", bus.window_cycles, 1, 100_000);
    check("lost_frames_max", bus.lost_frames_max, 0, bus.window_cycles.max(1) - 1);
    check("brake_ms", bus.brake_ms, 0, 10_000);
    BusSettings {
        period: 1000 * u64::from(bus.period_us),
        exchanges: bus.exchanges,
        exchange: 1000 * u64::from(bus.exchange_us),
        send: 1000 * u64::from(bus.send_us),
        lost_max: bus.lost_frames_max,
        window: bus.window_cycles,
        brake: 1_000_000 * u64::from(bus.brake_ms),
    }
}

fn device(
    at: usize,
    row: &Device,
    read: &File,
    bus: &BusSettings,
    problems: &mut Problems<'_>,
) -> DeviceRow {
    let key = |name: &'static str| [Part::from("device"), at.into(), name.into()];
    if read.device.iter().take(at).any(|other| other.name == row.name) {
        problems.refuse(&key("name"), &row.name, "a name that no device before has");
    }
    if row.revision[0] > row.revision[1] {
        let read = format!("{} to {}", row.revision[0], row.revision[1]);
        problems.refuse(&key("revision"), read, "the lowest and the highest revision");
    }
    if let Some(time) = row.watchdog_ms {
        let shortest = (2 * bus.period).div_ceil(1_000_000).max(1);
        if !(shortest..=6500).contains(&u64::from(time)) {
            let allowed = format!("two periods to 6500 ms: {shortest} to 6500");
            problems.refuse(&key("watchdog_ms"), time, &allowed);
        }
    }
    let sync = match (row.sync, row.sync1_us) {
        (SyncName::None, _) => Sync::None,
        (SyncName::Sync0, _) => Sync::Sync0,
        (SyncName::Sync01, time) => {
            if time.is_none() {
                problems.add(&key("sync"), "sync01 needs the key sync1_us, the cycle of SYNC1");
            }
            Sync::Sync01(1000 * u64::from(time.unwrap_or(0)))
        }
    };
    let mut start_up = Vec::new();
    for (number, sdo) in row.sdo.iter().enumerate() {
        let place = |name: &'static str| {
            [Part::from("device"), at.into(), "sdo".into(), number.into(), name.into()]
        };
        let [low, high] = sdo.r#type.range();
        if !(low..=high).contains(&sdo.value) {
            problems.refuse(&place("value"), sdo.value, &format!("{low} to {high} by its type"));
        }
        if sdo.reason.trim().is_empty() {
            problems.add(&place("reason"), "say why the value is written");
        }
        start_up.push(StartUp {
            index: sdo.index,
            sub: sdo.sub,
            kind: sdo.r#type,
            value: sdo.value,
            reason: sdo.reason.clone(),
        });
    }
    let lists = |lists: &[List]| {
        let entry =
            |(index, sub, bits): &(u16, u8, u8)| Entry { index: *index, sub: *sub, bits: *bits };
        lists
            .iter()
            .map(|pdo| Pdo { list: pdo.list, entries: pdo.entries.iter().map(entry).collect() })
            .collect()
    };
    DeviceRow {
        name: row.name.clone(),
        vendor: row.vendor,
        product: row.product,
        revision: row.revision,
        watchdog: row.watchdog_ms.map(|time| 1_000_000 * u64::from(time)),
        sync,
        is_mapping_written: row.mapping == MappingName::Written,
        start_up,
        outputs: lists(&row.outputs),
        inputs: lists(&row.inputs),
    }
}

fn sizes(devices: &[DeviceRow], problems: &mut Problems<'_>) {
    if devices.is_empty() || devices.len() > MOST_DEVICES {
        problems.refuse(&["device".into()], devices.len(), &format!("1 to {MOST_DEVICES} devices"));
    }
    let bytes: usize = devices.iter().map(|d| d.output_bytes() + d.input_bytes()).sum();
    if bytes > LARGEST_IMAGE {
        let read = format!("{bytes} bytes of process data");
        problems.refuse(&["device".into()], read, &format!("{LARGEST_IMAGE} bytes"));
    }
}

/// The bit at which an entry begins, and its length.
fn find(lists: &[Pdo], (index, sub): (u16, u8)) -> Option<(usize, u8)> {
    let mut bit = 0;
    for entry in lists.iter().flat_map(|list| &list.entries) {
        if index != 0 && (entry.index, entry.sub) == (index, sub) {
            return Some((bit, entry.bits));
        }
        bit += usize::from(entry.bits);
    }
    None
}

/// Place and scale of a signal; none where there is a problem.
fn resolve(
    signal: &Signal<'_>,
    devices: &[DeviceRow],
    side: impl Fn(&DeviceRow) -> &[Pdo],
    problems: &mut Problems<'_>,
) -> Option<(Place, Scale)> {
    let key = |name: &'static str| [Part::from(signal.list), signal.row.into(), name.into()];
    if signal.axis >= AXES {
        problems.refuse(&key("axis"), signal.axis, &format!("0 to {}", AXES - 1));
        return None;
    }
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
    let Some((bit, bits)) = find(side(&devices[device]), signal.entry) else {
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

fn measured(read: &File, devices: &[DeviceRow], problems: &mut Problems<'_>) -> Vec<MeasuredRow> {
    let mut rows: Vec<MeasuredRow> = Vec::new();
    for (at, row) in read.measured.iter().enumerate() {
        let key = |name: &'static str| [Part::from("measured"), at.into(), name.into()];
        let Some(number) = MEASURED.iter().position(|name| *name == row.signal) else {
            problems.refuse(&key("signal"), &row.signal, &MEASURED.join(", "));
            continue;
        };
        if rows.iter().any(|other| (other.axis, other.signal) == (row.axis, number)) {
            problems.add(&key("signal"), "the table has this signal already");
        }
        let signal = Signal {
            list: "measured",
            row: at,
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
        for bits in &row.invalid {
            check_bits(&key("invalid"), bits.mask, bits.value, problems);
            let Some((bit, length)) = find(&devices[place.device].inputs, bits.entry) else {
                problems.add(&key("invalid"), "its entry is not among the inputs of the device");
                continue;
            };
            let place = Place { device: place.device, bit, bits: length };
            let meaning = match bits.means {
                Meaning::WireBreak => Invalid::Absent,
                Meaning::OutOfRange => Invalid::OutOfRange,
            };
            invalid.push((Bits { place, mask: bits.mask, value: bits.value }, meaning));
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
        let is_there = |row: &Measured| row.axis == axis && row.signal == *signal;
        if !read.measured.iter().any(is_there) {
            problems.add(&["measured".into()], &format!("{signal} of axis {axis} is missing"));
        }
    }
    rows
}

fn commanded(read: &File, devices: &[DeviceRow], problems: &mut Problems<'_>) -> Vec<CommandedRow> {
    let mut rows: Vec<CommandedRow> = Vec::new();
    for (at, row) in read.commanded.iter().enumerate() {
        let key = |name: &'static str| [Part::from("commanded"), at.into(), name.into()];
        let Some(number) = COMMANDED.iter().position(|name| *name == row.signal) else {
            problems.refuse(&key("signal"), &row.signal, &COMMANDED.join(", "));
            continue;
        };
        if rows.iter().any(|other| (other.axis, other.signal) == (row.axis, number)) {
            problems.add(&key("signal"), "the table has this signal already");
        }
        let signal = Signal {
            list: "commanded",
            row: at,
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
        let is_there = |row: &Commanded| row.axis == axis && row.signal == *signal;
        if !read.commanded.iter().any(is_there) {
            problems.add(&["commanded".into()], &format!("{signal} of axis {axis} is missing"));
        }
    }
    rows
}

/// Refuses a condition that never or always holds: a value with bits outside the mask, or an empty mask.
fn check_bits<const N: usize>(key: &[Part; N], mask: u64, value: u64, problems: &mut Problems<'_>) {
    if mask == 0 || value & !mask != 0 {
        let read = format!("value 0x{value:X} under mask 0x{mask:X}");
        problems.refuse(key, read, "a mask with bits, and a value of bits of the mask");
    }
}

fn drives(
    read: &File,
    devices: &[DeviceRow],
    commanded: &[CommandedRow],
    problems: &mut Problems<'_>,
) -> Vec<DriveRow> {
    let mut rows: Vec<DriveRow> = Vec::new();
    for (device, row) in read.device.iter().enumerate() {
        if row.profile != Some(Profile::Cia402) {
            continue;
        }
        let key = |name: &'static str| [Part::from("device"), device.into(), name.into()];
        let lists = &devices[device];
        let place = |side: &[Pdo], index: u16, sub: u8| {
            find(side, (index, sub)).map(|(bit, bits)| Place { device, bit, bits })
        };
        let output = |index| place(&lists.outputs, index, 0);
        let input = |index| place(&lists.inputs, index, 0);
        let words = (output(0x6040), output(0x60ff), input(0x6041), input(0x6061));
        let (Some(controlword), Some(target), Some(statusword), Some(mode_display)) = words else {
            let message = "a drive by CiA 402 needs 0x6040 and 0x60FF among its outputs, 0x6041 and \
            0x6061 among its inputs";
            problems.add(&key("profile"), message);
            continue;
        };
        let mode = output(0x6060);
        let sets_mode = |sdo: &Sdo| sdo.index == 0x6060 && sdo.value == i64::from(CYCLIC_VELOCITY);
        if mode.is_none() && !row.sdo.iter().any(sets_mode) {
            let message = "mode 9 has to be set by 0x6060, among the outputs or as a start-up SDO";
            problems.add(&key("profile"), message);
        }
        let is_its = |row: &&CommandedRow| row.signal == 0 && row.place == target;
        let Some(axis) = commanded.iter().find(is_its).map(|row| row.axis) else {
            problems.add(
                &key("profile"),
                "no row of [[commanded]] has motor_speed_rev_per_s at its 0x60FF",
            );
            continue;
        };
        let stop_circuit = row.stop_circuit.as_ref().and_then(|bits| {
            check_bits(&key("stop_circuit"), bits.mask, bits.value, problems);
            let found = place(&lists.inputs, bits.entry.0, bits.entry.1);
            if found.is_none() {
                problems
                    .add(&key("stop_circuit"), "its entry is not among the inputs of the device");
            }
            found.map(|place| Bits { place, mask: bits.mask, value: bits.value })
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
