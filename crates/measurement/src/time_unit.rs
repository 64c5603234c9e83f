//! What a time counts that has no unit, judged by its numbers.

/// Times that are larger are counted from something far away, and are shown from the first one on \[s\].
pub(crate) const FAR: f64 = 1e7;
pub(crate) const DAY: f64 = 86_400.0;
/// Seconds since 1970 of the years 1990 to 2100.
const EPOCH: std::ops::Range<f64> = 6.3e8..4.2e9;
/// Days of MATLAB's datenum of about the same years.
const DATENUM: std::ops::Range<f64> = 7.2e5..7.7e5;
/// Days of a spreadsheet's dates of about the same years.
const SPREADSHEET: std::ops::Range<f64> = 3.2e4..7.4e4;
/// Intervals of rows that logs of machines have, at most \[s\].
const LONGEST: f64 = 0.5;

/// What numbers count \[s\], from the first one and their usual interval.
pub(crate) fn by_content(first: f64, interval: f64) -> Option<(f64, &'static str)> {
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
    // days whose steps would be below a tenth of a millisecond if they were seconds
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

/// The median of the steps that go on.
pub(crate) fn interval(numbers: &[f64]) -> Option<f64> {
    let steps = numbers.windows(2).map(|w| w[1] - w[0]);
    let mut steps: Vec<f64> = steps.filter(|step| *step > 0.0).collect();
    if steps.is_empty() {
        return None;
    }
    let middle = steps.len() / 2;
    Some(*steps.select_nth_unstable_by(middle, f64::total_cmp).1)
}
