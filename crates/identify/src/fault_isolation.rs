//! Isolation of sensor faults: the signal of a log whose fault explains the difference between log and
//! model.
//!
//! Each hypothesis is one fault of one signal: offset or scale of a compared signal, or delay of an input.
//! The log is corrected for it, and so are the initial pressures of the model. Then the model is run again.
//! The size of an offset or a scale follows from weighted least squares over all signals, including the
//! effect of the initial values. The hypothesis with the smallest remaining difference is accepted, then
//! the next one is searched. Sources: Isermann, *Fault-Diagnosis Systems*, 2006; forward selection: Draper
//! and Smith, *Applied Regression Analysis*, 3rd ed. 1998, chapter 15.

use crate::differences::{Difference, Differences, differences};
use crate::error::IdentifyError;
use crate::experiment::{COMPARED, Experiment};
use crate::limits::LIMITS;
use crate::prediction::{Direction, INITIAL_VALUES, Prediction, predict, sensitivities_from};
use crate::verdict::{is_beyond, of_size};
use hydroboom_description::Description;
use hydroboom_measurement::Signal;
use rayon::prelude::*;

/// Fault of one signal of a log: additive, multiplicative or in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// Additive offset \[SI unit of the signal\]; not for a position, because the model starts at the log's position.
    Offset(f64),
    /// Scale factor \[-\]: of a position about its initial value, where the model starts too; of a pressure about
    /// zero.
    Scale(f64),
    /// Delay \[s\]; for an input, relative to all compared signals.
    Delay(f64),
}

/// Fault of one signal that explains most of the difference of at least one signal.
#[derive(Clone, Debug, PartialEq)]
pub struct SignalFault {
    /// Faulty signal.
    pub signal: Signal,
    /// Kind and size of the fault.
    pub fault: Fault,
    /// RMS difference log − model that remains after correction \[SI unit of the signal\]; none for an input of the
    /// model.
    pub left: Option<f64>,
    /// Redundant sensor of nearly the same pressure that does not show the fault, which excludes the crane as its
    /// cause; none without such a sensor.
    pub against: Option<Signal>,
    /// Compared signals of whose RMS difference the fault explains most: those beyond their limits, or delayed as by
    /// an input.
    pub explains: Vec<Signal>,
}

impl SignalFault {
    /// Whether the log distinguishes the fault of the sensor from an error of the crane's parameters.
    pub fn is_isolable(&self) -> bool {
        self.against.is_some() || matches!(self.fault, Fault::Delay(_))
    }
}

/// Comparison of a log with a model, both as measured and after correction for sensor faults.
#[derive(Clone, Debug)]
pub struct Isolated {
    /// Prediction of the model for the log as measured.
    pub prediction: Prediction,
    /// Differences of the model to the log as measured.
    pub found: Differences,
    /// Isolated faults of signals, in order of decreasing effect.
    pub faults: Vec<SignalFault>,
    /// Log corrected for the faults that are distinguishable from errors of the crane's parameters.
    pub corrected: Experiment,
    /// Differences of the model to the corrected log; they remain without a sensor fault as explanation.
    pub left: Differences,
}

/// Largest number of faults.
const MOST_FAULTS: usize = 3;
/// Number of offset and scale hypotheses that are tested by a model run, the best ones of the linear
/// ranking.
const TESTED_HYPOTHESES: usize = 3;
/// Increase of another difference by more than this factor rejects a fault.
const LARGEST_INCREASE: f64 = 1.1;
/// Shift of the inputs for the derivative with respect to a delay \[s\].
const INPUT_SHIFT: f64 = 10e-3;
/// Largest delay of an input \[s\].
const LONGEST_DELAY: f64 = 0.2;

/// Isolates faults of a log's signals. A difference that two sensors of nearly the same pressure share is
/// attributed to the crane.
///
/// # Errors
///
/// As [`predict`](crate::predict), if the model cannot be run.
pub fn isolate(model: &Description, experiment: &Experiment) -> Result<Isolated, IdentifyError> {
    let read = Compared::new(model, experiment.clone())?;
    let (prediction, found) = (read.prediction.clone(), read.found.clone());
    let (mut now, mut faults) = (read, Vec::<SignalFault>::new());
    while faults.len() < MOST_FAULTS && now.found.iter().any(|d| is_beyond(d) || d.is_late()) {
        let isolated: Vec<Signal> = faults.iter().map(|fault| fault.signal).collect();
        let Some((fault, then)) = best(model, &now, &isolated)? else { break };
        if fault.is_isolable() {
            now = then;
        }
        faults.push(fault);
    }
    Ok(Isolated { prediction, found, faults, corrected: now.experiment, left: now.found })
}

