//! A column's heading: its name, and the unit that is stated in it.

use crate::dimension::Dimension;
use crate::unit::Unit;

/// Heading of a column, divided into name and unit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Heading {
    /// Name of the quantity, without its unit.
    pub name: String,
    /// Stated unit; none if the heading states none, or no known one.
    pub unit: Option<Unit>,
    /// Text stated as a unit that is no known unit; else none.
    pub unknown_unit: Option<String>,
}

/// Names of time columns, in small letters.
pub(crate) const TIMES: [&str; 15] = [
    "t",
    "time",
    "zeit",
    "timestamp",
    "timestamps",
    "elapsed",
    "tid",
    "temps",
    "tout",
    "datetime",
    "zeitstempel",
    "abszeit",
    "relzeit",
    "uhrzeit",
    "x_value",
];
/// Words in parentheses that are not units.
const REMARKS: [&str; 36] = [
    "raw", "set", "act", "ist", "soll", "abs", "rel", "ref", "sim", "cmd", "meas", "calc", "real",
    "left", "right", "top", "rod", "base", "filt", "avg", "mean", "max", "pk", "rms", "ai", "ao",
    "di", "do", "old", "new", "model", "gauge", "roh", "head", "est", "pos",
];
/// Entries in the place of a unit that mean no unit. TwinCAT Scope writes `(None)`.
const NO_UNIT: [&str; 8] = ["none", "n/a", "na", "null", "keine", "unitless", "no unit", "?"];
/// Names of lengths: only after these is the ending `_in` a unit (inch).
const LENGTHS: [&str; 8] =
    ["stroke", "position", "length", "displacement", "extension", "travel", "x", "xcyl"];

impl Heading {
    /// Parses a heading with its unit in any common form: `p_A_bar`, `p_A [bar]`, `p_A (bar)`, `p_A / bar`, `p_A, bar`,
    /// `p_A in bar`. Endings that belong to the name are no units: `p_PA`, `pressure_1`, `x (1)`, `p_min`.
    pub fn parse(text: &str) -> Self {
        let text = text.trim().trim_matches('"').trim();
        bracketed(text)
            .or_else(|| after_slash(text))
            .or_else(|| after_word(text))
            .or_else(|| ending(text))
            .unwrap_or_else(|| Self { name: text.into(), ..Self::default() })
    }

    /// A heading whose unit is stated elsewhere, in a row of units or a field of the file. If `unit` is empty, the
    /// heading's own unit applies.
    pub fn with_unit(text: &str, unit: &str) -> Self {
        let heading = Self::parse(text);
        let unit = unit.trim().trim_start_matches('#').trim();
        let inside = unit.trim_matches(['[', ']', '(', ')', '"', ' ']).to_lowercase();
        if inside.is_empty() || NO_UNIT.contains(&inside.as_str()) {
            return heading;
        }
        match Unit::find(unit) {
            Some(known) => Self { unit: Some(known), unknown_unit: None, ..heading },
            None => {
                Self { unit: None, unknown_unit: Some(unit.chars().take(40).collect()), ..heading }
            }
        }
    }

    /// Whether the name is a usual name of a time.
    pub(crate) fn is_named_as_time(&self) -> bool {
        TIMES.contains(&self.name.to_lowercase().as_str())
            && self.unit.is_none_or(|u| u.dimension == Dimension::Time)
    }

    fn known(name: &str, unit: Unit) -> Self {
        let name = name.trim().trim_end_matches(['_', ':', ',']).trim();
        Self { name: name.into(), unit: Some(unit), unknown_unit: None }
    }

    fn unknown(name: &str, unit: &str) -> Self {
        let name = name.trim().trim_end_matches('_').trim();
        let unit = unit.trim().chars().take(40).collect();
        Self { name: name.into(), unit: None, unknown_unit: Some(unit) }
    }
}

/// `x [unit]`, `x (unit)`.
fn bracketed(text: &str) -> Option<Heading> {
    let (open, close) = [('[', ']'), ('(', ')')].into_iter().find(|(_, c)| text.ends_with(*c))?;
    let inside_from = opening(text, open, close)?;
    let (before, inside) = (&text[..inside_from], &text[inside_from + 1..text.len() - 1]);
    // an index, as in `aAxis[8]`, `x (1)`
    if before.trim().is_empty() || inside.trim().is_empty() || inside.trim().parse::<f64>().is_ok()
    {
        return None;
    }
    // in `p_A bar (abs)` only the text in brackets is examined
    let is_letter = inside.trim().len() == 1;
    match Unit::find(inside) {
        // `Pressure (A)` names a side of the cylinder
        Some(unit) if !(open == '(' && is_letter && unit.dimension == Dimension::Current) => {
            Some(Heading::known(before, unit))
        }
        _ if is_word(inside, open == '[') => Some(Heading::unknown(before, inside)),
        _ => None,
    }
}

