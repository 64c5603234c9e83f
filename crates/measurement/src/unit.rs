//! Units, with their usual spellings.

use crate::dimension::Dimension;
use crate::unit_table::UNITS;
use thiserror::Error;

/// Unit of measurement with its conversion to SI units: SI value = factor × number + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// Usual spelling, as `bar`.
    pub name: &'static str,
    /// Physical dimension.
    pub dimension: Dimension,
    /// Size in SI units \[SI unit per unit\]; rotation in rev/s, angles in rad, shares in 1.
    pub factor: f64,
    /// SI value of the unit's zero: 273.15 K for °C, and for absolute pressures the negative atmospheric pressure,
    /// because pressures are gauge pressures.
    pub offset: f64,
    /// Other spellings, normalised by [`normal`], in small letters.
    pub(crate) spellings: &'static [&'static str],
}

/// Reason why a text is not accepted as a unit.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum UnitError {
    /// The unit is not known.
    #[error("\"{text}\" is no known unit; {nearest}")]
    Unknown {
        /// What was read.
        text: String,
        /// The known unit with the most similar spelling, or all units of the wanted dimension if none is similar.
        nearest: String,
    },
    /// The unit has another dimension.
    #[error("\"{text}\" is {}, not {}: one of {}", found.words(), wanted.words(), Unit::names(*wanted))]
    Dimension {
        /// What was read.
        text: String,
        /// Dimension of the unit read.
        found: Dimension,
        /// Required dimension.
        wanted: Dimension,
    },
}

impl Unit {
    /// All known units, in the order of the dimensions.
    pub const ALL: &'static [Self] = &UNITS;

    /// Parses a unit in any spelling: with a Greek mu or a micro sign, superscript digits, in brackets or quotes, or
    /// with its dimension in parentheses, `V (Voltage)`. Mega and milli are distinguished.
    ///
    /// # Errors
    ///
    /// [`UnitError::Unknown`] with the most similar known unit.
    pub fn from_text(text: &str) -> Result<Self, UnitError> {
        Self::find(text)
            .ok_or_else(|| UnitError::Unknown { text: excerpt(text), nearest: nearest(text, None) })
    }

    /// Unit of a required dimension from its text, in any spelling that [`from_text`](Self::from_text) reads.
    ///
    /// # Errors
    ///
    /// [`UnitError`] if the unit is unknown, with the most similar one of that dimension, or if it has another
    /// dimension.
    pub fn of_dimension(text: &str, wanted: Dimension) -> Result<Self, UnitError> {
        match Self::find(text) {
            Some(unit) if unit.dimension == wanted => Ok(unit),
            Some(unit) => {
                Err(UnitError::Dimension { text: excerpt(text), found: unit.dimension, wanted })
            }
            None => Err(UnitError::Unknown {
                text: excerpt(text),
                nearest: nearest(text, Some(wanted)),
            }),
        }
    }

    /// Value in SI units (rotation in rev/s, pressures as gauge pressures) of a number with this unit.
    pub fn si(&self, number: f64) -> f64 {
        number * self.factor + self.offset
    }

    /// Names of all units of a dimension as one text, the most common first.
    pub fn names(dimension: Dimension) -> String {
        let all = Self::ALL.iter().filter(|u| u.dimension == dimension);
        all.map(|u| u.name).collect::<Vec<_>>().join(", ")
    }

    /// Looks up the unit of a text.
    pub(crate) fn find(text: &str) -> Option<Self> {
        let text = stripped(text);
        let whole = Self::spelled(&normal(text));
        whole.or_else(|| {
            if let Some(gauge) = without_absolute(text).and_then(Self::find)
                && gauge.dimension == Dimension::Pressure
            {
                let is_it = |u: &&Self| {
                    u.dimension == Dimension::Pressure
                        && u.offset != 0.0
                        && u.factor.to_bits() == gauge.factor.to_bits()
                };
                return Self::ALL.iter().find(is_it).copied();
            }
            // `V (Voltage)`, and `Pressure (bar)`
            let (before, inside) = text.strip_suffix(')')?.split_once('(')?;
            Self::spelled(&normal(stripped(before)))
                .or_else(|| Self::spelled(&normal(stripped(inside))))
        })
    }

    fn spelled(normal: &str) -> Option<Self> {
        let exact = Self::ALL.iter().find(|u| u.name == normal);
        exact.copied().or_else(|| {
            let small = normal.to_lowercase();
            // between units that differ only in capitals, mega is chosen where milli makes no sense
            let is_one = |u: &&Self| {
                u.spellings.contains(&small.as_str())
                    || (u.name.to_lowercase() == small && !matches!(u.name, "mPa" | "MW" | "MN"))
            };
            Self::ALL.iter().find(is_one).copied()
        })
    }
}

