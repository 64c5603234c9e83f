//! Limits of the values of a crane file, and the units that a value outside of them was probably given in.

use crate::schema::Key;
use hydroboom_model::MAX_SEGMENTS;

/// Units that are often confused with this one, with their size in it.
fn mistaken_units(unit: &str) -> &'static [(&'static str, f64)] {
    match unit {
        "bar" => &[("Pa", 1e-5), ("kPa", 1e-2), ("MPa", 10.0), ("psi", 0.068_947_6)],
        "mm" => &[("m", 1000.0), ("cm", 10.0), ("in", 25.4)],
        "mm/s" => &[("m/s", 1000.0), ("cm/s", 10.0)],
        "L" => &[("m3", 1000.0), ("mL", 1e-3), ("cm3", 1e-3)],
        "MPa" => &[("Pa", 1e-6), ("bar", 0.1), ("GPa", 1000.0)],
        "GPa" => &[("Pa", 1e-9), ("MPa", 1e-3)],
        "cm4" => &[("m4", 1e8), ("mm4", 1e-4)],
        "kg" => &[("t", 1000.0), ("g", 1e-3)],
        "cm3/rev" => &[("m3/rev", 1e6), ("L/rev", 1000.0)],
        "rpm" => &[("rev/s", 60.0), ("rad/s", 9.549_3)],
        "ms" => &[("s", 1000.0), ("us", 1e-3)],
        "us" => &[("s", 1e6), ("ms", 1000.0)],
        _ => &[],
    }
}

/// Checks a number for a key; returns message and remedy if it is not allowed.
pub(crate) fn number_problem(key: &Key, value: f64) -> Option<(String, String)> {
    let is_fraction = key.is_whole && value.fract() != 0.0;
    if value.is_finite() && (key.low..=key.high).contains(&value) && !is_fraction {
        return None;
    }
    if key.is_whole {
        let (path, low, high) = (key.path(), key.low, key.high);
        let help = format!("{path} is a whole number from {low} to {high}: {}", key.meaning);
        return Some((
            format!("`{path}` is a whole number from {low} to {high}, not {value}"),
            help,
        ));
    }
    let range = format!("{} is {} to {} {}", key.path(), key.low, key.high, key.unit);
    let hint = mistaken_units(key.unit)
        .iter()
        .map(|(unit, size)| (unit, value * size))
        .find(|(_, inside)| (key.low..=key.high).contains(inside));
    let help = match hint {
        Some((unit, inside)) => {
            format!("{range}; {value} {unit} would be {inside} {}", key.unit)
        }
        None => format!("{range}: {}", key.meaning),
    };
    Some((format!("`{}` cannot be {value} {}", key.path(), key.unit), help))
}

/// A number of segments as a count, if it is possible.
pub(crate) fn whole_segments(count: f64) -> Option<usize> {
    (count.fract() == 0.0 && (1.0..=MAX_SEGMENTS as f64).contains(&count)).then_some(count as usize)
}

/// Whether lengths of segments are possible.
pub(crate) fn valid_lengths(lengths: &[f64]) -> bool {
    (1..=MAX_SEGMENTS).contains(&lengths.len())
        && lengths.iter().all(|length| *length > 0.0 && length.is_finite())
}