/// Experiment with the model's prediction.
struct Compared {
    experiment: Experiment,
    prediction: Prediction,
    found: Differences,
}

impl Compared {
    fn new(model: &Description, experiment: Experiment) -> Result<Self, IdentifyError> {
        let prediction = predict(model, &experiment)?;
        let found = differences(&experiment, &prediction);
        Ok(Self { experiment, prediction, found })
    }

    /// The same without a fault; none if the model cannot be run.
    fn without(&self, model: &Description, signal: Signal, fault: Fault) -> Option<Self> {
        Self::new(model, self.experiment.corrected(signal, fault)).ok()
    }

    fn difference(&self, signal: Signal) -> Option<&Difference> {
        self.found.iter().find(|d| d.signal == signal)
    }

    /// RMS of the judged differences over their limits.
    fn sizes(&self) -> impl Iterator<Item = (Signal, f64)> {
        let resolved = self.found.iter().filter(|d| d.unresolved.is_none());
        resolved.map(|d| (d.signal, d.rms / of_size(d).limit))
    }

    /// Sum of ln(1 + square)/2 over them, the objective also used for keys.
    fn sum(&self) -> f64 {
        self.sizes().map(|(_, over)| 0.5 * (1.0 + over * over).ln()).sum()
    }

    /// That sum after removal of a direction by least squares, to first order.
    fn sum_along(&self, direction: &Prediction) -> Option<f64> {
        let step = self.along(direction)?;
        let rms = |place: usize| {
            let rows = self.experiment.samples.iter().zip(&self.prediction).zip(direction);
            let left = rows.filter_map(|((sample, model), direction)| {
                Some(sample.values[place]? - model[place] - step * direction[place])
            });
            let (count, sum) = left.fold((0.0, 0.0), |(n, sum), e| (n + 1.0, sum + e * e));
            (count > 0.0).then(|| f64::sqrt(sum / count))
        };
        let resolved = self.found.iter().filter(|d| d.unresolved.is_none());
        let over = resolved.filter_map(|d| Some(rms(place(d.signal)?)? / of_size(d).limit));
        Some(over.map(|over| 0.5 * (1.0 + over * over).ln()).sum())
    }

    /// Pairs of log and model values of a signal.
    fn pairs(&self, signal: Signal) -> Vec<(f64, f64)> {
        let place = place(signal);
        let both = self.experiment.samples.iter().zip(&self.prediction);
        both.filter_map(|(sample, model)| Some((sample.values[place?]?, model[place?]))).collect()
    }

    /// Component of the differences along a direction by least squares, each signal scaled by its limit and
    /// its difference.
    fn along(&self, direction: &Prediction) -> Option<f64> {
        let (mut both, mut square) = (0.0, 0.0);
        for d in self.found.iter().filter(|d| d.unresolved.is_none()) {
            let Some(place) = place(d.signal) else { continue };
            let weight = 1.0 / (of_size(d).limit.powi(2) + d.rms.powi(2));
            let rows = self.experiment.samples.iter().zip(&self.prediction).zip(direction);
            for ((sample, model), direction) in rows {
                let Some(value) = sample.values[place] else { continue };
                both += weight * (value - model[place]) * direction[place];
                square += weight * direction[place].powi(2);
            }
        }
        let step = both / square;
        (square > 0.0 && step.is_finite()).then_some(step)
    }
}

fn place(signal: Signal) -> Option<usize> {
    COMPARED.iter().position(|other| *other == signal)
}

/// Fault with the smallest remaining difference, and the corrected log; none if no fault explains enough.
fn best(
    model: &Description,
    now: &Compared,
    isolated: &[Signal],
) -> Result<Option<(SignalFault, Compared)>, IdentifyError> {
    let sensors = match now.found.iter().any(is_beyond) {
        true => hypotheses(model, now, isolated)?,
        false => Vec::new(),
    };
    let tried = |of: &Hypothesis| of.tried(model, now);
    let mut all: Vec<(SignalFault, Compared)> = sensors.par_iter().filter_map(tried).collect();
    if !isolated.contains(&now.experiment.driving) {
        all.extend(with_late_input(model, now));
    }
    if !isolated.contains(&Signal::HoldingValve) {
        all.extend(with_late_valve(model, now));
    }
    Ok(all.into_iter().min_by(|a, b| a.1.sum().total_cmp(&b.1.sum())))
}

/// Hypothesis: offset or scale of a compared signal.
struct Hypothesis {
    signal: Signal,
    is_scale: bool,
    /// Derivative of the differences with respect to it.
    direction: Prediction,
}

