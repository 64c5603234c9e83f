//! Result of a course: tracking error, sustained oscillation, fault and fallback, evaluated record by record.

use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::oscillation_detector::OscillationState;
use hydroboom_lab::closed_loop::metrics::{REACHED, SustainedOscillation, TrackingError};
use hydroboom_realtime::control_task::{Fallback, Record};
use serde::Serialize;

/// Result of a course. Its JSON is an element of `courses` in the output of `run --json`.
#[derive(Clone, Debug, Serialize)]
pub struct CourseResult {
    /// Name of the course: the motion with its speed, or a scenario.
    pub course: String,
    /// Name of the strategy at the start of the course.
    pub strategy: &'static str,
    /// Name of the strategy at the end of the course; none if it did not change.
    pub then: Option<&'static str>,
    /// Time of the start since the session began \[s\].
    pub begun_s: f64,
    /// Tracking error without the approach to the course's start; NaN if a fault ended the course. The true error is
    /// NaN for a machine in another process, of which only the sensors are known.
    #[serde(flatten)]
    pub error: TrackingError,
    /// Whether the loop came to rest where its reference rested: false for a sustained oscillation, and if
    /// a fault ended the course.
    pub stable: bool,
    /// Whether the last half-cycles had not decayed but were too few for a sustained oscillation when the
    /// load was held.
    pub may_oscillate: bool,
    /// Sustained oscillation of the largest amplitude that the supervisor found; none without one.
    pub sustained_oscillation: Option<SustainedOscillation>,
    /// Code of the fault that ended the course; none if it was completed.
    pub fault: Option<&'static str>,
    /// Whether the benchmark controller replaced the strategy in at least one control period.
    pub fallback: bool,
    /// Name of the last reason for a fallback; none without one.
    pub fallback_cause: Option<&'static str>,
    /// Resident memory of this process at the end of the course \[MB\]; none if the system does not report it.
    pub memory_mb: Option<f64>,
}

/// Evaluation of the present course.
pub struct CourseEvaluation {
    /// Strategy at the first sample of the error, and at the last one.
    strategies: [Strategy; 2],
    /// Time of the start since the session began \[s\].
    begun: f64,
    measured: ErrorStatistics,
    truth: ErrorStatistics,
    /// Last reason for which the benchmark controller replaced the strategy.
    fallback: Option<Fallback>,
    /// Sustained oscillation of the largest amplitude so far.
    oscillation: Option<SustainedOscillation>,
    /// Largest magnitude of the commanded motor speed during sustained oscillations \[rev/s\].
    largest_command: f64,
    /// Detector of an oscillation that begins at the end of the course.
    detector: OscillationState<f64>,
    /// Time of the last sample of the error since the session began \[s\].
    at: f64,
}

impl CourseEvaluation {
    /// Evaluation without samples, from the control period in which the load's release began.
    pub fn begin(record: &Record) -> Self {
        Self {
            strategies: [record.strategy; 2],
            begun: record.time,
            measured: ErrorStatistics::default(),
            truth: ErrorStatistics::default(),
            fallback: None,
            oscillation: None,
            largest_command: 0.0,
            detector: OscillationState::default(),
            at: record.time,
        }
    }

    /// Adds a control period with its measured tracking error x − x_ref \[mm\].
    pub fn add(&mut self, record: &Record, error_mm: f64) {
        if self.measured.count == 0 {
            self.strategies[0] = record.strategy;
        }
        self.strategies[1] = record.strategy;
        self.measured.add(error_mm);
        let (rests, elapsed) = (record.reference.velocity == 0.0, record.time - self.at);
        self.at = record.time;
        // the supervisor reports oscillations; this detector is evaluated at the end
        let _ = SustainedOscillation::after(&mut self.detector, -1e-3 * error_mm, rests, elapsed);
        self.fallback = record.fallback.or(self.fallback);
        if let Some([amplitude, frequency_hz]) = record.decision.oscillation {
            let now = SustainedOscillation {
                amplitude_mm: amplitude * 1e3,
                frequency_hz,
                motor_at_limit: false,
            };
            self.largest_command =
                self.largest_command.max(record.decision.command.motor_speed.abs());
            let is_larger =
                self.oscillation.is_none_or(|before| now.amplitude_mm > before.amplitude_mm);
            self.oscillation = if is_larger { Some(now) } else { self.oscillation };
        }
    }

    /// Adds the true tracking error x − x_ref of a control period \[mm\].
    pub fn add_true_error(&mut self, error_mm: f64) {
        self.truth.add(error_mm);
    }

    /// Result of the course that ended with the record `end`; `course` is its name, and `largest_motor_speed` the limit
    /// of the motor \[rev/s\].
    pub fn result(&self, course: String, end: &Record, largest_motor_speed: f64) -> CourseResult {
        let [strategy, then] = self.strategies;
        let [rms_measured_mm, peak_measured_mm] = self.measured.rms_and_peak().unwrap_or_default();
        let [rms_true_mm, peak_true_mm] = self.truth.rms_and_peak().unwrap_or([f64::NAN; 2]);
        let is_steady = self.oscillation.is_none() && end.decision.cause.is_none();
        CourseResult {
            course,
            strategy: strategy.name(),
            then: (then != strategy).then(|| then.name()),
            begun_s: self.begun,
            // a course ended by a fault has no error as a result
            error: match end.decision.cause {
                Some(_) => TrackingError::UNFINISHED,
                None => {
                    TrackingError { rms_true_mm, rms_measured_mm, peak_true_mm, peak_measured_mm }
                }
            },
            stable: is_steady,
            may_oscillate: is_steady && self.detector.half_cycles > 0.5,
            sustained_oscillation: self.oscillation.map(|oscillation| SustainedOscillation {
                motor_at_limit: self.largest_command >= REACHED * largest_motor_speed,
                ..oscillation
            }),
            fault: end.decision.cause.map(|cause| cause.code()),
            fallback: self.fallback.is_some(),
            fallback_cause: self.fallback.map(Fallback::name),
            memory_mb: memory_mb(),
        }
    }
}

/// Statistics of an error along a course.
#[derive(Clone, Copy, Debug, Default)]
struct ErrorStatistics {
    /// Sum of squares \[mm²\].
    sum: f64,
    /// Number of samples.
    count: u32,
    /// Error of largest magnitude, with its sign \[mm\].
    peak: f64,
}

impl ErrorStatistics {
    fn add(&mut self, mm: f64) {
        self.sum += mm * mm;
        self.count += 1;
        if mm.abs() > self.peak.abs() {
            self.peak = mm;
        }
    }

    /// RMS, and error of largest magnitude \[mm\]; none without samples.
    fn rms_and_peak(&self) -> Option<[f64; 2]> {
        (self.count > 0).then(|| [(self.sum / f64::from(self.count)).sqrt(), self.peak])
    }
}

/// Resident memory of this process \[MB\]; none if the system does not report it.
fn memory_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:"))?;
    line.split_whitespace().nth(1)?.parse::<f64>().ok().map(|kilobytes| kilobytes / 1024.0)
}
