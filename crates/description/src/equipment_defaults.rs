//! Typical equipment between controller and machine: drive, switching valve, sensors, fieldbus.

use crate::schema::{KEYS, Key};
use crate::{Description, Origin, spread};
use std::f64::consts::TAU;

/// Sections of the equipment.
const SECTIONS: [&str; 5] = ["drive", "switching_valve", "sensors", "fieldbus", "virtual"];
/// Provenance of a typical value.
const TYPICAL: &str = "typical";

/// Rule for a typical value, in the key's unit.
#[derive(Clone, Copy, Debug)]
enum Value {
    /// Independent of the crane.
    Same(f64),
    /// Computed from the crane.
    Of(fn(&Description) -> f64),
}

/// Typical value of one key.
struct Typical {
    path: &'static str,
    value: Value,
    source: &'static str,
}

const fn same(path: &'static str, value: f64, source: &'static str) -> Typical {
    Typical { path, value: Value::Same(value), source }
}

const fn of(path: &'static str, value: fn(&Description) -> f64, source: &'static str) -> Typical {
    Typical { path, value: Value::Of(value), source }
}

/// Typical values; those independent of the crane are those of `cranes/uia-virtual.toml` (tested).
const TYPICAL_VALUES: [Typical; 17] = [
    same("drive.bandwidth_hz", 97.725, "8 to 120, a servo drive; calibrated to the paper's crane"),
    same("drive.damping_ratio", 0.8, "0.6 to 1, a speed loop tuned for little overshoot"),
    of("drive.max_torque_nm", torque, "2.6 times the torque that holds the load, by statics"),
    of("drive.inertia_kgm2", inertia, "motor, coupling and pump: 0.0045 kg m2 for 32 N m"),
    same(
        "drive.dead_time_ms",
        0.0,
        "0 to 10, cycles of the drive's own control; its bandwidth has them here",
    ),
    same("switching_valve.delay_ms", 25.0, "15 to 50, a solenoid seat valve"),
    same("switching_valve.pilot_line_ms", 10.0, "5 to 30, short pilot lines"),
    same("sensors.position_noise_mm", 0.01, "0.005 to 0.02, magnetostrictive encoder"),
    same("sensors.position_resolution_mm", 0.005, "magnetostrictive encoder, data sheet class"),
    of("sensors.pressure_span_bar", span, "usual span 1.25 times supervision.pressure_bar or more"),
    same("sensors.pressure_error_percent", 0.0, "0.25 to 0.5 of one transducer to the next"),
    same("sensors.pressure_noise_percent", 0.02, "0.01 to 0.05"),
    same("sensors.pressure_bits", 15.0, "16 bit input, one for the sign"),
    same("sensors.bandwidth_hz", 500.0, "300 to 1000"),
    same("fieldbus.delay_cycles", 1.0, "1 or 2 control cycles each way"),
    same("virtual.step_us", 250.0, "its error is below the sensors' noise"),
    same("virtual.seed", 1.0, "any"),
];

/// Largest torque over the torque that holds the load: 32 N m on `cranes/uia-virtual.toml`.
const TORQUE_RESERVE: f64 = 2.6;
/// Torque \[N m\] of the typical drive, for cranes whose load torque cannot be computed.
const USUAL_TORQUE: f64 = 32.0;
/// Moment of inertia over largest torque \[kg m²/(N m)\]: 0.0045 kg m² at 32 N m. Drives of one series have similar
/// accelerations.
const INERTIA_PER_TORQUE: f64 = 0.0045 / 32.0;
/// Usual spans of pressure transducers \[bar\].
const SPANS: [f64; 5] = [100.0, 160.0, 250.0, 400.0, 600.0];
/// Smallest span over the largest pressure of the supervision: 250 bar for 200 bar.
const SPAN_RESERVE: f64 = 1.25;

fn torque(crane: &Description) -> f64 {
    match crane.holding_pressure() {
        Some(pressure) if pressure > 0.0 => {
            two_digits(TORQUE_RESERVE * pressure * crane.numbers.displacement / TAU)
        }
        _ => USUAL_TORQUE,
    }
}

fn inertia(crane: &Description) -> f64 {
    let torque = match crane.is_absent("drive.max_torque_nm") {
        true => torque(crane),
        false => crane.numbers.drive_torque,
    };
    two_digits(torque * INERTIA_PER_TORQUE)
}

fn span(crane: &Description) -> f64 {
    let needed = SPAN_RESERVE * 1e-5 * crane.numbers.supervision_pressure;
    // tolerance for rounding: a pressure equal to a span fits
    let fits = |span: &f64| *span >= needed * (1.0 - 1e-9);
    SPANS.into_iter().find(fits).unwrap_or_else(|| two_digits(needed))
}

fn two_digits(value: f64) -> f64 {
    format!("{value:.1e}").parse().unwrap_or(value)
}

/// Key that a crane file leaves out, with its typical value.
#[derive(Clone, Debug, PartialEq)]
pub struct FilledIn {
    /// The key with its unit and limits.
    pub key: &'static Key,
    /// Typical value, in the key's unit.
    pub value: f64,
    /// Source of the typical value, for example a data sheet or "estimate".
    pub source: &'static str,
}