/// Removes surrounding quotes, brackets and a comment sign.
fn stripped(text: &str) -> &str {
    let mut text = text.trim();
    loop {
        let inner = text
            .strip_prefix('[')
            .and_then(|t| t.strip_suffix(']'))
            .or_else(|| text.strip_prefix('(').and_then(|t| t.strip_suffix(')')))
            .or_else(|| text.strip_prefix('<').and_then(|t| t.strip_suffix('>')))
            .or_else(|| text.strip_prefix('{').and_then(|t| t.strip_suffix('}')))
            .or_else(|| text.strip_prefix('\'').and_then(|t| t.strip_suffix('\'')))
            .or_else(|| {
                text.strip_prefix('"').and_then(|t| t.strip_suffix('"')).filter(|t| !t.is_empty())
            });
        match inner {
            Some(inner) => text = inner.trim(),
            None => return text,
        }
    }
}

/// The text before "absolute" in any spelling: `bar (abs.)`, `kPa absolut`, `hPa(a)`.
fn without_absolute(text: &str) -> Option<&str> {
    let text = text.trim().trim_end_matches([')', ']']).trim_end_matches('.');
    let word = text.rfind(|c: char| !c.is_alphabetic()).map_or(0, |at| at + 1);
    // the separator may be a character of several bytes
    let word = (word..text.len()).find(|at| text.is_char_boundary(*at))?;
    let is_absolute = ["a", "abs", "absolut", "absolute"]
        .iter()
        .any(|spelling| text[word..].eq_ignore_ascii_case(spelling));
    let before = text[..word].trim_end_matches(['(', '[', ' ', '_', ',', '-', '.']);
    (is_absolute && word > 0 && !before.is_empty()).then_some(before)
}

/// Normalised spelling: `u` for micro, plain digits, without blanks, dots, crosses and carets.
fn normal(text: &str) -> String {
    let mut normal = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            'µ' | 'μ' => normal.push('u'),
            '²' => normal.push('2'),
            '³' => normal.push('3'),
            '¹' => normal.push('1'),
            '⁻' | '−' | '–' => normal.push('-'),
            'º' | '˚' => normal.push('°'),
            '℃' => normal.push_str("°C"),
            '℉' => normal.push_str("°F"),
            '∕' | '÷' => normal.push('/'),
            '″' | '”' => normal.push('"'),
            '·' | '⋅' | '×' | '*' | '^' => {}
            c if c.is_whitespace() => {}
            c => normal.push(c),
        }
    }
    normal
}

/// The beginning of a text, for messages.
fn excerpt(text: &str) -> String {
    text.trim().chars().take(40).collect()
}

/// Smallest similarity of a spelling that is proposed.
const ALIKE: f64 = 0.4;

