//! Cells of a table of results: numbers as text, and where they are in the JSON of a command.

use serde_json::Value;

/// Head of a table, and its rows.
pub type Rows = Vec<Vec<String>>;

/// One row of a table.
pub fn row<const N: usize>(cells: [&str; N]) -> Vec<String> {
    cells.map(String::from).into()
}

/// Number of a JSON value.
pub fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

/// Number with a fixed count of decimals.
pub fn fixed(value: &Value, decimals: usize) -> String {
    format!("{:.decimals$}", number(value))
}

/// Number with so many significant digits and at most six decimals; below 1e-6 it is zero.
pub fn significant(value: f64, digits: i32) -> String {
    if value.abs() < 1e-6 {
        return "0".into();
    }
    let unit = 10_f64.powi((value.abs().log10().floor() as i32 + 1 - digits).max(-6));
    let decimals = (-unit.log10().round()).max(0.0) as usize;
    format!("{:.decimals$}", (value / unit).round() * unit)
}

/// Number of two significant digits, with an exponent where it is small.
pub fn two_digits(value: f64) -> String {
    if value < 0.01 { format!("{value:.1e}") } else { significant(value, 2) }
}

/// The only entry of an array with these values of keys.
pub fn entry<'a>(entries: &'a Value, wanted: &[(&str, Value)]) -> &'a Value {
    let is = |entry: &&Value| wanted.iter().all(|(key, value)| entry[*key] == *value);
    let found: Vec<&Value> = entries.as_array().unwrap().iter().filter(is).collect();
    let [only] = found[..] else { panic!("{} entries with {wanted:?}", found.len()) };
    only
}

/// Numbers with a comma between them.
pub fn listed(values: &[&Value], decimals: usize) -> String {
    values.iter().map(|value| fixed(value, decimals)).collect::<Vec<_>>().join(", ")
}
