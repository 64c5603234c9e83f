//! Devices as a table says, with a crane behind their signals.

use crate::plant::Plant;
use hydroboom_control::supervision::limits::ValveState;
use hydroboom_device_simulator::al_status_code::AlStatusCode;
use hydroboom_device_simulator::applications::{
    DriveSettings, Motor, ServoDrive, VelocityUnit, add_identity, coupler,
};
use hydroboom_device_simulator::controller::DistributedClock;
use hydroboom_device_simulator::device::{Identity, Settings, Synchronisation};
use hydroboom_device_simulator::object_dictionary::{Mapping, ObjectAccess, ObjectDictionary};
use hydroboom_device_simulator::{Application, Device, Segment};
use hydroboom_fieldbus::table::{CommandedRow, DeviceRow, MeasuredRow, Pdo, Place, Sync, Table};
use std::cell::RefCell;
use std::rc::Rc;

/// Deceleration of a drive that stops by itself \[rev/s²\]: from full speed in half a second.
const DECELERATION: f64 = 100.0;
/// Increments of a revolution of the motor. Typical.
const INCREMENTS: u32 = 65_536;
/// Device type (0x1000) of a modular device: profile 5001.
const MODULAR_DEVICE: u32 = 5001;
/// Drift of each device's clock beside the one before \[ppb\], and where it begins \[ns\]: oscillators of 50 ppm.
const DRIFT: [i64; 4] = [0, 50_000, -30_000, 10_000];
const CLOCK_START: u64 = 77_000_000;

/// The devices of a table on a line, which bear so many missed cycles (as object 0x10F1:02 of many drives).
///
/// # Errors
///
/// Which device cannot be simulated, and why.
pub fn segment(
    table: &Table,
    plant: &Rc<RefCell<Plant>>,
    missed_limit: u32,
) -> Result<Segment, String> {
    let device = |position| device(table, position, plant, missed_limit);
    let devices = (0..table.devices.len()).map(device);
    Ok(Segment::new(devices.collect::<Result<_, _>>()?))
}

fn device(
    table: &Table,
    position: usize,
    plant: &Rc<RefCell<Plant>>,
    missed_limit: u32,
) -> Result<Device, String> {
    let row = &table.devices[position];
    let has_clock = row.sync != Sync::None;
    let synchronisation = Synchronisation {
        has_sync0: has_clock,
        has_sync1: has_clock,
        missed_limit,
        ..Default::default()
    };
    let identity = Identity {
        vendor: row.vendor,
        product: row.product,
        revision: row.revision[0],
        serial: position as u32 + 1,
    };
    let settings = Settings { synchronisation, ..Settings::new(&row.name, identity) };
    let clock = DistributedClock::new(CLOCK_START * position as u64, DRIFT[position % DRIFT.len()]);
    if row.output_bytes() + row.input_bytes() == 0 {
        return Ok(coupler(settings, clock));
    }
    let settings = settings.with_mailbox();
    if table.drives.iter().any(|drive| drive.device == position) {
        let unit = table
            .commanded
            .iter()
            .find(|commanded| commanded.place.device == position)
            .and_then(|commanded| velocity_unit(commanded.scale.factor))
            .ok_or_else(|| {
                format!("{}: its unit of velocity is none of those that are simulated", row.name)
            })?;
        let about = DriveSettings {
            unit,
            increments: INCREMENTS,
            deceleration: DECELERATION,
            is_mapping_fixed: false,
        };
        let sign = table
            .commanded
            .iter()
            .find(|c| c.place.device == position)
            .map_or(1.0, |c| c.scale.factor.signum());
        let motor = Shaft { plant: Rc::clone(plant), sign };
        let mut drive = ServoDrive::device(settings, about, clock, Box::new(motor));
        describe(&mut drive.dictionary, row);
        return Ok(drive);
    }
    let is_here = |place: &Place| place.device == position;
    let outputs = settings.outputs.filter(|_| row.output_bytes() > 0);
    let inputs = settings.inputs.filter(|_| row.input_bytes() > 0);
    let settings = Settings { outputs, inputs, ..settings };
    let application = Terminal {
        plant: Rc::clone(plant),
        inputs: row.inputs.clone(),
        outputs: row.outputs.clone(),
        measured: table.measured.iter().filter(|row| is_here(&row.place)).cloned().collect(),
        commanded: table.commanded.iter().filter(|row| is_here(&row.place)).cloned().collect(),
    };
    let mut dictionary = ObjectDictionary::default();
    add_identity(&mut dictionary, &settings, MODULAR_DEVICE);
    describe(&mut dictionary, row);
    Ok(Device::new(settings, clock, dictionary, Box::new(application)))
}

/// Unit of a drive whose counts are each so much \[rev/s\].
fn velocity_unit(factor: f64) -> Option<VelocityUnit> {
    let is = |unit: &VelocityUnit| (unit.rev_per_s() / factor.abs() - 1.0).abs() < 1e-9;
    let increments = VelocityUnit::Increments {
        per_revolution: (1.0 / factor.abs()).round() as u32,
        gear: [1, 1],
        factor: [1, 1],
    };
    (-6..=3).map(VelocityUnit::PrefixedRpm).chain([increments]).find(is)
}

