//! Verdict on the estimates along a log: consistency of the innovations, faulty signals, and parameters
//! that the motion does not determine.
//!
//! Innovations are consistent if their mean normalised square (NIS) is at most 2 in nine of ten windows of
//! one second. A delay is found by the likelihood of the log under the filter with position or load
//! pressure shifted in time. An offset of the piston-side pressure shows only against the pressure on the
//! pump side of the open load-holding valve. The payload estimate would absorb it otherwise.
//!
//! Source: Y. Bar-Shalom, X. Li, T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*,
//! 2001, section 5.4 (consistency), 5.5 (likelihood).

pub(crate) mod likelihood;
mod signal_faults;

use crate::log_estimation::filter_run::{LAG, PAYLOAD, Run, Source, TRANSITION};
use hydroboom_control::estimation::state_estimator::StateEstimator;
use hydroboom_description::Description;
use hydroboom_description::schema::CircuitChoice;
use hydroboom_measurement::Signals;
use likelihood::{delay, moving};
use serde::Serialize;
use signal_faults::{missing, offset, out_of_range, stuck};

/// Largest mean NIS of a consistent window \[1\], and required share of consistent windows.
const LARGEST_NIS: f64 = 2.0;
const CONSISTENT_SHARE: f64 = 0.9;
/// Smallest mean NIS \[1\]: below it the assumed noise is far too large.
const SMALLEST_NIS: f64 = 0.5;
/// Smallest number of measured values in a window that counts.
const MINIMUM_SAMPLES: u32 = 10;
/// An estimate is observable if its standard deviation fell below this share of the initial one.
const OBSERVED: f64 = 0.7;
/// Time since the opening of the valve after which pressures have settled \[s\].
const SETTLED: f64 = 0.5;

/// Statistics of the innovations of one measured signal along a log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct InnovationSummary {
    /// Number of one-second windows with at least ten innovations.
    pub windows: usize,
    /// Mean normalised innovation squared (NIS) \[-\]; 1 for a consistent filter.
    pub mean_nis: f64,
    /// Share of windows with a mean NIS of at most 2 \[%\].
    pub consistent_percent: f64,
    /// Mean of the innovations, each over its standard deviation \[-\]; 0 for a consistent filter.
    pub mean_over_sigma: f64,
}

/// Kinds of findings: excess noise, transducer offset, constant signal, and payload outside the crane
/// file's range.
const NOISE: &str = "noise";
const OFFSET: &str = "offset";
const STUCK: &str = "stuck";
const RANGE: &str = "range";

/// Fault of a signal of the log, as found by the filter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SignalFinding {
    /// Symbol of the signal.
    pub signal: &'static str,
    /// Kind of fault: missing, stuck, delay, offset, range, innovations, or noise.
    pub kind: &'static str,
    /// Description of the fault, as a sentence.
    pub text: String,
}

/// Verdict on the estimates along a log: consistency, faulty signals and observability.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Verdict {
    /// Whether the innovations agree with their covariance; none if there were too few.
    pub is_consistent: Option<bool>,
    /// Statistics of the innovations of the position.
    pub position: InnovationSummary,
    /// Statistics of the innovations of the load pressure.
    pub load_pressure: InnovationSummary,
    /// Faults of signals; empty if none was found.
    pub findings: Vec<SignalFinding>,
    /// Parameters that the log does not determine, each with the reason: the motion hardly reduces their standard
    /// deviation, a signal is missing, or no motion can tell them apart.
    pub unobservable: Vec<String>,
    /// Times at which the innovations indicate a load change or a shock \[s\].
    pub load_changes_s: Vec<f64>,
}

/// Verdict on a filter run.
pub(crate) fn verdict(
    description: &Description,
    signals: &Signals,
    estimator: &StateEstimator<f64>,
    source: &Source<'_>,
    found: &Run,
) -> Verdict {
    let [position, load_pressure] = [0, 1].map(|k| summary(found, k));
    let is_on_valve = description.choices.circuit == CircuitChoice::ValveControlled;
    let mut findings = missing(signals, source, is_on_valve);
    let stuck = stuck(signals, source, estimator);
    if stuck.is_empty() {
        findings.extend(delay(estimator, source).map(|delay| delay.finding()));
    }
    findings.extend(offset(description, signals, source, estimator));
    findings.extend(out_of_range(description, found));
    let is_consistent = is_consistent(found).map(|consistent| consistent && stuck.is_empty());
    findings.extend(stuck);
    for (signal, s) in [("position", position), ("load pressure", load_pressure)] {
        if s.windows > 0 && s.consistent_percent < 100.0 * CONSISTENT_SHARE {
            findings.push(SignalFinding {
                signal,
                kind: "innovations",
                text: format!(
                    "innovations of the {signal} are larger than their band: mean NIS {:.1}, {:.0} % of seconds consistent, mean {:+.1} sigma",
                    s.mean_nis, s.consistent_percent, s.mean_over_sigma
                ),
            });
        }
    }
    Verdict {
        is_consistent,
        position,
        load_pressure,
        findings,
        unobservable: unobservable(description, estimator, source, found),
        load_changes_s: found.load_changes.clone(),
    }
}

