//! Baseline of a machine's delivered flow, recorded in one healthy cycle. It narrows the monitor that
//! compares position with delivered flow. A baseline is recorded on request only and does not adapt.

use crate::control_task::Record;
use hydroboom_control::supervision::flow_monitor::{
    FlowMonitor, FlowMonitorState, FlowReading, Range,
};
use hydroboom_description::Description;
use hydroboom_files::FileError;
use hydroboom_math::solve_pivoted;
use serde_json::{Value, json};
use std::path::Path;
use thiserror::Error;

/// Relative tolerance of the flow gain around its baseline: the machine warms up, and its oil dissolves
/// air. The virtual crane varies by 0.3 % between cycles.
const GAIN_CHANGE: f64 = 0.01;
/// Factor of tolerance of the leakage in both directions: viscosity halves within 20 K.
const LEAKAGE_CHANGE: f64 = 2.0;
/// m³/(rev Pa) per cm³/(rev bar).
const SLIP: f64 = 1e-11;
/// Tikhonov regularisation of the scaled normal equations.
const RIDGE: f64 = 1e-9;
/// Smallest travel of the piston for a baseline \[m\].
const LEAST_TRAVEL: f64 = 0.1;

/// Baseline of the delivered flow of one machine, fitted by least squares to one healthy cycle.
#[derive(Clone, Debug, PartialEq)]
pub struct FlowBaseline {
    /// Flow gain k \[-\]: volume that reaches the cylinder per displaced volume.
    pub gain: f64,
    /// Leakage factor λ \[-\]: leakage over its value in the crane file.
    pub leakage: f64,
    /// Speed-dependent slip coefficient c \[m³/(rev Pa)\].
    pub slip: f64,
    /// RMS residual of the fit, as piston travel \[m\].
    pub residual: f64,
    /// Time of recording \[s since 1970\].
    pub recorded_at: u64,
    /// Digest of the crane file's values, which identifies the crane.
    pub digest: String,
}

/// Longest file that is read \[B\].
const LONGEST: u64 = 1_000_000;

/// Reason why a baseline cannot be recorded or read.
#[derive(Debug, Error)]
pub enum BaselineError {
    /// The file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file is not a baseline, or belongs to another crane.
    #[error("{path}: {reason}")]
    Other {
        /// Its path.
        path: String,
        /// Reason, and what to do.
        reason: String,
    },
    /// The cycle was stopped or is too short.
    #[error("no baseline: {0}")]
    Cycle(String),
}

impl FlowBaseline {
    /// Baseline of a completed course from its records.
    ///
    /// Least squares over all measurements of the volume balance `A Δx + C = k V − λ L − c P`. The terms
    /// are swept volume, compressed volume, displaced volume, leakage and slip. A negative leakage factor counts as 0.
    ///
    /// # Errors
    ///
    /// [`BaselineError::Cycle`] in each of these cases:
    /// - the course was stopped by a fault, or the piston moved less than 100 mm;
    /// - the measurements do not determine the three factors;
    /// - the RMS residual exceeds the tolerance of `monitor`;
    /// - a factor is out of the range that [`read`](Self::read) allows.
    pub fn of_course(
        model: &Description,
        monitor: &FlowMonitor,
        records: &[Record],
    ) -> Result<Self, BaselineError> {
        let cycle = |reason: &str| Err(BaselineError::Cycle(reason.into()));
        if let Some(cause) = records.iter().find_map(|r| r.decision.cause) {
            return cycle(&format!("the course was stopped by {}", cause.code()));
        }
        let side_a = monitor.direction > 0.0;
        let mut state = FlowMonitorState::default();
        let (mut rows, mut last): (Vec<[f64; 4]>, Option<&Record>) = (Vec::new(), None);
        for record in records.iter().filter(|r| r.course_time.is_some()) {
            let r = record.signals();
            let (carrying, other) =
                ([r.pressure_pump_a, r.pressure_a], [r.pressure_pump_b, r.pressure_b]);
            let ([pump, load], [pump_b, _]) =
                if side_a { (carrying, other) } else { (other, carrying) };
            let reading = FlowReading {
                stroke: r.stroke,
                motor_speed: r.motor_speed,
                pressures: [pump, load, pump_b, r.pressure_accumulator],
            };
            let elapsed = last.map_or(0.0, |before| record.time - before.time);
            monitor.advance(&mut state, &reading, elapsed);
            rows.push(FlowMonitor::sums(&state));
            last = Some(record);
        }
        let swept = rows.iter().map(|row| row[0].abs()).fold(0.0, f64::max);
        if swept < LEAST_TRAVEL * monitor.area {
            return cycle("the piston moved less than 100 mm");
        }
        // y = k V − λ L − c P, each column scaled to unit length
        let columns = |row: &[f64; 4]| [row[1], -row[2], -row[3]];
        let length: [f64; 3] = std::array::from_fn(|i| {
            let squares: f64 = rows.iter().map(|row| columns(row)[i].powi(2)).sum();
            squares.sqrt().max(f64::MIN_POSITIVE)
        });
        // a crane file without leakage gives a column of zeros: the regularisation keeps its factor at zero
        let mut matrix: [[f64; 3]; 3] =
            std::array::from_fn(|i| std::array::from_fn(|j| if i == j { RIDGE } else { 0.0 }));
        let mut factors = [0.0; 3];
        for row in &rows {
            let column: [f64; 3] = std::array::from_fn(|i| columns(row)[i] / length[i]);
            for i in 0..3 {
                factors[i] += column[i] * row[0];
                for j in 0..3 {
                    matrix[i][j] += column[i] * column[j];
                }
            }
        }
        if solve_pivoted(&mut matrix, &mut factors, 3).is_none() {
            return cycle("the measurements do not determine it");
        }
        let [gain, leakage, slip]: [f64; 3] = std::array::from_fn(|i| factors[i] / length[i]);
        // noise can make a small leakage negative
        let leakage = leakage.max(0.0);
        let off = |row: &[f64; 4]| row[0] - gain * row[1] + leakage * row[2] + slip * row[3];
        let squares: f64 = rows.iter().map(|row| off(row).powi(2)).sum();
        let residual = (squares / rows.len() as f64).sqrt() / monitor.area;
        if residual > monitor.tolerance {
            return cycle(&format!(
                "{:.2} mm of the course are left unexplained, more than {:.2} mm",
                residual * 1e3,
                monitor.tolerance * 1e3
            ));
        }
        let recorded_at = seconds_since_1970();
        let baseline = Self { gain, leakage, slip, residual, recorded_at, digest: model.digest() };
        match baseline.impossible() {
            Some(reason) => Err(BaselineError::Cycle(reason)),
            None => Ok(baseline),
        }
    }