/// Position of the opening bracket that matches the closing one at the end.
fn opening(text: &str, open: char, close: char) -> Option<usize> {
    let mut depth = 0_usize;
    for (k, c) in text.char_indices().rev() {
        if c == close {
            depth += 1;
        } else if c == open {
            depth -= 1;
            if depth == 0 {
                return Some(k);
            }
        }
    }
    None
}

/// Whether a text in the place of a unit is meant as a unit.
fn is_word(text: &str, is_surely: bool) -> bool {
    let small = text.trim().to_lowercase();
    let has_letter = small.chars().any(char::is_alphabetic);
    let is_short = small.chars().count() <= if is_surely { 16 } else { 8 };
    let is_remark = REMARKS.contains(&small.as_str())
        || NO_UNIT.contains(&small.as_str())
        || small.chars().count() < 2;
    has_letter
        && is_short
        && !is_remark
        && !small.contains(char::is_whitespace)
        && !small.contains('_')
}

/// `x / unit`, and `x/unit` unless it is a path.
fn after_slash(text: &str) -> Option<Heading> {
    for (k, _) in text.match_indices('/') {
        let (before, after) = (&text[..k], &text[k + 1..]);
        let is_spaced = before.ends_with(' ') || after.starts_with(' ');
        if before.trim().is_empty() || after.trim().is_empty() {
            continue;
        }
        // `cylinder/A`, `plant/p/N` are paths
        let is_letter = after.trim().len() == 1 && !matches!(after.trim(), "s" | "m" | "V");
        if let Some(unit) = Unit::find(after)
            && (is_spaced || !is_letter)
            && after.trim().parse::<f64>().is_err()
            && Unit::find(&format!("{}/{}", before.rsplit(['_', ' ']).next().unwrap_or(""), after))
                .is_none()
        {
            return Some(Heading::known(before, unit));
        }
    }
    let (before, after) = text.rsplit_once(" / ")?;
    (!before.contains('/') && is_word(after, true)).then(|| Heading::unknown(before, after))
}

/// `x, unit`, `x in unit`.
fn after_word(text: &str) -> Option<Heading> {
    let (before, after) = text.rsplit_once(" in ").or_else(|| text.rsplit_once(','))?;
    let unit = Unit::find(after).filter(|_| after.trim().parse::<f64>().is_err())?;
    (!before.trim().is_empty()).then(|| Heading::known(before, unit))
}

/// `x_unit`, also of several words: `v_mm_s`, `flow_l_per_min`.
fn ending(text: &str) -> Option<Heading> {
    if text.ends_with([')', ']']) {
        return None;
    }
    let words: Vec<&str> = text.split(['_', ' ']).collect();
    for count in (1..=3).rev().filter(|count| *count < words.len()) {
        let (rest, last) = words.split_at(words.len() - count);
        let length: usize = last.iter().map(|w| w.len() + 1).sum();
        let name = text[..text.len() - length].trim_end_matches(['_', ' ']);
        let last: Vec<&str> = last.iter().copied().filter(|w| *w != "per" || count == 1).collect();
        let together = [last.join("/"), last.concat()];
        let unit = match last.as_slice() {
            [one] => Unit::find(one).filter(|unit| is_ending(one, *unit, name)),
            _ if count == 1 || last.iter().any(|w| w.is_empty()) => None,
            _ => together.iter().find_map(|spelled| Unit::find(spelled)).filter(|unit| {
                // `bar_abs`, `deg_s`; a part that is not a unit by itself belongs to the name
                !matches!(unit.dimension, Dimension::Share | Dimension::Mass)
            }),
        };
        if let Some(unit) = unit
            && rest.iter().any(|w| !w.is_empty())
        {
            return Some(Heading::known(name, unit));
        }
    }
    None
}