impl Verdict {
    /// Verdict as a sentence.
    pub fn sentence(&self) -> String {
        let changes = match self.load_changes_s.len() {
            0 => String::new(),
            1 => format!(
                "; at {:.2} s a changed load, or a shock",
                self.load_changes_s.first().copied().unwrap_or(f64::NAN)
            ),
            count => format!("; {count} times a changed load, or a shock"),
        };
        let small = [self.position, self.load_pressure]
            .iter()
            .any(|s| s.windows > 0 && s.mean_nis < SMALLEST_NIS);
        let wide = if small { "; the bands are wider than they need be" } else { "" };
        match self.is_consistent {
            None => "not to be judged: too few measurements while the load was free to move".into(),
            Some(true) if self.findings.iter().any(|finding| finding.kind == NOISE) => format!(
                "consistent only with more measurement noise than the crane file says: look at the signals that are off first{changes}"
            ),
            Some(true) if self.findings.iter().any(|finding| finding.kind == OFFSET) => format!(
                "innovations are consistent, but a pressure transducer is off: payload and load pressure are outside their bounds by its error{changes}"
            ),
            Some(true) if self.findings.iter().any(|finding| finding.kind == RANGE) => format!(
                "innovations are consistent, but the payload is outside the crane file's range: another crane, geometry or transducer{changes}"
            ),
            Some(false) if self.findings.iter().any(|finding| finding.kind == STUCK) => {
                format!("NOT consistent: a signal is stuck; do not rely on the estimates{changes}")
            }
            Some(true) => {
                format!("consistent: the innovations are within their bands{wide}{changes}")
            }
            Some(false) => {
                format!(
                    "NOT consistent: innovations are larger than their bands; do not rely on the bounds{changes}"
                )
            }
        }
    }
}

/// Whether the innovations agree with their covariance; none if there were too few.
pub(crate) fn is_consistent(found: &Run) -> Option<bool> {
    let all = [0, 1].map(|k| summary(found, k));
    let mut measured = all.iter().filter(|s| s.windows > 0).peekable();
    measured.peek()?;
    Some(!found.diverged && measured.all(|s| s.consistent_percent >= 100.0 * CONSISTENT_SHARE))
}

fn summary(found: &Run, k: usize) -> InnovationSummary {
    let windows: Vec<_> =
        found.windows.iter().map(|w| w[k]).filter(|w| w.1 >= MINIMUM_SAMPLES).collect();
    let number: f64 = windows.iter().map(|w| f64::from(w.1)).sum();
    if windows.is_empty() {
        return InnovationSummary::default();
    }
    let consistent = windows.iter().filter(|w| w.0 / f64::from(w.1) <= LARGEST_NIS).count();
    InnovationSummary {
        windows: windows.len(),
        mean_nis: windows.iter().map(|w| w.0).sum::<f64>() / number,
        consistent_percent: 100.0 * consistent as f64 / windows.len() as f64,
        mean_over_sigma: windows.iter().map(|w| w.2).sum::<f64>() / number,
    }
}

/// Load pressure per kilogram of payload \[Pa/kg\] in the middle of the log.
fn pressure_per_kg(estimator: &StateEstimator<f64>, source: &Source<'_>) -> f64 {
    let model = &estimator.filter.model;
    let middle = 0.5 * (source.begin + source.end());
    let x = source.position.held(middle).unwrap_or(model.half_stroke);
    let at = |payload: f64| model.at(x, payload).holding_pressure;
    (at(model.maximum_payload) - at(0.0)) / model.maximum_payload
}

/// Parameters that this motion does not determine, and those that none can.
fn unobservable(
    description: &Description,
    estimator: &StateEstimator<f64>,
    source: &Source<'_>,
    found: &Run,
) -> Vec<String> {
    let mut said = Vec::new();
    let has_pressure = source.has_pressure();
    let is_on_valve = description.choices.circuit == CircuitChoice::ValveControlled;
    if moving(source).is_none() {
        said.push(
            "the boom hardly moved: friction, oil and flow are those of the crane file".into(),
        );
    }
    let is_observed = |k: usize| found.variance_ratio[k] < OBSERVED;
    match has_pressure {
        false => said.push("payload and unknown force: no load pressure was measured".into()),
        true => {
            let per_kg = pressure_per_kg(estimator, source);
            said.push(format!(
                "an offset of the pressure transducers: 1 bar of p_A (and of p_PA alike) cannot be told from {:.0} kg of payload at the middle of the log",
                1e5 / per_kg
            ));
            if !is_observed(PAYLOAD) {
                said.push("payload: not better than at rest, within breakaway friction".into());
            }
        }
    }
    if !is_observed(TRANSITION) {
        let why = match is_on_valve {
            true => "with an unknown flow the oil's stiffness cannot be told from the flow",
            false => "the pressure changed too little",
        };
        said.push(format!("transition pressure of the oil: {why}"));
    }
    if is_on_valve {
        said.push(
            "leakage: it is a part of the unknown flow; what is left is the flow as a whole, from the piston's motion and the pressure".into(),
        );
    } else if source.speed.is_none() && source.command.is_none() {
        said.push("leakage: without a motor speed it is the whole flow".into());
    }
    if is_on_valve {
        said.push("drive lag: there is no drive".into());
    } else if !source.identifies_lag {
        said.push(
            "drive lag: motor speed and its command are needed in every control period".into(),
        );
    } else if !is_observed(LAG) {
        said.push("drive lag: the motor's speed changed too little".into());
    }
    said.push(
        "Coulomb and viscous friction each: the filter estimates the friction force and takes the crane file's law for it, within its range".into(),
    );
    said
}
