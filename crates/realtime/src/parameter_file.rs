//! File of the state estimator's parameters with their covariance: written at the end of a run, read at the
//! next start.
//!
//! A file is refused if it belongs to another crane, a number is out of range, or the covariance is
//! invalid. It is also refused if a parameter contradicts the crane file: the difference exceeds three
//! standard deviations of both together.

use hydroboom_control::estimation::drive_identification::DriveLag;
use hydroboom_control::estimation::retained_parameters::RetainedParameters;
use hydroboom_description::Description;
use hydroboom_design::DesignError;
use hydroboom_design::scheduled_lqr::{designed, known_delay};
use hydroboom_files::{FileError, own_text};
use serde_json::{Value, json};
use std::path::Path;
use thiserror::Error;

const BAR: f64 = 1e5;
const RPM: f64 = 1.0 / 60.0;
const MS: f64 = 1e-3;
/// Difference between parameter file and crane file in standard deviations above which they contradict each
/// other.
const CONTRADICTION: f64 = 3.0;

/// Longest file that is read \[B\].
const LONGEST: u64 = 1_000_000;

/// Reason why a parameter file cannot be used.
#[derive(Debug, Error)]
pub enum ParameterFileError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file is not a parameter file, belongs to another crane, or has invalid numbers.
    #[error("{path}: {reason}")]
    Other {
        /// Its path.
        path: String,
        /// Reason, and what to do.
        reason: String,
    },
    /// There is no estimator for this crane.
    #[error(transparent)]
    Design(#[from] DesignError),
}

/// Text of a parameter file in JSON, for the crane that `model` describes.
pub fn text(model: &Description, parameters: &RetainedParameters<f64>) -> String {
    let period = model.numbers.control_period;
    let (flow, transition) =
        (parameters.flow_variance.sqrt(), parameters.transition_variance.sqrt());
    let both = parameters.flow_transition_covariance;
    let drive =
        DriveLag { coefficient: parameters.drive_coefficient, variance: parameters.drive_variance };
    let lag = drive.time_constant(period);
    // dτ/dg = τ²/(T (1 − g))
    let slope = lag.powi(2) / (period * (1.0 - drive.coefficient));
    let value = json!({
        "unknown_flow_rpm": parameters.unknown_flow / RPM,
        "unknown_flow_deviation_rpm": flow / RPM,
        "transition_pressure_bar": parameters.transition_pressure / BAR,
        "transition_pressure_deviation_bar": transition / BAR,
        // zero if one of both is exact
        "flow_transition_correlation": if flow * transition > 0.0 { both / (flow * transition) } else { 0.0 },
        "drive_lag_ms": lag / MS,
        "drive_lag_deviation_ms": drive.variance.sqrt() * slope / MS,
        "crane_digest": model.digest(),
    });
    format!("{value:#}\n")
}

/// Parameters in one line of text: transition pressure \[bar\] and unknown flow \[rpm\], each with two standard
/// deviations, and the time constant of the drive's lag \[ms\].
pub fn summary(model: &Description, parameters: &RetainedParameters<f64>) -> String {
    let drive =
        DriveLag { coefficient: parameters.drive_coefficient, variance: parameters.drive_variance };
    format!(
        "transition pressure {:.1} +- {:.1} bar, unknown flow {:.1} +- {:.1} rpm, drive lag {:.1} ms",
        parameters.transition_pressure / BAR,
        2.0 * parameters.transition_variance.sqrt() / BAR,
        parameters.unknown_flow / RPM,
        2.0 * parameters.flow_variance.sqrt() / RPM,
        drive.time_constant(model.numbers.control_period) / MS
    )
}