/// The unit of the dimension, if given, with the most similar spelling; all units of it if none is similar.
fn nearest(text: &str, wanted: Option<Dimension>) -> String {
    let small = normal(&excerpt(stripped(text))).to_lowercase();
    let alike = |spelling: &str| strsim::normalized_damerau_levenshtein(&small, spelling);
    let of = |unit: &&Unit| {
        let name = alike(&unit.name.to_lowercase());
        unit.spellings.iter().map(|s| alike(s)).fold(name, f64::max)
    };
    let fitting = Unit::ALL.iter().filter(|u| wanted.is_none_or(|d| u.dimension == d));
    // between equally similar units the first, which is the most common
    let best = fitting.rev().max_by(|a, b| of(a).total_cmp(&of(b)));
    match (best.filter(|unit| of(unit) >= ALIKE), wanted) {
        (Some(unit), _) => format!("the nearest is {}", unit.name),
        (None, Some(dimension)) => format!("known are {}", Unit::names(dimension)),
        (None, None) => "none that is known is written like it".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_quantity_is_the_same_in_every_unit() {
        // an atmosphere, a metre, a turn a second and others, as tables print them
        for (quantity, list) in [
            (101_325.0, &[("Pa", 101_325.0), ("kPa", 101.325), ("MPa", 0.101_325)][..]),
            (101_325.0, &[("mbar", 1013.25), ("bar", 1.013_25), ("psi", 14.695_949)]),
            (101_325.0, &[("kgf/cm²", 1.033_227), ("N/mm²", 0.101_325), ("N/m^2", 101_325.0)]),
            (101_325.0, &[("hPa", 1013.25), ("atm", 1.0), ("mmHg", 760.0), ("Torr", 760.0)]),
            (1.0, &[("m", 1.0), ("cm", 100.0), ("mm", 1e3), ("um", 1e6), ("in", 39.370_079)]),
            (1.0, &[("m/s", 1.0), ("mm/s", 1e3), ("rev/s", 1.0), ("rpm", 60.0)]),
            (1.0, &[("rad/s", std::f64::consts::TAU), ("deg/s", 360.0), ("1/min", 60.0)]),
            (std::f64::consts::TAU, &[("rad", std::f64::consts::TAU), ("deg", 360.0)]),
            (1.0, &[("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9), ("%", 100.0)]),
            (3600.0, &[("h", 1.0), ("min", 60.0), ("V", 3600.0), ("mA", 3.6e6)]),
            (1e-3, &[("L/min", 60.0), ("l/s", 1.0), ("gpm", 15.850_323)]),
        ] {
            for (name, count) in list {
                let unit = Unit::from_text(name).unwrap();
                assert!((unit.si(*count) / quantity - 1.0).abs() < 1e-6, "{name}");
            }
        }
        // units with another zero: absolute pressure as gauge pressure, temperatures
        for (name, number, si) in [
            ("bar abs", 1.013_25, 0.0),
            ("bara", 71.013_25, 70e5),
            ("psia", 14.695_949, 0.0),
            ("bar(g)", 70.0, 70e5),
            ("°C", 0.0, 273.15),
            ("degF", 32.0, 273.15),
        ] {
            let unit = Unit::from_text(name).unwrap();
            assert!((unit.si(number) - si).abs() < 1e-2, "{name}: {}", unit.si(number));
        }
    }

    #[test]
    fn a_unit_is_recognised_in_every_spelling() {
        for (text, name) in [
            ("MPa", "MPa"),
            ("mPa", "mPa"),
            ("mpa", "MPa"),
            ("MPA", "MPa"),
            ("[bar]", "bar"),
            ("(kPa)", "kPa"),
            ("\"psi\"", "psi"),
            ("'rad/s'", "rad/s"),
            ("µs", "us"),
            ("μs", "us"),
            ("m·s⁻¹", "m/s"),
            ("N/mm²", "N/mm2"),
            ("kgf/cm^2", "kgf/cm2"),
            ("V (Voltage)", "V"),
            ("MPa (Pressure)", "MPa"),
            ("Pressure (bar)", "bar"),
            ("bar (g)", "bar"),
            ("bar (abs)", "bar abs"),
            ("psi(a)", "psia"),
            ("bar (absolute)", "bar abs"),
            ("bar (absolut)", "bar abs"),
            ("kPa (abs.)", "kPa abs"),
            ("[mbar, abs]", "mbar abs"),
            ("N/mm² abs", "MPa abs"),
            ("1/min", "rpm"),
            ("min⁻¹", "rpm"),
            ("U/min", "rpm"),
            ("l / min", "L/min"),
            ("N·m", "Nm"),
            ("msec", "ms"),
            ("\"", "in"),
            ("-", "-"),
        ] {
            assert_eq!(Unit::from_text(text).map(|u| u.name), Ok(name), "{text}");
        }
        let unknown = |text: &str| Unit::from_text(text).unwrap_err().to_string();
        assert_eq!(unknown("barr"), "\"barr\" is no known unit; the nearest is bar");
        // not a gauge pressure in any unit
        for text in ["kgf/cm2 (abs)", "Torr abs", "barr (absolute)"] {
            assert!(Unit::from_text(text).is_err(), "{text}");
        }
        assert!(unknown("furlong").contains("no known unit"));
        assert!(unknown(&"x".repeat(100_000)).len() < 120);
        let wrong = Unit::of_dimension("mm", Dimension::Pressure).unwrap_err().to_string();
        assert!(wrong.starts_with("\"mm\" is a length, not a pressure: one of bar, Pa"), "{wrong}");
        let near = Unit::of_dimension("mba", Dimension::Pressure).unwrap_err().to_string();
        assert!(near.contains("nearest is mbar"), "{near}");
    }

    #[test]
    fn no_spelling_means_two_units() {
        for (k, unit) in Unit::ALL.iter().enumerate() {
            assert_eq!(Unit::find(unit.name).map(|u| u.name), Some(unit.name));
            for spelling in unit.spellings {
                assert_eq!(normal(spelling).to_lowercase(), *spelling, "{}", unit.name);
                let others = Unit::ALL.iter().enumerate().filter(|(other, _)| *other != k);
                let taken = others.map(|(_, u)| u).find(|u| u.spellings.contains(spelling));
                assert!(taken.is_none(), "{spelling}: {} and {:?}", unit.name, taken);
                assert_eq!(Unit::find(spelling).map(|u| u.name), Some(unit.name), "{spelling}");
            }
        }
    }
}
