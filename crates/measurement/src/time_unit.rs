//! Unit of a time: stated, or determined from its numbers.

use crate::dimension::Dimension;
use crate::heading::Heading;
use crate::time_column::TimeColumn;
use crate::unit::Unit;

/// Times above this are relative to a distant origin, and are output relative to the first one \[s\].
pub(crate) const FAR: f64 = 1e7;
pub(crate) const DAY: f64 = 86_400.0;
/// Seconds since 1970 of the years 1990 to 2100.
const EPOCH: std::ops::Range<f64> = 6.3e8..4.2e9;
/// Days of MATLAB's datenum in about the same years.
const DATENUM: std::ops::Range<f64> = 7.2e5..7.7e5;
/// Days of a spreadsheet's dates in about the same years.
const SPREADSHEET: std::ops::Range<f64> = 3.2e4..7.4e4;
/// Largest row interval of a machine's log \[s\].
const LONGEST: f64 = 0.5;

/// Size of one unit of a time's numbers \[s\], with a remark if it is assumed. Sources in order of priority: mapping,
/// format (`own`), heading, and last the first number with the usual interval.
///
/// # Errors
///
/// Reason and remedy: a unit that is unknown or not of a time, or numbers that leave the unit undetermined.
pub(crate) fn resolve(
    heading: &str,
    read: &Heading,
    stated: Option<&TimeColumn>,
    own: Option<f64>,
    first: f64,
    interval: Option<f64>,
) -> Result<(f64, Option<String>), String> {
    let state = "state it in a mapping: [log.time] column = \"...\", unit = \"...\"";
    let of_time = |unit: Unit| match unit.dimension {
        Dimension::Time => Ok((unit.factor, None)),
        other => Err(format!(
            "the time \"{heading}\": {} is {}, not a time; {state}",
            unit.name,
            other.words()
        )),
    };
    if let Some(unit) = stated.and_then(|s| s.unit) {
        return of_time(unit);
    }
    if let Some(factor) = own {
        return Ok((factor, None));
    }
    if let Some(text) = &read.unknown_unit {
        let error = Unit::of_dimension(text, Dimension::Time).err();
        let error = error.map_or_else(String::new, |e| e.to_string());
        return Err(format!("the time \"{heading}\": {error}; {state}"));
    }
    if let Some(unit) = read.unit {
        return of_time(unit);
    }
    // a stated factor converts to seconds
    if stated.is_some_and(|s| s.scale != 1.0) {
        return Ok((1.0, None));
    }
    let interval = interval.unwrap_or(1.0);
    let is_days = read.name.to_lowercase().contains("datenum");
    let found = match is_days {
        true => Some((DAY, "days, MATLAB's datenum")),
        false => by_content(first, interval),
    };
    let (factor, what) = found.ok_or_else(|| {
        format!(
            "the time \"{heading}\" has no unit, and begins with {first:?}: neither seconds nor milli-, micro- or nanoseconds since 1970, nor days; {state}"
        )
    })?;
    let remark = format!(
        "the time \"{heading}\" has no unit: taken as {what}, its steps being {:.6} ms",
        interval * factor * 1e3
    );
    Ok((factor, Some(remark)))
}

/// Size of one unit \[s\], from the first number and the usual interval.
fn by_content(first: f64, interval: f64) -> Option<(f64, &'static str)> {
    let is_fine = |factor: f64| interval * factor <= 10.0;
    for (factor, what) in [
        (1.0, "seconds since 1970"),
        (1e-3, "milliseconds since 1970"),
        (1e-6, "microseconds since 1970"),
        (1e-9, "nanoseconds since 1970"),
    ] {
        if EPOCH.contains(&(first * factor)) && is_fine(factor) {
            return Some((factor, what));
        }
    }
    // as seconds such steps would be below a tenth of a millisecond: the numbers are days
    let is_days = interval < 1e-4;
    if is_days && DATENUM.contains(&first) {
        return Some((DAY, "days, MATLAB's datenum"));
    }
    if is_days && SPREADSHEET.contains(&first) {
        return Some((DAY, "days, a spreadsheet's date"));
    }
    if first.abs() > 1e12 {
        return None;
    }
    let is_whole = first.fract() == 0.0 && interval.fract() == 0.0 && interval > 1.0;
    match interval {
        step if step <= LONGEST || !is_whole => Some((1.0, "s")),
        step if step * 1e-3 <= LONGEST => Some((1e-3, "ms")),
        step if step * 1e-6 <= LONGEST => Some((1e-6, "us")),
        _ => Some((1e-9, "ns")),
    }
}

/// Median of the positive steps.
pub(crate) fn interval(numbers: &[f64]) -> Option<f64> {
    let steps = numbers.windows(2).map(|w| w[1] - w[0]);
    let mut steps: Vec<f64> = steps.filter(|step| *step > 0.0).collect();
    if steps.is_empty() {
        return None;
    }
    let middle = steps.len() / 2;
    Some(*steps.select_nth_unstable_by(middle, f64::total_cmp).1)
}