/// Reads a parameter file of the crane that `model` describes.
///
/// Unknown flow, transition pressure and drive lag lie within the ranges of the crane file's tuning, the correlation
/// within −1 to 1. Flow and transition pressure differ from the crane file by at most three standard deviations
/// √(σ_file² + σ_initial²).
///
/// # Errors
///
/// - [`ParameterFileError::File`] if the file cannot be read.
/// - [`ParameterFileError::Other`] if it is no parameter file, belongs to another crane, or a number is missing, out
///   of range or contradicts the crane file.
/// - [`ParameterFileError::Design`] if there is no estimator for this crane.
pub fn read(
    model: &Description,
    path: &Path,
) -> Result<RetainedParameters<f64>, ParameterFileError> {
    let name = path.display().to_string();
    let text = own_text(path, "file of parameters", LONGEST)?;
    let other = |reason: String| ParameterFileError::Other { path: name.clone(), reason };
    let value: Value = serde_json::from_str(&text)
        .map_err(|error| other(format!("not a file of `hydroboom run --parameters`: {error}")))?;
    if value["crane_digest"].as_str() != Some(&model.digest()) {
        return Err(other(format!(
            "it belongs to another crane file than \"{}\", or to other overrides: delete it, and the next run \
             writes a new one",
            model.name
        )));
    }
    let (estimator, _) = designed(model, known_delay(model) as usize)?;
    let (filter, n) = (&estimator.filter, &model.numbers);
    let largest_flow = n.tuning.estimator_largest_flow * n.motor_speed / RPM;
    let [least_lag, most_lag] =
        [n.tuning.estimator_shortest_drive_lag, n.tuning.estimator_longest_drive_lag];
    let initial = &filter.initial_deviation;
    let number = |key: &str, low: f64, high: f64| {
        let read = &value[key];
        // tolerates the rounding of a limit that was written in another unit
        let rounded = 1e-9 * low.abs().max(high.abs());
        match read.as_f64().filter(|n| (low - rounded..=high + rounded).contains(n)) {
            Some(number) => Ok(number),
            None if read.is_null() => Err(other(format!("{key} is missing"))),
            None => Err(other(format!("{key} is {read}; it is a number from {low} to {high}"))),
        }
    };
    let flow = number("unknown_flow_rpm", -largest_flow, largest_flow)? * RPM;
    let flow_deviation = number("unknown_flow_deviation_rpm", 0.0, 1e5)? * RPM;
    let [lowest, highest] =
        [n.tuning.estimator_lowest_transition, n.tuning.estimator_highest_transition];
    let transition = number("transition_pressure_bar", lowest / BAR, highest / BAR)? * BAR;
    let transition_deviation = number("transition_pressure_deviation_bar", 0.0, 1e4)? * BAR;
    let correlation = number("flow_transition_correlation", -1.0, 1.0)?;
    let lag = number("drive_lag_ms", least_lag / MS, most_lag / MS)? * MS;
    let lag_deviation = number("drive_lag_deviation_ms", 0.0, 1e5)? * MS;
    for (what, unit, size, off, deviations) in [
        ("unknown_flow", "rpm", RPM, flow, [flow_deviation, initial.unknown_flow]),
        (
            "transition_pressure",
            "bar",
            BAR,
            transition - filter.model.oil.transition_pressure,
            [transition_deviation, initial.transition_pressure],
        ),
    ] {
        let expected = deviations[0].hypot(deviations[1]);
        if off.abs() > CONTRADICTION * expected {
            return Err(other(format!(
                "{what} is {:.1} {unit} off the crane file's value; {CONTRADICTION} standard deviations of both \
                 are {:.1} {unit}. Check oil, pump and crane file, or delete the file to begin anew",
                off / size,
                CONTRADICTION * expected / size
            )));
        }
    }
    let both = correlation * flow_deviation * transition_deviation;
    let period = n.control_period;
    let coefficient = 1.0 - (-period / lag).exp();
    let slope = period * (1.0 - coefficient) / lag.powi(2);
    Ok(RetainedParameters {
        unknown_flow: flow,
        transition_pressure: transition,
        flow_variance: flow_deviation.powi(2),
        flow_transition_covariance: both,
        transition_variance: transition_deviation.powi(2),
        drive_coefficient: coefficient,
        drive_variance: (lag_deviation * slope).powi(2),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lockstep::Lockstep;
    use crate::operator::Operator;
    use hydroboom_control::strategy::Strategy;

    fn parameters() -> RetainedParameters<f64> {
        RetainedParameters {
            unknown_flow: 0.2,
            transition_pressure: 30e5,
            flow_variance: 0.01,
            flow_transition_covariance: 2e3,
            transition_variance: 4e10,
            drive_coefficient: 0.2,
            drive_variance: 1e-4,
        }
    }

    fn read_back(change: impl Fn(&str) -> String) -> Result<RetainedParameters<f64>, String> {
        static NUMBER: std::sync::atomic::AtomicU32 = std::sync::atomic::AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        let model = Description::uia_single_boom().unwrap();
        let path = std::env::temp_dir().join(format!("parameters-{}-{number}", std::process::id()));
        std::fs::write(&path, change(&text(&model, &parameters()))).unwrap();
        let found = read(&model, &path).map_err(|error| error.to_string());
        std::fs::remove_file(&path).unwrap();
        found
    }

    #[test]
    fn written_parameters_are_read_back() {
        let (found, expected) = (read_back(str::to_string).unwrap(), parameters());
        let pairs = found.to_array().into_iter().zip(expected.to_array());
        for (a, b) in pairs {
            assert!((a / b - 1.0).abs() < 1e-9, "{found:?} for {expected:?}");
        }
    }

    /// The message names the key, the value and the allowed range. Another crane, and oil parameters
    /// outside the crane file's uncertainty, are refused as well.
    #[test]
    fn impossible_parameters_are_refused() {
        let key = |key: &str, value: &str| {
            let found = read_back(|text| {
                let mut all: Value = serde_json::from_str(text).unwrap();
                all[key] = serde_json::from_str(value).unwrap();
                all.to_string()
            });
            found.unwrap_err()
        };
        let message = key("transition_pressure_bar", "700.0");
        assert!(message.contains("700.0") && message.contains("from 8 to 65"), "{message}");
        assert!(key("drive_lag_ms", "\"slow\"").contains("\"slow\""));
        assert!(key("flow_transition_correlation", "1.5").contains("from -1 to 1"));
        assert!(key("unknown_flow_deviation_rpm", "null").contains("missing"));
        assert!(key("crane_digest", "\"0\"").contains("another crane file"));
        let message = key("unknown_flow_rpm", "900.0");
        assert!(message.contains("900.0 rpm off the crane file"), "{message}");
        assert!(read_back(|_| "{".into()).unwrap_err().contains("run --parameters"));
    }

    /// The estimator starts with the retained parameters, limited to those that it estimates; without a
    /// file it starts with the crane file's.
    #[test]
    fn a_run_begins_with_the_retained_parameters() {
        let model = Description::uia_single_boom().unwrap();
        let motion = model.motion(model.numbers.fast);
        let first = |retained: Option<RetainedParameters<f64>>| {
            let strategy = Strategy::ScheduledLqr;
            let mut run = Lockstep::new(&model, &model, motion, strategy).unwrap();
            if let Some(retained) = retained {
                run = run.with_retained_parameters(retained);
            }
            let mut operator = Operator::automatic(model.numbers.control_period);
            let mut records = (0..100).map(|_| run.period(&mut operator, strategy).unwrap());
            records.find_map(|record| record.estimates).unwrap().parameters
        };
        // the load is held in the first period: these parameters are not updated
        let (found, expected) = (first(Some(parameters())), parameters());
        for (a, b) in found.to_array().into_iter().zip(expected.to_array()) {
            assert!((a / b - 1.0).abs() < 1e-12, "{found:?} for {expected:?}");
        }
        let too_soft = RetainedParameters { transition_pressure: 1e9, ..parameters() };
        let highest = model.numbers.tuning.estimator_highest_transition;
        assert_eq!(first(Some(too_soft)).transition_pressure, highest);
        assert_eq!(first(None).transition_pressure, model.numbers.transition);
    }
}
