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

use crate::log_estimation::filter_run::{ALL, LAG, PAYLOAD, REST, Run, Source, TRANSITION, run};
use hydroboom_control::estimation::state_estimator::StateEstimator;
use hydroboom_description::Description;
use hydroboom_description::schema::CircuitChoice;
use hydroboom_measurement::{Signal, Signals, TimeBase, Track};
use serde::Serialize;

/// Largest mean NIS of a consistent window \[1\], and required share of consistent windows.
const LARGEST_NIS: f64 = 2.0;
const CONSISTENT_SHARE: f64 = 0.9;
/// Smallest mean NIS \[1\]: below it the assumed noise is far too large.
const SMALLEST_NIS: f64 = 0.5;
/// Smallest number of measured values in a window that counts.
const MINIMUM_SAMPLES: u32 = 10;
/// An estimate is observable if its standard deviation fell below this share of the initial one.
const OBSERVED: f64 = 0.7;
/// Trial delays \[s\].
const DELAYS: [f64; 5] = [0.01, 0.02, 0.04, 0.08, 0.15];
/// Gain of twice the log-likelihood per measured value from which a delay is reported. It grows with the
/// square of the delay and is about 0.01 for 20 ms along the motion at 120 mm/s.
const LOG_LIKELIHOOD_GAIN: f64 = 0.01;
/// Factors by which the measurement noise is varied, coarse to fine.
const NOISE_FACTORS: [f64; 2] = [4.0, 1.5];
/// Smallest step in the search for a delay \[s\].
const DELAY_RESOLUTION: f64 = 1e-3;
/// Length of the part of a log in which delays are searched \[s\].
const LONGEST_DELAY_SEARCH: f64 = 30.0;
/// Error of a typical pressure transducer as a share of its span: upper end of the usual class, 0.25 to 0.5
/// %.
const TRANSDUCER: f64 = 0.005;
/// Time since the opening of the valve \[s\], and velocity below which the boom is nearly at rest \[m/s\],
/// for the comparison of pump and piston side.
const SETTLED: f64 = 0.5;
const REST_SPEED: f64 = 5e-3;
/// Window of the test for a stuck signal \[s\], smallest number of samples in it, and piston travel in it
/// from which the load moves \[m\].
const STUCK_WINDOW: f64 = 0.5;
const STUCK_SAMPLES: usize = 5;
const STUCK_TRAVEL: f64 = 5e-3;
/// Number of points at which both are compared.
const COMPARED: usize = 2000;

/// Innovations of one measured signal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct InnovationSummary {
    /// Number of one-second windows with enough innovations.
    pub windows: usize,
    /// Mean normalised innovation squared; 1 for a consistent filter.
    pub mean_nis: f64,
    /// Share of windows with a mean NIS of at most 2.
    pub consistent_percent: f64,
    /// Mean of innovations over their standard deviation; 0 for a consistent filter.
    pub mean_over_sigma: f64,
}

/// Kinds of findings: excess noise, transducer offset, constant signal, and payload outside the crane
/// file's range.
const NOISE: &str = "noise";
const OFFSET: &str = "offset";
const STUCK: &str = "stuck";
const RANGE: &str = "range";

/// Fault of a signal.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SignalFinding {
    /// Symbol of the signal.
    pub signal: &'static str,
    /// Kind: missing, stuck, delay, offset, range, innovations, or noise.
    pub kind: &'static str,
    /// Description of the fault.
    pub text: String,
}

/// Verdict on the estimates along a log.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Verdict {
    /// Whether the innovations agree with their covariance; none if there were too few.
    pub is_consistent: Option<bool>,
    /// Innovations of the position.
    pub position: InnovationSummary,
    /// Innovations of the load pressure.
    pub load_pressure: InnovationSummary,
    /// Faulty signals.
    pub findings: Vec<SignalFinding>,
    /// Parameters that the motion does not determine.
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
    /// Verdict in a sentence.
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

