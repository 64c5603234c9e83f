//! Faults of single signals: missing, stuck, out of range, and a transducer that is off.

use super::{OFFSET, RANGE, SETTLED, STUCK, SignalFinding, pressure_per_kg};
use crate::log_estimation::filter_run::{PAYLOAD, Run, Source};
use hydroboom_control::estimation::state_estimator::StateEstimator;
use hydroboom_description::Description;
use hydroboom_measurement::{Signal, Signals, TimeBase, Track};

/// Error of a typical pressure transducer as a share of its span: upper end of the usual class, 0.25 to 0.5
/// %.
const TRANSDUCER: f64 = 0.005;
/// Velocity below which the boom is nearly at rest \[m/s\], for the comparison of pump and piston side.
const REST_SPEED: f64 = 5e-3;
/// Window of the test for a stuck signal \[s\], smallest number of samples in it, and piston travel in it
/// from which the load moves \[m\].
const STUCK_WINDOW: f64 = 0.5;
const STUCK_SAMPLES: usize = 5;
const STUCK_TRAVEL: f64 = 5e-3;
/// Number of points at which both are compared.
const COMPARED: usize = 2000;

/// Signals that are missing in a part of the log.
pub(super) fn missing(
    signals: &Signals,
    source: &Source<'_>,
    is_on_valve: bool,
) -> Vec<SignalFinding> {
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
pub(super) fn stuck(
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
pub(super) fn out_of_range(description: &Description, found: &Run) -> Option<SignalFinding> {
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

/// Comparison of the piston-side pressure with that on the pump side of the open load-holding valve.
pub(super) fn offset(
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