/// Best hypotheses by linear ranking, without a model run for each.
fn hypotheses(
    model: &Description,
    now: &Compared,
    isolated: &[Signal],
) -> Result<Vec<Hypothesis>, IdentifyError> {
    let channels = now.experiment.initial_channels();
    let is_initialised =
        |k: &usize| channels[*k].is_some() && now.experiment.initial_values[*k].is_some();
    let starts: Vec<usize> = (1..INITIAL_VALUES).filter(is_initialised).collect();
    let along: Vec<Direction> = starts.iter().map(|k| Direction::InitialValue(*k)).collect();
    let (_, slopes) = sensitivities_from(model, &now.experiment, &[0.0; INITIAL_VALUES], &along)?;
    let slope_of = |place: usize| {
        let start = starts.iter().position(|start| channels[*start] == Some(place))?;
        slopes.get(start)
    };
    let is_candidate = |d: &&Difference| {
        d.unresolved.is_none() && !d.is_late() && !d.is_of_clock() && !isolated.contains(&d.signal)
    };
    let mut all = Vec::new();
    for signal in now.found.iter().filter(is_candidate).map(|d| d.signal) {
        let Some(own) = place(signal) else { continue };
        let slope = slope_of(own);
        let first = now.prediction.first().map_or(0.0, |row| row[own]);
        let mut add = |is_scale, direction| all.push(Hypothesis { signal, is_scale, direction });
        match signal {
            // the model starts at the log's position: an offset of its sensor shifts both
            Signal::Stroke => add(true, direction(now, own, None, |shown| shown - first, 0.0)),
            _ => {
                add(false, direction(now, own, slope, |_| 1.0, 1.0));
                add(true, direction(now, own, slope, |shown| shown, first));
            }
        }
    }
    let enough = (1.0 - LIMITS.worthwhile) * now.sum();
    let ranked = all.into_iter().filter_map(|of| Some((now.sum_along(&of.direction)?, of)));
    let mut ranked: Vec<(f64, Hypothesis)> = ranked.filter(|(sum, _)| *sum < enough).collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(ranked.into_iter().take(TESTED_HYPOTHESES).map(|(_, of)| of).collect())
}

impl Hypothesis {
    /// The fault after two iterations, if it explains enough.
    fn tried(&self, model: &Description, now: &Compared) -> Option<(SignalFault, Compared)> {
        let signal = self.signal;
        let next = |fault: Fault| now.without(model, signal, fault)?.along(&self.direction);
        let fault = match self.is_scale {
            true => {
                let factor = 1.0 + now.along(&self.direction)?;
                Fault::Scale(factor * (1.0 + next(Fault::Scale(factor))?))
            }
            false => {
                let off = now.along(&self.direction)?;
                Fault::Offset(off + next(Fault::Offset(off))?)
            }
        };
        let own = now.difference(signal)?;
        let pressures = now.found.iter().filter(|d| d.signal != Signal::Stroke);
        let largest = pressures.fold(0.0_f64, |most, d| most.max(d.largest));
        let is_possible = match fault {
            Fault::Offset(off) => {
                (of_size(own).limit..=LIMITS.sensor_offset * largest).contains(&off.abs())
            }
            Fault::Scale(factor) => (factor - 1.0).abs() <= LIMITS.sensor_scale,
            Fault::Delay(_) => false,
        };
        if !is_possible {
            return None;
        }
        accepted(now, now.without(model, signal, fault)?, signal, fault)
    }
}

/// Derivative of the differences with respect to a fault: the signal's own change minus the model's change
/// due to its initial value.
fn direction(
    now: &Compared,
    own: usize,
    slope: Option<&Prediction>,
    shown: impl Fn(f64) -> f64,
    begun: f64,
) -> Prediction {
    let row = |(k, row): (usize, &[f64; COMPARED.len()])| {
        let mut along = slope.map_or([0.0; COMPARED.len()], |slope| slope[k].map(|j| -begun * j));
        along[own] += shown(row[own]);
        along
    };
    now.prediction.iter().enumerate().map(row).collect()
}

/// Input delayed or advanced relative to all compared signals: one cause instead of a delay of each.
fn with_late_input(model: &Description, now: &Compared) -> Option<(SignalFault, Compared)> {
    let signal = now.experiment.driving;
    let late: Vec<Signal> = now.found.iter().filter(|d| d.is_late()).map(|d| d.signal).collect();
    let median = |of: &Compared| {
        let mut delays: Vec<f64> =
            late.iter().filter_map(|signal| of.difference(*signal)?.delay).collect();
        delays.sort_by(f64::total_cmp);
        delays.get(delays.len() / 2).copied()
    };
    if late.len() < 2 {
        return None;
    }
    let mut delay = -median(now)?;
    delay -= median(&now.without(model, signal, Fault::Delay(delay))?)?;
    with_delay(model, now, signal, delay)
}