/// Signals that are missing in a part of the log.
fn missing(signals: &Signals, source: &Source<'_>, is_on_valve: bool) -> Vec<SignalFinding> {
    let (begin, end) = (source.begin, source.end());
    let mut found = Vec::new();
    for signal in [Signal::Stroke, Signal::PressureA, Signal::PressureB, Signal::MotorSpeed] {
        let Some(track) = signals.get(signal) else {
            if signal != Signal::MotorSpeed || !is_on_valve {
                found.push(SignalFinding {
                    signal: signal.symbol(),
                    kind: "missing",
                    text: format!("{} was not recorded", signal.symbol()),
                });
            }
            continue;
        };
        let Some(base) = TimeBase::of(track.time()) else { continue };
        let mut stretches: Vec<(f64, f64)> = base.gaps.iter().map(|g| (g.from, g.to)).collect();
        stretches.insert(0, (begin, base.begin));
        stretches.push((base.end, end));
        let cut = stretches.iter().map(|(from, to)| (from.max(begin), to.min(end)));
        let lost: Vec<_> =
            cut.filter(|(from, to)| to - from > (2.5 * base.interval).max(0.01)).collect();
        let longest = lost.iter().max_by(|a, b| (a.1 - a.0).total_cmp(&(b.1 - b.0)));
        if let Some((from, to)) = longest {
            let total: f64 = lost.iter().map(|(from, to)| to - from).sum();
            found.push(SignalFinding {
                signal: signal.symbol(),
                kind: "missing",
                text: format!(
                    "{} is missing for {total:.2} s in {} stretch{}, the longest from {from:.2} to {to:.2} s: the filter leaves it out",
                    signal.symbol(),
                    lost.len(),
                    if lost.len() == 1 { "" } else { "es" }
                ),
            });
        }
    }
    found
}

/// Signals that are constant while the load moves: pressures while the position changes, the position while
/// the motor turns. A constant motor speed is no fault.
fn stuck(
    signals: &Signals,
    source: &Source<'_>,
    estimator: &StateEstimator<f64>,
) -> Vec<SignalFinding> {
    let model = &estimator.filter.model;
    let is_constant = |track: &Track, from: f64| {
        let samples = track.time().partition_point(|t| *t < from)
            ..track.time().partition_point(|t| *t < from + STUCK_WINDOW);
        let values = &track.values()[samples];
        values.len() >= STUCK_SAMPLES && values.windows(2).all(|v| v[0] == v[1])
    };
    let by_position = |from: f64| {
        let ends = (source.position.at(from), source.position.at(from + STUCK_WINDOW));
        matches!(ends, (Some(x0), Some(x1)) if (x1 - x0).abs() > STUCK_TRAVEL)
    };
    let by_motor = |from: f64| {
        let is_open = source.valve.is_some_and(|v| v.held(from).is_some_and(|v| v >= 0.5));
        let speed = source.speed.and_then(|speed| speed.at(from + 0.5 * STUCK_WINDOW));
        let travel = speed.unwrap_or(0.0) * model.displacement / model.piston_area * STUCK_WINDOW;
        is_open && travel.abs() > STUCK_TRAVEL
    };
    let windows = ((source.end() - source.begin) / STUCK_WINDOW) as usize;
    let mut found = Vec::new();
    for signal in [Signal::Stroke, Signal::PressureA, Signal::PressureB] {
        let Some(track) = signals.get(signal) else { continue };
        let begins = (0..windows).map(|k| source.begin + k as f64 * STUCK_WINDOW);
        let moves = |from: &f64| match signal {
            Signal::Stroke => by_motor(*from),
            _ => by_position(*from),
        };
        let count = begins.filter(moves).filter(|from| is_constant(track, *from)).count();
        if count > 0 {
            found.push(SignalFinding {
                signal: signal.symbol(),
                kind: STUCK,
                text: format!(
                    "{} repeats one value for {:.1} s while the load moves: look at its transducer, cable and input",
                    signal.symbol(),
                    count as f64 * STUCK_WINDOW
                ),
            });
        }
    }
    found
}