/// Adds the lists of a row, and the objects in them and among the start-up SDOs that are not there.
fn describe(dictionary: &mut ObjectDictionary, row: &DeviceRow) {
    let access = match row.is_mapping_written {
        true => ObjectAccess::ReadWriteInPreOp,
        false => ObjectAccess::ReadOnly,
    };
    for (assignment, lists, mapping) in
        [(0x1c12, &row.outputs, Mapping::Outputs), (0x1c13, &row.inputs, Mapping::Inputs)]
    {
        dictionary.add((assignment, 0), &[lists.len() as u8], access, Mapping::None);
        for (number, pdo) in (1..).zip(lists) {
            let index = pdo.list.to_le_bytes();
            dictionary.add((assignment, number), &index, access, Mapping::None);
            let count = pdo.entries.len() as u8;
            dictionary.add((pdo.list, 0), &[count], access, Mapping::None);
            for (sub, entry) in (1..).zip(&pdo.entries) {
                let key = (entry.index, entry.sub);
                let value = u32::from(entry.index) << 16
                    | u32::from(entry.sub) << 8
                    | u32::from(entry.bits);
                dictionary.add((pdo.list, sub), &value.to_le_bytes(), access, Mapping::None);
                if entry.index != 0 && dictionary.object(key).is_err() {
                    let zeros = vec![0; usize::from(entry.bits).div_ceil(8)];
                    dictionary.add(key, &zeros, ObjectAccess::ReadOnly, mapping);
                }
            }
        }
    }
    for sdo in &row.start_up {
        let key = (sdo.index, sdo.sub);
        if dictionary.object(key).is_err() {
            let zeros = vec![0; usize::from(sdo.kind.bits()).div_ceil(8)];
            dictionary.add(key, &zeros, ObjectAccess::ReadWrite, Mapping::None);
        }
    }
}

/// The crane's motor, behind a drive that may turn the other way round.
struct Shaft {
    plant: Rc<RefCell<Plant>>,
    sign: f64,
}

impl Motor for Shaft {
    fn command(&mut self, speed: Option<f64>) {
        self.plant.borrow_mut().command.motor_speed = self.sign * speed.unwrap_or(0.0);
    }

    fn advance(&mut self, _: u64) {}

    fn speed(&self) -> f64 {
        self.sign * self.plant.borrow().crane.signals().motor_speed
    }

    fn angle(&self) -> f64 {
        0.0
    }
}

/// A device that shows signals of the crane and switches its valve, as the rows of a table say.
struct Terminal {
    plant: Rc<RefCell<Plant>>,
    inputs: Vec<Pdo>,
    outputs: Vec<Pdo>,
    measured: Vec<MeasuredRow>,
    commanded: Vec<CommandedRow>,
}

/// Process data as bytes.
fn image(lists: &[Pdo], value: impl Fn((u16, u8)) -> u64) -> Vec<u8> {
    let bits = lists.iter().flat_map(|list| &list.entries).map(|entry| usize::from(entry.bits));
    let mut bytes = vec![0; bits.sum::<usize>().div_ceil(8)];
    let mut bit = 0;
    for entry in lists.iter().flat_map(|list| &list.entries) {
        let place = Place { device: 0, bit, bits: entry.bits };
        place.write(&mut bytes, value((entry.index, entry.sub)));
        bit += usize::from(entry.bits);
    }
    bytes
}

impl Application for Terminal {
    fn advance(&mut self, _: &mut ObjectDictionary, _: u64) {}

    fn outputs(&mut self, dictionary: &mut ObjectDictionary, _: u64) {
        let bytes = image(&self.outputs, |key| dictionary.unsigned(key));
        for row in &self.commanded {
            let value = row.scale.value(row.scale.kind.number(row.place.read(&bytes)));
            let command = &mut self.plant.borrow_mut().command;
            match row.signal {
                0 => command.motor_speed = value,
                _ => command.holding_valve = value,
            }
        }
    }

    fn inputs(&mut self, dictionary: &mut ObjectDictionary, now: u64) {
        let mut plant = self.plant.borrow_mut();
        plant.latch(now);
        let signals = plant.crane.signals().to_array();
        let is_open = plant.crane.valve() == Some(ValveState::Open);
        let mut bytes = image(&self.inputs, |key| dictionary.unsigned(key));
        for row in &self.measured {
            let value = signals.get(row.signal).copied().unwrap_or(f64::from(u8::from(is_open)));
            row.place.write(&mut bytes, row.scale.counts(value) as u64);
            for (bits, _) in &row.invalid {
                if bits.is_set(&bytes) {
                    let other = bits.place.read(&bytes) ^ bits.mask;
                    bits.place.write(&mut bytes, other);
                }
            }
        }
        let mut bit = 0;
        for entry in self.inputs.iter().flat_map(|list| &list.entries) {
            let place = Place { device: 0, bit, bits: entry.bits };
            dictionary.set_number((entry.index, entry.sub), place.read(&bytes) as i64);
            bit += usize::from(entry.bits);
        }
    }

    fn outputs_are_lost(&mut self, _: &mut ObjectDictionary, _: u64, _: Option<AlStatusCode>) {
        for row in &self.commanded {
            let command = &mut self.plant.borrow_mut().command;
            match row.signal {
                0 => command.motor_speed = 0.0,
                _ => command.holding_valve = 0.0,
            }
        }
    }
}
