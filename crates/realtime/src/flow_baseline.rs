//! A machine's own delivered flow, recorded in one good cycle: a baseline for the monitor of position
//! against delivered flow. It is recorded on request, and never changes by itself.

use crate::control_task::Record;
use hydroboom_control::supervision::{FlowMonitor, FlowMonitorState, FlowReading, Range};
use hydroboom_description::Description;
use serde_json::{Value, json};
use std::path::Path;
use thiserror::Error;

/// Share by which the gain of one machine may differ from its baseline: it warms, and its oil
/// dissolves air. The virtual crane differs by 0.3 % from cycle to cycle.
const GAIN_CHANGE: f64 = 0.01;
/// Factor by which its leakage may differ either way: viscosity halves within 20 degrees.
const LEAKAGE_CHANGE: f64 = 2.0;
/// A baseline needs so much travel to and fro \[m\].
const LEAST_TRAVEL: f64 = 0.1;

/// A recorded baseline.
#[derive(Clone, Debug, PartialEq)]
pub struct FlowBaseline {
    /// Volume that arrives for each displaced one, k.
    pub gain: f64,
    /// Leakage over its described value, λ.
    pub leakage: f64,
    /// What gain and leakage leave unexplained, RMS \[m\] of piston travel.
    pub residual: f64,
    /// Seconds since 1970 when it was recorded.
    pub recorded_at: u64,
    /// Digest of the crane file's values.
    pub digest: String,
}

/// Why there is no baseline.
#[derive(Debug, Error)]
pub enum BaselineError {
    /// The file cannot be read or written.
    #[error("{path}: {error}")]
    File {
        /// Its path.
        path: String,
        /// What the system says.
        error: std::io::Error,
    },
    /// The file is none, or of another crane.
    #[error("{path}: {reason}")]
    Other {
        /// Its path.
        path: String,
        /// What is wrong, and what to do.
        reason: String,
    },
    /// The cycle was not good, or too short.
    #[error("no baseline: {0}")]
    Cycle(String),
}

impl FlowBaseline {
    /// The baseline of a course that went well, from its records.
    ///
    /// Least squares of the oil's balance, `A Δx + C = k V − λ L`, over all readings.
    ///
    /// # Errors
    ///
    /// [`BaselineError::Cycle`] when the course was stopped, or the piston did not move enough.
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
        let (mut rows, mut last): (Vec<[f64; 3]>, Option<&Record>) = (Vec::new(), None);
        for record in records.iter().filter(|r| r.course_time.is_some()) {
            let r = &record.reading;
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
        let sum = |of: &dyn Fn(&[f64; 3]) -> f64| rows.iter().map(of).sum::<f64>();
        let (vv, vl, ll) = (sum(&|r| r[1] * r[1]), sum(&|r| r[1] * r[2]), sum(&|r| r[2] * r[2]));
        let (yv, yl) = (sum(&|r| r[0] * r[1]), sum(&|r| r[0] * r[2]));
        let determinant = vv * ll - vl * vl;
        // a crane file without leakage has none to be found
        let (gain, leakage) = match determinant > 1e-9 * vv * ll {
            true => ((yv * ll - yl * vl) / determinant, (yv * vl - yl * vv) / determinant),
            false => (yv / vv, 1.0),
        };
        let squares = sum(&|r| (r[0] - gain * r[1] + leakage * r[2]).powi(2));
        let residual = (squares / rows.len() as f64).sqrt() / monitor.area;
        let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
        let recorded_at = since.map_or(0, |time| time.as_secs());
        let baseline = Self { gain, leakage, residual, recorded_at, digest: model.digest() };
        match baseline.impossible() {
            Some(reason) => Err(BaselineError::Cycle(reason)),
            None => Ok(baseline),
        }
    }

    /// The monitor against this baseline.
    pub fn narrowed(&self, monitor: FlowMonitor) -> FlowMonitor {
        let gain =
            Range { low: self.gain * (1.0 - GAIN_CHANGE), high: self.gain * (1.0 + GAIN_CHANGE) };
        let leakage =
            Range { low: self.leakage / LEAKAGE_CHANGE, high: self.leakage * LEAKAGE_CHANGE };
        monitor.with_baseline(gain, leakage)
    }

    /// What cannot be of the numbers, if anything.
    fn impossible(&self) -> Option<String> {
        let all = [
            ("flow_gain", self.gain, 0.3, 1.3),
            ("leakage_factor", self.leakage, 0.0, 100.0),
            ("residual_mm", self.residual * 1e3, 0.0, 50.0),
        ];
        all.iter().find(|(_, value, low, high)| !(*low..=*high).contains(value)).map(
            |(key, value, low, high)| format!("{key} = {value} cannot be: it is {low} to {high}"),
        )
    }

    /// As JSON.
    pub fn text(&self) -> String {
        let value = json!({
            "flow_gain": self.gain, "leakage_factor": self.leakage, "residual_mm": self.residual * 1e3,
            "recorded_at_s": self.recorded_at, "crane_digest": self.digest,
        });
        format!("{value:#}\n")
    }

    /// Reads a baseline of the crane.
    ///
    /// # Errors
    ///
    /// [`BaselineError`] when there is none, its numbers cannot be, or it is of another crane.
    pub fn read(model: &Description, path: &Path) -> Result<Self, BaselineError> {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path)
            .map_err(|error| BaselineError::File { path: name.clone(), error })?;
        let other = |reason: String| BaselineError::Other { path: name.clone(), reason };
        let value: Value = serde_json::from_str(&text).map_err(|error| {
            other(format!("not what `hydroboom run --record-baseline` writes: {error}"))
        })?;
        let number = |key: &str| {
            let read = value[key].as_f64().filter(|number| number.is_finite());
            read.ok_or_else(|| other(format!("{key} is not a number: {}", value[key])))
        };
        let baseline = Self {
            gain: number("flow_gain")?,
            leakage: number("leakage_factor")?,
            residual: number("residual_mm")? * 1e-3,
            recorded_at: value["recorded_at_s"].as_u64().unwrap_or(0),
            digest: value["crane_digest"].as_str().unwrap_or_default().into(),
        };
        if let Some(reason) = baseline.impossible() {
            return Err(other(reason));
        }
        if baseline.digest != model.digest() {
            return Err(other(format!(
                "it was recorded with another crane file than \"{}\": record it anew with \
                 `hydroboom run --record-baseline`",
                model.name
            )));
        }
        Ok(baseline)
    }
}