/// Payload outside the crane file's range by more than its bound.
fn out_of_range(description: &Description, found: &Run) -> Option<SignalFinding> {
    let range = description.ranges();
    let (low, high) = (range.low.payload, range.high.payload);
    let last = found.rows.iter().rev().find(|row| !row.is_held)?;
    let (payload, bound) = (last.estimate[PAYLOAD], 2.0 * last.deviation[PAYLOAD]);
    (payload - bound > high || payload + bound < low).then(|| SignalFinding {
        signal: "payload",
        kind: RANGE,
        text: format!(
            "the payload of {payload:.0} kg is outside of payload.mass_kg's range, {low:.0} to {high:.0} kg: is it another crane, or a transducer's error?"
        ),
    })
}

/// Delay of position or load pressure relative to the other signals, found by the likelihood of the log.
pub(crate) struct Delay {
    /// Gain of twice the log-likelihood per measured value.
    pub(crate) gain: f64,
    signal: &'static str,
    /// Delay \[s\].
    late: f64,
}

/// Delay under which the log is more likely by more than [`LOG_LIKELIHOOD_GAIN`] and consistent. The
/// likelihood of an inconsistent model has no meaning.
pub(crate) fn delay(estimator: &StateEstimator<f64>, source: &Source<'_>) -> Option<Delay> {
    let part = moving(source)?;
    // the refinement changes a delay by up to half of itself
    let margin = 1.5 * DELAYS[DELAYS.len() - 1];
    let scored = [part.begin + margin, part.end() - margin];
    let delayed = |k: usize, late: f64| {
        let mut delays = [0.0; 2];
        delays[k] = late;
        run(estimator, &part, delays, scored, false)
    };
    let cost = |k: usize, late: f64| delayed(k, late).mean_cost();
    let now = cost(0, 0.0);
    let numbers = if source.has_pressure() { 0..2 } else { 0..1 };
    let mut best: Option<(f64, usize, f64)> = None;
    for k in numbers {
        for late in DELAYS.into_iter().flat_map(|d| [d, -d]) {
            let found = cost(k, late);
            if found < best.map_or(now - LOG_LIKELIHOOD_GAIN, |(least, ..)| least) {
                best = Some((found, k, late));
            }
        }
    }
    let (mut least, k, mut late) = best?;
    // refinement around the best trial delay with halved steps
    let mut step = 0.25 * late.abs();
    while step > DELAY_RESOLUTION {
        for near in [late - step, late + step] {
            let found = cost(k, near);
            if found < least {
                (least, late) = (found, near);
            }
        }
        step *= 0.5;
    }
    // a delay at the end of the search range probably has another cause
    let is_inside = late.abs() < DELAYS[DELAYS.len() - 1];
    if !is_inside || is_consistent(&delayed(k, late)) != Some(true) {
        return None;
    }
    let signal = if k == 0 { Signal::Stroke.symbol() } else { "p_A, p_B" };
    Some(Delay { gain: now - least, signal, late })
}

impl Delay {
    fn finding(&self) -> SignalFinding {
        let way = if self.late > 0.0 { "late" } else { "early" };
        SignalFinding {
            signal: self.signal,
            kind: "delay",
            text: format!(
                "{} {way} by about {:.0} ms against the other signals: correct it with delay_ms in the mapping",
                self.signal,
                self.late.abs() * 1e3
            ),
        }
    }
}

/// Measurement noise of position \[m\] and load pressure \[Pa\] of largest likelihood, each at least the
/// filter's, with the gain of twice the log-likelihood per measured value.
pub(crate) fn likeliest_noise(
    estimator: &StateEstimator<f64>,
    source: &Source<'_>,
) -> ([f64; 2], f64) {
    let least = estimator.filter.measurement_noise;
    let part = moving(source).unwrap_or(*source);
    let cost = |noise: [f64; 2]| {
        let mut other = *estimator;
        other.filter.measurement_noise = noise;
        run(&other, &part, [0.0; 2], ALL, false).mean_cost()
    };
    let now = cost(least);
    let (mut noise, mut lowest) = (least, now);
    for factor in NOISE_FACTORS {
        loop {
            let tried = [[factor, 1.0], [1.0, factor], [1.0 / factor, 1.0], [1.0, 1.0 / factor]];
            let best = tried
                .map(|f| [0, 1].map(|k| (noise[k] * f[k]).max(least[k])))
                .map(|noise| (cost(noise), noise))
                .into_iter()
                .min_by(|a, b| a.0.total_cmp(&b.0));
            match best {
                Some((found, better)) if found < lowest - 1e-3 => {
                    (noise, lowest) = (better, found);
                }
                _ => break,
            }
        }
    }
    (noise, now - lowest)
}