/// Load-holding valve that opens and closes later or earlier than logged.
fn with_late_valve(model: &Description, now: &Compared) -> Option<(SignalFault, Compared)> {
    let signal = Signal::HoldingValve;
    if !now.experiment.drive.is_switched() {
        return None;
    }
    let nudged = now.without(model, signal, Fault::Delay(INPUT_SHIFT))?;
    let rows = nudged.prediction.iter().zip(&now.prediction);
    let direction =
        rows.map(|(a, b)| std::array::from_fn(|k| (a[k] - b[k]) / INPUT_SHIFT)).collect();
    let mut delay = now.along(&direction)?;
    if delay.abs() > LONGEST_DELAY {
        return None;
    }
    delay += now.without(model, signal, Fault::Delay(delay))?.along(&direction)?;
    with_delay(model, now, signal, delay)
}

fn with_delay(
    model: &Description,
    now: &Compared,
    signal: Signal,
    delay: f64,
) -> Option<(SignalFault, Compared)> {
    if !(LIMITS.shortest_delay..=LONGEST_DELAY).contains(&delay.abs()) {
        return None;
    }
    let fault = Fault::Delay(delay);
    accepted(now, now.without(model, signal, fault)?, signal, fault)
}

/// Acceptance of a fault. It must explain most of the difference of its own signal, if that is beyond its
/// limit, or else of two or more signals. It must not increase the difference of another signal.
fn accepted(
    now: &Compared,
    then: Compared,
    signal: Signal,
    fault: Fault,
) -> Option<(SignalFault, Compared)> {
    let (mut explains, mut is_increased) = (Vec::new(), false);
    for (of, before) in now.sizes() {
        let Some((_, after)) = then.sizes().find(|(signal, _)| *signal == of) else { continue };
        // several equally delayed signals count even within their limits
        let is_late =
            matches!(fault, Fault::Delay(_)) && now.difference(of).is_some_and(Difference::is_late);
        if (before > 1.0 || is_late) && after < LIMITS.most * before {
            explains.push(of);
        }
        is_increased |= after > 1.0 && after > LARGEST_INCREASE * before;
    }
    let is_own = now.difference(signal).is_some_and(is_beyond);
    let is_explained = match is_own {
        true => explains.contains(&signal),
        false => explains.len() >= 2,
    };
    let is_better = then.sum() < (1.0 - LIMITS.worthwhile) * now.sum();
    if is_increased || !is_explained || !is_better {
        return None;
    }
    let is_measured = |other: &&Signal| now.difference(**other).is_some();
    let against = beside(signal).iter().find(is_measured).copied();
    if against.is_some_and(|other| shows(fault, &now.pairs(other))) {
        return None;
    }
    let left = then.difference(signal).map(|d| d.rms);
    Some((SignalFault { signal, fault, left, against, explains }, then))
}

/// Sensors of nearly the same pressure, the nearest first: on the other side of an open valve, and the
/// supply of the low-pressure side.
fn beside(signal: Signal) -> &'static [Signal] {
    match signal {
        Signal::PressureA => &[Signal::PressurePumpA],
        Signal::PressurePumpA => &[Signal::PressureA],
        Signal::PressureB => &[Signal::PressurePumpB, Signal::PressureAccumulator],
        Signal::PressurePumpB => &[Signal::PressureB, Signal::PressureAccumulator],
        Signal::PressureAccumulator => &[Signal::PressurePumpB, Signal::PressureB],
        _ => &[],
    }
}

/// Whether a redundant pressure sensor shows the same fault.
fn shows(fault: Fault, pairs: &[(f64, f64)]) -> bool {
    let count = pairs.len().max(1) as f64;
    let share = match fault {
        Fault::Offset(own) => {
            pairs.iter().map(|(log, model)| log - model).sum::<f64>() / count / own
        }
        Fault::Scale(own) => {
            let (both, square) = pairs.iter().fold((0.0, 0.0), |(both, square), (log, model)| {
                (both + log * model, square + model * model)
            });
            if square > 0.0 { (both / square - 1.0) / (own - 1.0) } else { 0.0 }
        }
        Fault::Delay(_) => 0.0,
    };
    share > LIMITS.shared
}