impl std::fmt::Display for FilledIn {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let unit = if self.key.unit == "-" { "" } else { self.key.unit };
        write!(f, "{}", format!("{} = {} {unit}", self.key.path(), self.value).trim_end())
    }
}

impl Description {
    /// The virtual crane of this crane file, and the list of keys that were filled in. Drive, switching valve,
    /// sensors, fieldbus and time step get typical values where the file leaves their keys out.
    ///
    /// A key that the file states or an override sets keeps its value; `drive.bandwidth_hz = 0` stays an ideal drive.
    /// A crane with another kind of circuit has no such keys and is not changed.
    pub fn virtual_crane(&self) -> (Self, Vec<FilledIn>) {
        let mut machine = self.clone();
        let mut numbers = self.numbers.to_array();
        let mut filled_in = Vec::new();
        for (index, value, source) in self.typical_values() {
            if self.origins[index].provenance != Origin::ABSENT {
                continue;
            }
            let key = &KEYS[index];
            numbers[index] = key.to_si(value);
            machine.origins[index] =
                Origin { provenance: TYPICAL.into(), source: source.into(), line: None };
            filled_in.push(FilledIn { key, value, source });
        }
        machine.numbers = crate::Numbers::from_array(numbers);
        (machine, filled_in)
    }

    /// The machine with ideal equipment: drive and valve without lag and delay, exact sensors, no fieldbus, as in the
    /// published model.
    pub fn without_equipment(&self) -> Self {
        let mut without = self.clone();
        let mut numbers = self.numbers.to_array();
        for (index, key) in KEYS.iter().enumerate() {
            if let Some(value) = key.absent.filter(|_| is_equipment(key.section)) {
                numbers[index] = key.to_si(value);
                without.origins[index] = Origin::absent();
            }
        }
        Self { numbers: crate::Numbers::from_array(numbers), ..without }
    }

    /// Whether the readings of position and pressures contain noise, so that repeated equal readings indicate a stuck
    /// sensor.
    ///
    /// With noise below a quarter of the resolution, equal readings are normal.
    pub fn has_sensor_noise(&self) -> bool {
        let n = &self.numbers;
        let bits = n.pressure_bits;
        let resolution = if bits >= 1.0 { n.pressure_span / bits.exp2() } else { 0.0 };
        let scatters = |noise: f64, resolution: f64| noise > 0.0 && noise >= 0.25 * resolution;
        scatters(n.position_noise, n.position_resolution)
            && scatters(n.pressure_noise * n.pressure_span, resolution)
    }

    /// Typical drive, switching valve, sensors and fieldbus for this crane, as sections of a crane file.
    pub fn equipment_text(&self) -> String {
        let mut text = String::new();
        let mut section = "";
        for (index, value, source) in self.typical_values() {
            let key = &KEYS[index];
            // time step and seed exist only in simulation
            if key.section == "virtual" {
                continue;
            }
            if key.section != section {
                section = key.section;
                text += &format!("\n[{section}]\n");
            }
            let range = spread::of(&key.path()).map_or(String::new(), |spread| {
                let [low, high] = spread.width.around(value).map(two_digits);
                format!("range = [{:?}, {:?}], ", low.min(value), high.max(value))
            });
            text += &format!(
                "{} = {{ value = {value:?}, {range}provenance = \"estimate\", source = \"{source}\" }}\n",
                key.name
            );
        }
        text
    }

    /// All keys of the supervision at their defaults, as a section of a crane file.
    pub fn supervision_text(&self) -> String {
        let mut text = String::from("\n[supervision]\n");
        for key in KEYS.iter().filter(|key| key.section == "supervision") {
            if let Some(value) = key.absent {
                text += &format!(
                    "{} = {{ value = {value:?}, provenance = \"estimate\", source = \"default: {}\" }}\n",
                    key.name, key.meaning
                );
            }
        }
        text
    }

    /// Keys of this kind of crane with a typical value: index, value in the key's unit, and source.
    fn typical_values(&self) -> impl Iterator<Item = (usize, f64, &'static str)> {
        self.own_keys().filter_map(|index| {
            let path = KEYS[index].path();
            let typical = TYPICAL_VALUES.iter().find(|typical| typical.path == path)?;
            let value = match typical.value {
                Value::Same(value) => value,
                Value::Of(value) => value(self),
            };
            Some((index, value, typical.source))
        })
    }

    /// Whether neither the file nor an override states a key.
    fn is_absent(&self, path: &str) -> bool {
        let index = KEYS.iter().position(|key| key.path() == path);
        index.is_some_and(|index| self.origins[index].provenance == Origin::ABSENT)
    }
}

/// Whether a section describes equipment between controller and crane.
pub(crate) fn is_equipment(section: &str) -> bool {
    SECTIONS.contains(&section)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn typical_values_are_those_of_the_virtual_crane() {
        let crane = Description::uia_virtual().unwrap();
        let (same, filled_in) = crane.virtual_crane();
        assert!(filled_in.is_empty(), "{filled_in:?}");
        assert_eq!(same.numbers, crane.numbers);
        for (index, value, _) in crane.typical_values() {
            let here = KEYS[index].to_unit(crane.numbers.to_array()[index]);
            assert_eq!(value, here, "{}", KEYS[index].path());
        }
        assert_eq!(crane.typical_values().count(), TYPICAL_VALUES.len());
    }
}