/// Findings of noise above the expected one.
pub(crate) fn noise_findings(expected: [f64; 2], found: [f64; 2]) -> Vec<SignalFinding> {
    let units = [("position", 1e3, "mm"), ("load pressure", 1e-5, "bar")];
    let pairs = units.into_iter().zip(expected.into_iter().zip(found));
    pairs
        .filter(|(_, (expected, found))| *found > 1.5 * expected)
        .map(|((signal, size, unit), (expected, found))| SignalFinding {
            signal,
            kind: NOISE,
            text: format!(
                "noise of the {signal}: {:.2} {unit} RMS make the log likeliest, {:.2} {unit} were expected; the larger value is used",
                found * size,
                expected * size
            ),
        })
        .collect()
}

/// Part of a log in which delays are searched, from two seconds before the first motion; none without
/// motion.
fn moving<'a>(source: &Source<'a>) -> Option<Source<'a>> {
    let (time, values) = (source.position.time(), source.position.values());
    let first = *values.get(time.partition_point(|t| *t < source.begin))?;
    let moved = time.iter().zip(values).find(|(t, x)| {
        (source.begin..=source.end()).contains(*t) && (*x - first).abs() > 10.0 * REST * SETTLED
    });
    let begin = (moved?.0 - 2.0).max(source.begin);
    let period = source.period;
    let left = ((source.end() - begin).min(LONGEST_DELAY_SEARCH) / period).floor();
    Some(Source { begin, periods: left.max(0.0) as usize, ..*source })
}

/// Comparison of the piston-side pressure with that on the pump side of the open load-holding valve.
fn offset(
    description: &Description,
    signals: &Signals,
    source: &Source<'_>,
    estimator: &StateEstimator<f64>,
) -> Option<SignalFinding> {
    let (a, pump) = (signals.get(Signal::PressureA)?, signals.get(Signal::PressurePumpA)?);
    // a valve without a record may be shut
    let valve = source.valve?;
    let is_open = |time: f64| {
        valve.held(time).is_some_and(|v| v >= 0.5)
            && valve.held(time - SETTLED).is_some_and(|v| v >= 0.5)
    };
    let step = (source.end() - source.begin) / COMPARED as f64;
    let mut differences: Vec<f64> = (0..COMPARED)
        .map(|k| source.begin + k as f64 * step)
        .filter(|time| is_open(*time))
        .filter_map(|time| {
            let moved = source.position.at(time + 0.1)? - source.position.at(time)?;
            (moved.abs() < 0.1 * REST_SPEED).then_some(())?;
            Some(a.at(time)? - pump.at(time)?)
        })
        .collect();
    if differences.len() < COMPARED / 100 {
        return None;
    }
    let middle = differences.len() / 2;
    let median = *differences.select_nth_unstable_by(middle, f64::total_cmp).1;
    let n = &description.virtual_crane().0.numbers;
    let allowed = 2.0 * n.pressure_error.max(TRANSDUCER) * n.pressure_span;
    (median.abs() > allowed).then(|| SignalFinding {
        signal: Signal::PressureA.symbol(),
        kind: OFFSET,
        text: format!(
            "p_A is {:+.1} bar off p_PA with the load-holding valve open and the boom at rest, where {:.1} bar are allowed: one of the two transducers is off. If \
             it is p_A, the payload is wrong by {:+.0} kg",
            median * 1e-5,
            allowed * 1e-5,
            median / pressure_per_kg(estimator, source)
        ),
    })
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
