//! Numbers on the command line: finite and within stated ranges.

use hydroboom_description::Description;
use miette::{Result, miette};
use std::ops::RangeInclusive;

/// Speeds of a motion \[mm/s\]. A crane's own limit depends on the motion's length and ramp.
pub const SPEED: RangeInclusive<f64> = 0.1..=10_000.0;
/// Piston positions \[mm\] of any crane.
pub const STROKE: RangeInclusive<f64> = 0.0..=20_000.0;
/// Speeds of a motor \[rpm\].
pub const MOTOR_SPEED: RangeInclusive<f64> = -20_000.0..=20_000.0;
/// Time steps of a simulation \[us\].
pub const STEP: RangeInclusive<f64> = 0.1..=100_000.0;
/// Intervals between rows of a log \[ms\].
pub const LOG_INTERVAL: RangeInclusive<f64> = 0.001..=3_600_000.0;
/// Durations of a simulation \[s\]: up to four months.
pub const DURATION: RangeInclusive<f64> = 1e-3..=1e7;
/// Standard deviations of a surveyed coordinate \[mm\].
pub const SURVEY_NOISE: RangeInclusive<f64> = 1e-3..=100.0;
/// Times of a log \[s\] with any origin.
pub const LOG_TIME: RangeInclusive<f64> = -1e12..=1e12;

/// Parser of a number within a range, both in `unit`. It refuses text that is no number, NaN, and numbers outside.
pub fn within(
    range: RangeInclusive<f64>,
    unit: &'static str,
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync + 'static {
    move |text| {
        let number = text.trim().parse::<f64>().ok().filter(|number| range.contains(number));
        let (low, high) = (range.start(), range.end());
        number.ok_or_else(|| format!("it is a number from {low} to {high} {unit}"))
    }
}

/// Speed of a crane's motion \[m/s\]: the requested one \[mm/s\], or the fast one.
///
/// # Errors
///
/// If the motion is too short to reach the speed: with the length L and the ramp T that is more than L/T.
pub fn speed_of_motion(crane: &Description, requested: Option<f64>) -> Result<f64> {
    let n = &crane.numbers;
    let Some(requested) = requested else { return Ok(n.fast) };
    let largest = 1e3 * (n.motion_end - n.motion_start).abs() / n.ramp;
    match requested <= largest {
        true => Ok(requested * 1e-3),
        false => Err(miette!(
            help = "the motion's length and ramp are in the crane file, [motion]",
            "--speed-mm-s is {} to {largest:.0} for this motion, not {requested}",
            SPEED.start()
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_finite_and_within_their_range() {
        let read = within(SPEED, "mm/s");
        assert_eq!(read("25"), Ok(25.0));
        assert_eq!(read(" 1e2 "), Ok(100.0));
        for wrong in ["nan", "NaN", "inf", "-inf", "1e300", "1e999", "-25", "0", "fast", ""] {
            let message = read(wrong).unwrap_err();
            assert!(message.contains("0.1 to 10000 mm/s"), "{wrong}: {message}");
        }
    }
}