    /// Flow monitor with its ranges narrowed to this baseline and its allowed change, and never widened beyond those
    /// of the crane file.
    pub fn narrowed(&self, monitor: FlowMonitor) -> FlowMonitor {
        let gain =
            Range { low: self.gain * (1.0 - GAIN_CHANGE), high: self.gain * (1.0 + GAIN_CHANGE) };
        let leakage = [self.leakage / LEAKAGE_CHANGE, self.leakage * LEAKAGE_CHANGE];
        let leakage = Range { low: leakage[0].min(leakage[1]), high: leakage[0].max(leakage[1]) };
        let slip = [self.slip / LEAKAGE_CHANGE, self.slip * LEAKAGE_CHANGE];
        let slip = Range { low: slip[0].min(slip[1]), high: slip[0].max(slip[1]) };
        // a baseline narrows the crane file's ranges and never widens them
        let within = |range: Range, of: Range| Range {
            low: range.low.max(of.low).min(of.high),
            high: range.high.min(of.high).max(of.low),
        };
        monitor.with_baseline(
            within(gain, monitor.gain),
            within(leakage, monitor.leakage),
            within(slip, monitor.slip),
        )
    }

    /// Age of the baseline \[days\], by the computer's clock; 0 if that clock is behind the time of recording.
    pub fn age_days(&self) -> f64 {
        (seconds_since_1970().saturating_sub(self.recorded_at)) as f64 / 86_400.0
    }

    /// Message for the first number that is out of range, if any.
    fn impossible(&self) -> Option<String> {
        let all = [
            ("flow_gain", self.gain, 0.3, 1.3),
            ("leakage_factor", self.leakage, 0.0, 100.0),
            ("slip_cm3_per_rev_bar", self.slip / SLIP, -1.0, 1.0),
            ("residual_mm", self.residual * 1e3, 0.0, 50.0),
        ];
        all.iter().find(|(_, value, low, high)| !(*low..=*high).contains(value)).map(
            |(key, value, low, high)| {
                format!("{key} = {value} is out of range: it is {low} to {high}")
            },
        )
    }

    /// Text of the baseline file, in JSON.
    pub fn text(&self) -> String {
        let value = json!({
            "flow_gain": self.gain, "leakage_factor": self.leakage,
            "slip_cm3_per_rev_bar": self.slip / SLIP, "residual_mm": self.residual * 1e3,
            "recorded_at_s": self.recorded_at, "crane_digest": self.digest,
        });
        format!("{value:#}\n")
    }

    /// Reads a baseline file of the crane that `model` describes.
    ///
    /// Ranges: flow gain 0.3 to 1.3, leakage factor 0 to 100, slip −1 to 1 cm³/(rev bar), residual 0 to 50 mm.
    ///
    /// # Errors
    ///
    /// - [`BaselineError::File`] if the file cannot be read.
    /// - [`BaselineError::Other`] if it is no baseline, a number is missing, not finite or out of range, or its digest
    ///   is that of another crane.
    pub fn read(model: &Description, path: &Path) -> Result<Self, BaselineError> {
        let name = path.display().to_string();
        let text = hydroboom_files::text(path, "baseline", LONGEST)?;
        let other = |reason: String| BaselineError::Other { path: name.clone(), reason };
        let value: Value = serde_json::from_str(&text).map_err(|error| {
            other(format!("not a file of `hydroboom run --record-baseline`: {error}"))
        })?;
        let number = |key: &str| {
            let read = value[key].as_f64().filter(|number| number.is_finite());
            read.ok_or_else(|| match &value[key] {
                Value::Null => other(format!("{key} is missing")),
                read => other(format!("{key} is not a number: {read}")),
            })
        };
        let baseline = Self {
            gain: number("flow_gain")?,
            leakage: number("leakage_factor")?,
            slip: number("slip_cm3_per_rev_bar")? * SLIP,
            residual: number("residual_mm")? * 1e-3,
            recorded_at: value["recorded_at_s"].as_u64().unwrap_or(0),
            digest: value["crane_digest"].as_str().unwrap_or_default().into(),
        };
        if let Some(reason) = baseline.impossible() {
            return Err(other(reason));
        }
        if baseline.digest != model.digest() {
            return Err(other(format!(
                "it was recorded with another crane file than \"{}\", or other overrides: record it anew with \
                 `hydroboom run --record-baseline`",
                model.name
            )));
        }
        Ok(baseline)
    }
}

fn seconds_since_1970() -> u64 {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    since.map_or(0, |time| time.as_secs())
}