/// Whether the last word of a name is its unit, where it may also be a part of the name.
fn is_ending(word: &str, unit: Unit, name: &str) -> bool {
    let small: String =
        name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect();
    let is_symbol = small.chars().count() == 1;
    match word {
        // `_in` after other names means inlet, `_min` minimum, `_a` a chamber
        "in" | "ft" => LENGTHS.iter().any(|length| small.ends_with(length)),
        "min" | "h" | "d" | "std" => TIMES.iter().any(|time| small.ends_with(time)),
        "a" | "n" | "k" | "w" | "PA" | "at" | "C" | "c" | "F" | "f" | "K" | "A" | "N" | "W"
        | "g" | "t" | "T" | "L" | "l" | "ps" | "PS" | "rev" | "turn" => false,
        "pa" => small != "p",
        "Pa" | "mm" | "bar" => true,
        "s" => !is_symbol || small == "t",
        "m" => !is_symbol || matches!(small.as_str(), "x" | "y" | "z" | "s" | "l"),
        "v" | "V" => !is_symbol || small == "u",
        _ => word.chars().any(|c| c.is_alphabetic() || c == '%' || c == '°') && unit.name != "-",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_found_in_every_form_of_heading() {
        for (text, name, unit) in [
            ("pressure_a_bar", "pressure_a", Some("bar")),
            ("p_A [bar]", "p_A", Some("bar")),
            ("p_A (MPa)", "p_A", Some("MPa")),
            ("p_A [bar (abs)]", "p_A", Some("bar abs")),
            ("\"p_A (bar)\"", "p_A", Some("bar")),
            ("velocity_mm_s", "velocity", Some("mm/s")),
            ("velocity_mm/s", "velocity", Some("mm/s")),
            ("v / mm/s", "v", Some("mm/s")),
            ("t/s", "t", Some("s")),
            ("t / ms", "t", Some("ms")),
            ("motor speed / rpm", "motor speed", Some("rpm")),
            ("n / 1/min", "n", Some("rpm")),
            ("pressure_a / MPa", "pressure_a", Some("MPa")),
            ("Druck A in bar", "Druck A", Some("bar")),
            ("Pressure A, psi", "Pressure A", Some("psi")),
            ("motor_speed_rpm", "motor_speed", Some("rpm")),
            ("motor_speed_rad_s", "motor_speed", Some("rad/s")),
            ("motor_speed_1/min", "motor_speed", Some("rpm")),
            ("flow_l_min", "flow", Some("L/min")),
            ("flow_l_per_min", "flow", Some("L/min")),
            ("pressure_bar_abs", "pressure", Some("bar abs")),
            ("stroke_mm", "stroke", Some("mm")),
            ("stroke [in]", "stroke", Some("in")),
            ("stroke_in", "stroke", Some("in")),
            ("command_percent", "command", Some("%")),
            ("valve [-]", "valve", Some("-")),
            ("t_s", "t", Some("s")),
            ("time_min", "time", Some("min")),
            ("time [µs]", "time", Some("us")),
            ("timestamp_us", "timestamp", Some("us")),
            ("x_m", "x", Some("m")),
            ("u_V", "u", Some("V")),
            ("pressure_a_Pa", "pressure_a", Some("Pa")),
            ("pressure_a_pa", "pressure_a", Some("Pa")),
        ] {
            let found = Heading::parse(text);
            assert_eq!((found.name.as_str(), found.unit.map(|u| u.name)), (name, unit), "{text}");
            assert_eq!(found.unknown_unit, None, "{text}");
        }
    }

    #[test]
    fn a_part_of_a_name_is_not_taken_for_a_unit() {
        for name in [
            "time",
            "p_A",
            "p_PA",
            "p_pa",
            "p_PB",
            "p_B",
            "p_s",
            "p_m",
            "n_s",
            "x_cyl",
            "pressure_1",
            "pressure_a",
            "pressure_b",
            "x (1)",
            "x [1]",
            "aAxis[8]",
            "pressure_min",
            "pressure_in",
            "Q_in",
            "MAIN.fPressure",
            "Pressure (A)",
            "p (raw)",
            "cylinder/A",
            "plant/cylinder/p",
            "p (filtered by hand)",
            "[bar]",
            "_bar",
            "bar",
            "",
            "(",
            ")",
            "]",
            "[]",
            "x []",
            "motor_speed_1",
            "GVL.aPressure[1]",
        ] {
            let found = Heading::parse(name);
            assert_eq!((found.unit, found.unknown_unit), (None, None), "{name}");
            assert_eq!(found.name, name);
        }
    }

    #[test]
    fn an_unknown_stated_unit_is_kept_as_text() {
        for (text, name, unit) in [
            ("p_A [barr]", "p_A", "barr"),
            ("p_A (kpsi)", "p_A", "kpsi"),
            ("stroke / furlong", "stroke", "furlong"),
        ] {
            let found = Heading::parse(text);
            assert_eq!((found.name.as_str(), found.unknown_unit.as_deref()), (name, Some(unit)));
            assert_eq!(found.unit, None);
        }
        let below = Heading::with_unit("MAIN.fPa", "MPa (Pressure)");
        assert_eq!(below.unit.map(|u| u.name), Some("MPa"));
        assert_eq!(Heading::with_unit("p_A", "foo").unknown_unit.as_deref(), Some("foo"));
        let none = Heading::with_unit("bValve", "(None)");
        assert_eq!((none.unit, none.unknown_unit), (None, None));
        assert_eq!(Heading::with_unit("p_A_bar", "[]").unit.map(|u| u.name), Some("bar"));
    }
}
