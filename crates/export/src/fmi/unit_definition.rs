//! Units in terms of SI base units, as FMI defines them.

use std::f64::consts::PI;
use std::fmt::Write;

/// Exponents of kg, m, s, A, K, mol, cd and rad.
type Exponents = [f64; 8];

const BASE: [&str; 8] = ["kg", "m", "s", "A", "K", "mol", "cd", "rad"];

/// A unit as a product of powers of base units.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Definition {
    exponents: Exponents,
    /// Value of one unit in base units.
    factor: f64,
}

const NONE: Exponents = [0.0; 8];

/// Exponents of kg, m and s only.
const fn mechanical(kg: f64, m: f64, s: f64) -> Exponents {
    [kg, m, s, 0.0, 0.0, 0.0, 0.0, 0.0]
}

const LENGTH: Exponents = mechanical(0.0, 1.0, 0.0);
const MASS: Exponents = mechanical(1.0, 0.0, 0.0);
const TIME: Exponents = mechanical(0.0, 0.0, 1.0);
const RATE: Exponents = mechanical(0.0, 0.0, -1.0);
const FORCE: Exponents = mechanical(1.0, 1.0, -2.0);
const PRESSURE: Exponents = mechanical(1.0, -1.0, -2.0);
const ENERGY: Exponents = mechanical(1.0, 2.0, -2.0);
const POWER: Exponents = mechanical(1.0, 2.0, -3.0);
const VOLUME: Exponents = mechanical(0.0, 3.0, 0.0);
const TEMPERATURE: Exponents = [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
const ANGLE: Exponents = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
const TURN_RATE: Exponents = [0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
const TENSION: Exponents = [1.0, 2.0, -3.0, -1.0, 0.0, 0.0, 0.0, 0.0];

/// Symbols of units and their values.
const SYMBOLS: [(&str, Exponents, f64); 35] = [
    ("m", LENGTH, 1.0),
    ("mm", LENGTH, 1e-3),
    ("cm", LENGTH, 1e-2),
    ("kg", MASS, 1.0),
    ("s", TIME, 1.0),
    ("ms", TIME, 1e-3),
    ("us", TIME, 1e-6),
    ("min", TIME, 60.0),
    ("Hz", RATE, 1.0),
    ("N", FORCE, 1.0),
    ("kN", FORCE, 1e3),
    ("Pa", PRESSURE, 1.0),
    ("bar", PRESSURE, 1e5),
    ("MPa", PRESSURE, 1e6),
    ("GPa", PRESSURE, 1e9),
    ("J", ENERGY, 1.0),
    ("kJ", ENERGY, 1e3),
    ("W", POWER, 1.0),
    ("L", VOLUME, 1e-3),
    ("K", TEMPERATURE, 1.0),
    ("V", TENSION, 1.0),
    ("rad", ANGLE, 1.0),
    ("mrad", ANGLE, 1e-3),
    ("deg", ANGLE, PI / 180.0),
    ("rev", ANGLE, 2.0 * PI),
    ("rpm", TURN_RATE, 2.0 * PI / 60.0),
    ("%", NONE, 1e-2),
    ("bit", NONE, 1.0),
    ("cycles", NONE, 1.0),
    ("-", NONE, 1.0),
    ("code", NONE, 1.0),
    ("0/1", NONE, 1.0),
    ("1", NONE, 1.0),
    ("1000", NONE, 1e3),
    ("", NONE, 1.0),
];

/// 0 degrees Celsius \[K\].
const CELSIUS_ZERO: f64 = 273.15;

/// A symbol with its power: `m3`, `Pa^0.5`.
fn power(text: &str) -> Option<Definition> {
    let find = |symbol: &str| SYMBOLS.iter().find(|(own, ..)| *own == symbol);
    let (symbol, exponent) = match find(text) {
        Some(_) => (text, 1.0),
        None => {
            let at = text.find(|c: char| c == '^' || c.is_ascii_digit())?;
            (&text[..at], text[at..].trim_start_matches('^').parse::<f64>().ok()?)
        }
    };
    let (_, exponents, factor) = find(symbol)?;
    Some(Definition { exponents: exponents.map(|e| e * exponent), factor: factor.powf(exponent) })
}

/// Parses a unit: a product, with divisors after slashes and products in brackets.
fn definition(unit: &str) -> Option<Definition> {
    let plain: String = unit
        .chars()
        .map(|c| match c {
            '²' => '2',
            '³' => '3',
            '⁶' => '6',
            '·' => ' ',
            c => c,
        })
        .collect();
    let mut whole = Definition { exponents: NONE, factor: 1.0 };
    for (k, part) in plain.split('/').enumerate() {
        let sign = if k == 0 { 1.0 } else { -1.0 };
        for symbol in part.trim_matches(['(', ')']).split(' ') {
            let found = power(symbol)?;
            whole.factor *= found.factor.powf(sign);
            for (sum, exponent) in whole.exponents.iter_mut().zip(found.exponents) {
                *sum += sign * exponent;
            }
        }
    }
    Some(whole)
}

/// The element `BaseUnit` of a unit; empty for units with fractional exponents, which FMI cannot define.
pub(super) fn base_unit(unit: &str) -> String {
    let (found, offset) = match unit {
        "C" => (definition("K"), CELSIUS_ZERO),
        unit => (definition(unit), 0.0),
    };
    let Some(found) = found.filter(|d| d.exponents.iter().all(|e| e.fract() == 0.0)) else {
        return String::new();
    };
    let mut text = String::from("<BaseUnit");
    for (name, exponent) in BASE.iter().zip(found.exponents).filter(|(_, e)| *e != 0.0) {
        let _ = write!(text, " {name}=\"{exponent}\"");
    }
    if found.factor != 1.0 {
        let _ = write!(text, " factor=\"{:?}\"", found.factor);
    }
    if offset != 0.0 {
        let _ = write!(text, " offset=\"{offset:?}\"");
    }
    text + "/>"
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_description::schema::KEYS;

    #[test]
    fn units_are_products_of_base_units() {
        assert_eq!(base_unit("bar"), "<BaseUnit kg=\"1\" m=\"-1\" s=\"-2\" factor=\"100000.0\"/>");
        assert_eq!(base_unit("kg m2"), "<BaseUnit kg=\"1\" m=\"2\"/>");
        assert_eq!(base_unit("m3/(s Pa)"), "<BaseUnit kg=\"-1\" m=\"4\" s=\"1\"/>");
        assert_eq!(base_unit("m³/s"), base_unit("m3/s"));
        assert_eq!(base_unit("Pa/s"), base_unit("N/m2/s"));
        assert_eq!(base_unit("C"), "<BaseUnit K=\"1\" offset=\"273.15\"/>");
        assert_eq!(
            base_unit("rev/s"),
            "<BaseUnit s=\"-1\" rad=\"1\" factor=\"6.283185307179586\"/>"
        );
        assert_eq!(base_unit("m3/(s Pa^0.5)"), "");
        assert_eq!(base_unit("furlong"), "");
    }

    /// Crane files count revolutions and FMI radians; all other units have the same factor in both.
    #[test]
    fn every_unit_of_a_crane_file_is_known_with_the_factor_of_its_keys() {
        for key in KEYS {
            let found = definition(if key.unit == "C" { "K" } else { key.unit }).unwrap();
            if !key.unit.contains('r') || key.unit.contains("bar") && !key.unit.contains("rev") {
                let off = (found.factor / key.factor - 1.0).abs();
                assert!(off < 1e-12, "{}: {} for {}", key.unit, found.factor, key.factor);
            }
        }
    }
}
