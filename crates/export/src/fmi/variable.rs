//! Variables of an FMU, with their attributes and as tables in C.

use super::Version;
use super::bounds::{self, Bounds};
use crate::block::{Block, Variable};
use crate::statement::{entry, grouped};
use std::fmt::Write;

/// A variable of an FMU.
pub(super) struct Row<'a> {
    pub(super) name: String,
    /// Value reference: the count of numbers before it.
    pub(super) reference: usize,
    /// Count of its numbers: one, or the length of an array, supported by FMI 3.0.
    pub(super) count: usize,
    pub(super) causality: &'static str,
    pub(super) variability: &'static str,
    pub(super) initial: Option<&'static str>,
    /// For the rate of a state: the reference of that state.
    pub(super) rate_of: Option<usize>,
    pub(super) bounds: Bounds,
    pub(super) variable: &'a Variable,
}

impl Row<'_> {
    /// Attributes of both versions, in the order of the standard.
    pub(super) fn attributes(&self) -> String {
        let initial = self.initial.map_or(String::new(), |i| format!(" initial=\"{i}\""));
        format!(
            "name=\"{}\" valueReference=\"{}\" description=\"{}\" causality=\"{}\" variability=\"{}\"{initial}",
            escaped(&self.name),
            self.reference,
            escaped(&self.variable.meaning),
            self.causality,
            self.variability
        )
    }

    /// Unit, range, nominal value and start value.
    pub(super) fn values(&self) -> String {
        let unit = match (self.variable.unit.as_str(), display(&self.variable.unit)) {
            ("" | "-" | "1", _) => String::new(),
            (unit, None) => format!(" unit=\"{}\"", escaped(unit)),
            (unit, Some((shown, _))) => {
                format!(" unit=\"{}\" displayUnit=\"{shown}\"", escaped(unit))
            }
        };
        let mut text = unit;
        let Bounds { low, high, nominal } = self.bounds;
        for (name, value) in [("min", low), ("max", high), ("nominal", Some(nominal))] {
            if let Some(value) = value {
                let _ = write!(text, " {name}=\"{value:?}\"");
            }
        }
        match self.initial {
            Some("calculated") => text,
            _ => {
                let start = vec![format!("{:?}", self.variable.initial); self.count];
                format!("{text} start=\"{}\"", start.join(" "))
            }
        }
    }
}

/// The states that an FMU shows: a state may have the name of an output; states of an estimator are internal.
pub(super) fn shown<'s, 'a>(states: &'s [&'a Variable]) -> &'s [&'a Variable] {
    match states.iter().any(|v| entry(&v.name).is_some()) {
        true => &[],
        false => states,
    }
}

/// The variables of an FMU in the order of their value references, and the number of those that can be set, which
/// come first. `longest_step` \[s\] bounds the step of a model.
pub(super) fn variables<'a>(
    block: &'a Block,
    slopes: Option<&'a Block>,
    [parameters, inputs, states]: [&[&'a Variable]; 3],
    longest_step: f64,
    version: Version,
) -> (Vec<Row<'a>>, usize) {
    let row = |causality, variability, initial, name: String, variable, bounds| Row {
        name,
        reference: 0,
        count: 1,
        causality,
        variability,
        initial,
        rate_of: None,
        bounds,
        variable,
    };
    let mut rows: Vec<Row<'a>> = Vec::new();
    let (tunable, continuous, exact) = ("tunable", "continuous", Some("exact"));
    rows.extend(
        parameters
            .iter()
            .map(|v| row("parameter", tunable, exact, v.name.clone(), *v, bounds::of_parameter(v))),
    );
    for (table, range) in grouped(inputs.iter().map(|v| v.name.as_str())) {
        let v = inputs[range.start];
        let bounds = bounds::of_input(v, longest_step);
        let input = |name: String| row("input", continuous, None, name, v, bounds);
        match (table, version) {
            (None, _) if v.name == "step" => {
                rows.push(row("parameter", tunable, exact, v.name.clone(), v, bounds));
            }
            (None, _) => rows.push(input(v.name.clone())),
            (Some(table), Version::Three) => {
                rows.push(Row { count: range.len(), ..input(table) });
            }
            // FMI 2.0 has no arrays: structured names with indices from one
            (Some(table), Version::Two) => {
                rows.extend((1..=range.len()).map(|k| input(format!("{table}[{k}]"))));
            }
        }
    }
    rows.extend(shown(states).iter().map(|v| {
        row("local", continuous, exact, format!("state_{}", v.name), *v, bounds::of_state(v))
    }));
    let settable = rows.len();
    let calculated = Some("calculated");
    rows.extend(
        block.outputs.iter().map(|v| {
            row("output", continuous, calculated, v.name.clone(), v, bounds::of_output(v))
        }),
    );
    let first_state = parameters.len() + inputs.len();
    // the first outputs of the slopes are the rates, one for each state
    rows.extend(slopes.into_iter().flat_map(|s| &s.outputs[..states.len()]).enumerate().map(
        |(k, v)| {
            let bounds = bounds::of_output(v);
            let rate_of = Some(first_state + k);
            Row { rate_of, ..row("local", continuous, calculated, v.name.clone(), v, bounds) }
        },
    ));
    let mut reference = 0;
    for row in &mut rows {
        row.reference = reference;
        reference += row.count;
    }
    (rows, settable)
}

/// Usual display unit, and its size relative to the SI unit.
pub(super) fn display(unit: &str) -> Option<(&'static str, f64)> {
    const SHOWN: [(&str, &str, f64); 7] = [
        ("Pa", "bar", 1e-5),
        ("m", "mm", 1e3),
        ("m/s", "mm/s", 1e3),
        ("rev/s", "rpm", 60.0),
        ("rad", "deg", 180.0 / std::f64::consts::PI),
        ("N", "kN", 1e-3),
        ("m3", "L", 1e3),
    ];
    SHOWN.iter().find(|(own, ..)| *own == unit).map(|(_, shown, factor)| (*shown, *factor))
}

/// Escapes text for an XML attribute.
pub(super) fn escaped(text: &str) -> String {
    let mut safe = String::new();
    for c in text.chars() {
        match c {
            '&' => safe += "&amp;",
            '<' => safe += "&lt;",
            '>' => safe += "&gt;",
            '"' => safe += "&quot;",
            // characters that XML 1.0 does not allow
            c if (c as u32) < 32 || matches!(c, '\u{fffe}' | '\u{ffff}') => safe.push(' '),
            c => safe.push(c),
        }
    }
    safe
}

/// Ranges of the settable variables, as a table in C.
pub(super) fn bounds_of(rows: &[Row<'_>]) -> String {
    let of = |row: &Row<'_>| {
        let Bounds { low, high, nominal } = row.bounds;
        let (low, high) = (low.unwrap_or(-f64::MAX), high.unwrap_or(f64::MAX));
        format!("    {{ \"{}\", {low:?}, {high:?}, {nominal:?} }},\n", row.name)
    };
    rows.iter().flat_map(|row| std::iter::repeat_n(row, row.count)).map(of).collect()
}

/// The variables that are arrays, as a table in C.
pub(super) fn arrays_of(rows: &[Row<'_>]) -> String {
    let arrays = rows.iter().filter(|row| row.count > 1);
    arrays.map(|row| format!("    {{ {}u, {}u }},\n", row.reference, row.count)).collect()
}
