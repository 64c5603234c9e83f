//! Range and nominal value of an FMU's variables.

use crate::block::Variable;
use crate::name::plain;
use hydroboom_description::schema::{KEYS, Key};
use std::f64::consts::TAU;

/// Minimum, maximum and nominal value of a variable, in its unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds {
    pub(super) low: Option<f64>,
    pub(super) high: Option<f64>,
    pub(super) nominal: f64,
}

/// Largest motor speed of a crane file \[rev/s\]: 100 000 rpm, as `motor.max_speed_rpm` allows.
const FASTEST_MOTOR: f64 = 1e5 / 60.0;
/// Largest stroke of a crane file \[m\], as `cylinder.stroke_mm` allows.
const LONGEST_STROKE: f64 = 20.0;
/// Largest speed of motion of a crane file \[m/s\], as `motion.fast_mm_s` allows.
const FASTEST_MOTION: f64 = 10.0;
/// Largest pressure of the model's validity \[Pa\]: 1000 bar.
const HIGHEST_PRESSURE: f64 = 1000e5;
/// Smallest pressure state \[Pa\]: below vapour pressure it measures the cavity, down to the largest
/// `oil.bulk_modulus_min_mpa`.
const LOWEST_NODE: f64 = -5001e6;
/// Smallest step \[s\], as `controller.simulation_period_us` allows.
const SHORTEST_STEP: f64 = 0.1e-6;
/// Largest volume of an accumulator \[m3\], as `accumulator.volume_l` allows.
const LARGEST_SHELL: f64 = 10.0;
/// Largest angular velocity of a boom \[rad/s\]; larger values indicate an error.
const FASTEST_TURN: f64 = 1e3;

/// Nominal value of a quantity with this unit.
fn nominal(unit: &str) -> f64 {
    match unit {
        "Pa" => 1e7,
        "Pa/s" => 1e8,
        "m" | "m/s" | "rad/s" | "rad" => 0.1,
        "rad/s2" => 10.0,
        "rev/s" => 10.0,
        "N" => 1e5,
        "m3" => 1e-3,
        "m3/s" => 1e-4,
        _ => 1.0,
    }
}

/// The crane file's key of a parameter.
pub(super) fn key(name: &str) -> Option<&'static Key> {
    KEYS.iter().find(|key| plain(&key.path()) == name)
}

fn bounded(v: &Variable, low: f64, high: f64) -> Bounds {
    Bounds { low: Some(low), high: Some(high), nominal: nominal(&v.unit) }
}

fn unbounded(v: &Variable) -> Bounds {
    Bounds { low: None, high: None, nominal: nominal(&v.unit) }
}

/// Bounds of a parameter: the crane file's range; the nominal value is its own value.
pub(super) fn of_parameter(v: &Variable) -> Bounds {
    let nominal = if v.initial == 0.0 { 1.0 } else { v.initial.abs() };
    match key(&v.name) {
        Some(key) => Bounds { low: Some(key.low), high: Some(key.high), nominal },
        None => Bounds { low: None, high: None, nominal },
    }
}

/// Bounds of an input, with the longest step \[s\] of the scheme.
pub(super) fn of_input(v: &Variable, longest_step: f64) -> Bounds {
    match (v.name.as_str(), v.unit.as_str()) {
        ("step", _) => Bounds { nominal: v.initial, ..bounded(v, SHORTEST_STEP, longest_step) },
        ("holding_valve", _) | (_, "0/1") => bounded(v, 0.0, 1.0),
        ("valve_state", _) => bounded(v, -1.0, 1.0),
        (_, "rev/s") => bounded(v, -FASTEST_MOTOR, FASTEST_MOTOR),
        (_, "m") => bounded(v, -LONGEST_STROKE, LONGEST_STROKE),
        (_, "m/s") => bounded(v, -FASTEST_MOTION, FASTEST_MOTION),
        (_, "Pa") => bounded(v, -HIGHEST_PRESSURE, HIGHEST_PRESSURE),
        _ => unbounded(v),
    }
}

/// Bounds of a state.
pub(super) fn of_state(v: &Variable) -> Bounds {
    let is = |beginning: &str| v.name.starts_with(beginning);
    match v.unit.as_str() {
        "rad" if is("angle_") => bounded(v, -TAU, TAU),
        "rad/s" if is("angular_velocity_") => bounded(v, -FASTEST_TURN, FASTEST_TURN),
        "Pa" if is("pressure_") => bounded(v, LOWEST_NODE, HIGHEST_PRESSURE),
        "m" if is("bristle") => bounded(v, -LONGEST_STROKE, LONGEST_STROKE),
        "m3" if is("gas_volume") => bounded(v, 0.0, LARGEST_SHELL),
        _ => unbounded(v),
    }
}

/// Bounds of an output or a rate: volumes are not negative, other quantities are not bounded.
pub(super) fn of_output(v: &Variable) -> Bounds {
    let low = matches!(v.name.as_str(), "gas_volume" | "cavity_volume").then_some(0.0);
    Bounds { low, ..unbounded(v) }
}
