//! Experiment: a log prepared as the input of a model and as data for the comparison.

use crate::drive::Drive;
use crate::error::IdentifyError;
use crate::fault_isolation::Fault;
use crate::motor::MotorCommand;
use crate::noise::noise;
use crate::oscillation::{Release, final_value, is_held, release};
use crate::prediction::{INITIAL_VALUES, STEPS};
use hydroboom_description::Description;
use hydroboom_description::schema::CircuitChoice;
use hydroboom_measurement::{Measurement, Signal, Signals, Track};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Signals in which log and model are compared. They are the piston position \[m\] and the pressures \[Pa\] of the
/// pump's side A, chambers A and B, the pump's side B and the accumulator. The last one is the motor speed \[rev/s\],
/// as the drive's response to its command.
pub const COMPARED: [Signal; CRANE + 1] = {
    let [stroke, pump_a, a, b, pump_b, accumulator] = Signal::COMPARED;
    [stroke, pump_a, a, b, pump_b, accumulator, Signal::MotorSpeed]
};
/// Number of the crane's signals, which come first.
pub(crate) const CRANE: usize = Signal::COMPARED.len();

/// Part of a log that is used, in log time \[s\].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Window {
    /// Start \[s\]; the log's beginning if none.
    pub from: Option<f64>,
    /// End \[s\]; the log's end if none.
    pub to: Option<f64>,
}

impl Window {
    /// The window's part \[s\] of a log in which position and driving signal are measured from `first` to `last`, or
    /// the reason why there is none.
    fn within(&self, first: f64, last: f64, driving: Signal) -> Result<(f64, f64), String> {
        let begin = self.from.map_or(first, |from| from.max(first));
        let end = self.to.map_or(last, |to| to.min(last));
        if end <= begin {
            let place = match () {
                () if begin > last => "beyond the end of the log",
                () if end < first => "before the beginning of the log",
                () => "no time",
            };
            let requested = [(self.from, "from"), (self.to, "to")].into_iter();
            let requested: Vec<String> =
                requested.filter_map(|(at, word)| Some(format!("{word} {:.3} s", at?))).collect();
            return Err(format!(
                "{} is {place}: position and {} are measured from {first:.3} to {last:.3} s",
                requested.join(" "),
                driving.symbol()
            ));
        }
        Ok((begin, end))
    }
}

/// Measured values of all compared signals at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Time since the start of the experiment \[s\].
    pub time: f64,
    /// Compared signals in SI units, in the order of [`COMPARED`]; none for one that was not measured at that time.
    pub values: [Option<f64>; COMPARED.len()],
}

/// Log prepared for simulation and output-error estimation: the model's inputs, held constant over each control
/// period, the measured initial values, and samples for the comparison.
#[derive(Clone, Debug)]
pub struct Experiment {
    /// Name of the log.
    pub name: String,
    /// Log time at which the experiment starts \[s\].
    pub begin: f64,
    /// Inputs of the model.
    pub(crate) drive: Drive,
    /// Driving signal of the log: motor speed or its command, or valve command.
    pub driving: Signal,
    /// Command of the motor, if the log contains both command and speed and the model has a drive.
    pub(crate) motor_command: Option<MotorCommand>,
    /// Control period \[s\].
    pub(crate) period: f64,
    /// Control periods per sample.
    pub(crate) every: usize,
    /// Number of control periods over which the input is averaged: one, or all of a sample.
    pub(crate) merged: usize,
    /// Integration steps in that time.
    pub(crate) steps: u32,
    /// Measured samples on an even grid of [`interval`](Self::interval) \[s\].
    pub samples: Vec<Sample>,
    /// Time constants of the signals' filters \[s\].
    pub(crate) filters: [f64; COMPARED.len()],
    /// Measured initial values.
    pub(crate) initial_values: [Option<f64>; INITIAL_VALUES],
    /// Sampling interval of the log for each compared signal, then for the driving signal; zero for an
    /// input that is constant throughout \[s\].
    pub(crate) sampling_intervals: ([f64; COMPARED.len()], f64),
    /// Standard deviations of the compared signals' noise in SI units; zero if not measured.
    pub(crate) noise: [f64; COMPARED.len()],
    /// Remarks on the log in plain text, for the report: segments that are left out, for instance.
    pub remarks: Vec<String>,
    /// Request to stop every simulation of this experiment.
    pub(crate) stop: Arc<AtomicBool>,
}

/// Time grid of a model's inputs.
pub(crate) struct Times {
    /// Log time of its start \[s\].
    pub(crate) begin: f64,
    /// Duration of each input \[s\].
    pub(crate) period: f64,
    /// Number of inputs.
    pub(crate) count: usize,
}

impl Times {
    /// Grid of whole periods \[s\] from a beginning to an end \[s\].
    fn between(begin: f64, end: f64, period: f64) -> Self {
        let count = ((end - begin) / period).floor();
        Self { begin, period, count: count.clamp(0.0, 1e8) as usize }
    }
}

/// Input period for a crane file without a control period \[s\].
const INPUT_PERIOD: f64 = 1e-3;
/// Interval of the comparison \[s\]: a period of the boom's first mode has about a hundred samples, one of
/// the second about thirty.
const INTERVAL: f64 = 5e-3;
/// Time over which the initial values are determined \[s\].
const INITIAL_TIME: f64 = 0.05;
/// Velocity below which the crane is at rest \[m/s\].
const REST: f64 = 2e-3;
/// Remark on a log that begins in motion.
const IN_MOTION: &str =
    "it begins in motion, and the model at rest: the first seconds differ for that reason";
/// Largest number of omitted segments in a remark.
const MOST_LISTED: usize = 5;
/// Initial time at rest that counts as a start at rest \[s\].
const REST_TIME: f64 = 0.3;

impl Experiment {
    /// Experiment from a log's signals within a window, resampled by linear interpolation. An oscillation test with
    /// the load held starts at the release of the boom.
    ///
    /// # Errors
    ///
    /// [`IdentifyError::Measurement`] if the position or the driving signal is missing. [`IdentifyError::Log`] if less
    /// than 100 control periods of both are within the window.
    pub fn new(
        model: &Description,
        log: &Measurement,
        signals: &Signals,
        window: Window,
    ) -> Result<Self, IdentifyError> {
        let wrong = |reason: String| IdentifyError::Log { log: log.name.clone(), reason };
        let mut remarks = Vec::new();
        let position = signals.need(Signal::Stroke, log)?;
        let driving = Drive::signal(model, log, signals, &mut remarks)?;
        let (first, last) = signals.overlap(&[Signal::Stroke, driving]).ok_or_else(|| {
            let symbol = driving.symbol();
            wrong(format!("position and {symbol} were never measured at the same time"))
        })?;
        let (begin, end) = window.within(first, last, driving).map_err(wrong)?;
        let period = input_period(model);
        let times = |begin: f64| Times::between(begin, end, period);
        // an oscillation test begins at the release of the boom, and its equilibrium is the final value
        let mut said = Vec::new();
        let whole = Drive::new(model, driving, signals, &times(begin), &mut said);
        let release = match is_held(&whole) {
            true => release(signals, begin, end),
            false => None,
        };
        remarks.extend(release.map(Release::remark));
        let begin = release.map_or(begin, |release| release.time);
        let count = ((end - begin) / period).floor();
        if !(100.0..1e8).contains(&count) {
            let reason = format!(
                "{:.3} to {:.3} s is left of it ({first:.3} to {last:.3} s); at least a tenth of a second is needed",
                begin, end
            );
            return Err(wrong(reason));
        }
        let drive = Drive::new(model, driving, signals, &times(begin), &mut remarks);
        let every = (INTERVAL / period).round().max(1.0) as usize;
        let motor_command = MotorCommand::new(model, signals, &times(begin));
        let mut tracks = COMPARED.map(|signal| signals.get(signal));
        if motor_command.is_none() {
            tracks[CRANE] = None;
        }
        let sample = |k: usize| {
            let time = k as f64 * period;
            Sample { time, values: tracks.map(|t| t.and_then(|t| t.at(begin + time))) }
        };
        let beginnings = tracks.map(|track| match release {
            Some(_) => final_value(track?, begin, end),
            None => initial_value(track?, begin),
        });
        let [stroke, ..] = beginnings;
        let stroke =
            stroke.ok_or_else(|| wrong(format!("no position at its beginning, {begin:.3} s")))?;
        let later = position.at(begin + REST_TIME);
        let is_moving =
            release.is_none() && later.is_some_and(|x| (x - stroke).abs() > REST * REST_TIME);
        remarks.extend(is_moving.then(|| IN_MOTION.to_string()));
        let initial_values = initial_values(model, beginnings, release);
        let driven = match is_held(&drive) {
            true => 0.0,
            false => signals.get(driving).map_or(0.0, Track::interval),
        };
        Ok(Self {
            name: log.name.clone(),
            begin,
            sampling_intervals: (tracks.map(|track| track.map_or(0.0, Track::interval)), driven),
            drive,
            driving,
            motor_command,
            period,
            every,
            merged: 1,
            steps: STEPS,
            samples: (0..=count as usize).step_by(every).map(sample).collect(),
            filters: tracks.map(|track| track.map_or(0.0, Track::filter)),
            initial_values,
            noise: tracks.map(|track| track.map_or(0.0, |track| noise(track, begin, end))),
            remarks,
            stop: Arc::default(),
        })
    }

    /// Ends every simulation of this experiment within milliseconds once the flag is set, and with it a fit, by
    /// [`IdentifyError::Stopped`]. Otherwise a fit asks between its cost evaluations only, and the derivatives of a
    /// long log take a minute.
    pub fn stop_by(&mut self, stop: &Arc<AtomicBool>) {
        self.stop = Arc::clone(stop);
    }

    /// Whether its simulations are to stop.
    pub(crate) fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Experiments from a log's signals within a window, one per segment. Clock jumps and gaps are not
    /// simulated: the model starts again after them.
    ///
    /// # Errors
    ///
    /// [`IdentifyError::Measurement`] if the position or the driving signal is missing, [`IdentifyError::Log`] if no
    /// segment is long enough.
    pub fn each(
        model: &Description,
        log: &Measurement,
        signals: &Signals,
        window: Window,
    ) -> Result<Vec<Self>, IdentifyError> {
        let driving = Drive::signal(model, log, signals, &mut Vec::new())?;
        let begin = window.from.unwrap_or(f64::NEG_INFINITY);
        let end = window.to.unwrap_or(f64::INFINITY);
        let parts = signals.segments(driving, &[Signal::Stroke]).into_iter();
        let parts = parts.map(|(from, to)| (from.max(begin), to.min(end)));
        let parts: Vec<(f64, f64)> = parts.filter(|(from, to)| from < to).collect();
        if parts.len() < 2 {
            return Ok(vec![Self::new(model, log, signals, window)?]);
        }
        let (mut found, mut left_out, mut error) = (Vec::new(), Vec::new(), None);
        for (k, (from, to)) in parts.iter().enumerate() {
            let part = Window { from: Some(*from), to: Some(*to) };
            match Self::new(model, log, signals, part) {
                Ok(mut experiment) => {
                    experiment.name = format!("{}, segment {}", experiment.name, k + 1);
                    experiment.remarks.insert(
                        0,
                        format!(
                            "segment {} of {}, {from:.3} to {to:.3} s: the model begins anew",
                            k + 1,
                            parts.len()
                        ),
                    );
                    found.push(experiment);
                }
                // too short, or without an initial position
                Err(reason) => {
                    left_out.push(format!("{from:.3} to {to:.3} s"));
                    error = Some(reason);
                }
            }
        }
        match (found.first_mut(), error) {
            (None, Some(reason)) => return Err(reason),
            (Some(first), Some(reason)) => {
                let more = left_out.len().saturating_sub(MOST_LISTED);
                let more = if more > 0 { format!(" and {more} more") } else { String::new() };
                let named: Vec<String> = left_out.into_iter().take(MOST_LISTED).collect();
                first.remarks.push(format!(
                    "segments that are left out: {}{more} ({reason})",
                    named.join(", ")
                ));
            }
            _ => {}
        }
        Ok(found)
    }

    /// The same with steps of a control period: accurate enough to find the optimum, but not for its
    /// uncertainty.
    pub(crate) fn coarse(&self) -> Self {
        Self { steps: 1, ..self.clone() }
    }

    /// The same with one input per sample and two steps in it: accurate enough for derivatives that only
    /// widen an interval.
    pub(crate) fn rough(&self) -> Self {
        Self { merged: self.every, steps: 2, ..self.clone() }
    }

    /// The same with steps of half the length, whose effect measures the integration error.
    pub(crate) fn fine(&self) -> Self {
        Self { steps: 2 * self.steps, ..self.clone() }
    }

    /// The log corrected for a fault of a signal: samples, initial values and inputs.
    pub(crate) fn corrected(&self, signal: Signal, fault: Fault) -> Self {
        let mut other = self.clone();
        if let Some(place) = COMPARED.iter().position(|s| *s == signal) {
            let values: Vec<Option<f64>> = self.samples.iter().map(|s| s.values[place]).collect();
            let zero = match signal {
                Signal::Stroke => values.iter().find_map(|v| *v).unwrap_or(0.0),
                _ => 0.0,
            };
            let read = |v: f64| match fault {
                Fault::Offset(off) => v - off,
                Fault::Scale(factor) => zero + (v - zero) / factor,
                Fault::Delay(_) => v,
            };
            for (k, sample) in other.samples.iter_mut().enumerate() {
                sample.values[place] = match fault {
                    Fault::Delay(late) => between(&values, k as f64 + late / self.interval()),
                    _ => values[k].map(read),
                };
            }
            for (begun, channel) in other.initial_values.iter_mut().zip(self.initial_channels()) {
                if channel == Some(place) {
                    *begun = begun.map(read);
                }
            }
        }
        if let Fault::Delay(late) = fault {
            other.drive = self.drive.later(signal, late / self.period);
        }
        other
    }

    /// Duration of the simulated experiment \[s\].
    pub fn duration(&self) -> f64 {
        self.drive.len() as f64 * self.period
    }

    /// Sampling interval of the comparison \[s\], a whole number of control periods: about 5 ms.
    pub fn interval(&self) -> f64 {
        self.every as f64 * self.period
    }

    /// Standard deviation of a compared signal's sensor noise in its SI unit, estimated from the log's samples; none
    /// if it was not measured.
    pub fn noise(&self, signal: Signal) -> Option<f64> {
        let place = COMPARED.iter().position(|s| *s == signal)?;
        self.is_measured(signal).then_some(self.noise[place])
    }

    /// Measured initial value of a compared signal in its SI unit. None if it was not measured, or is no initial value
    /// of the simulation, as the load-carrying pressure p_A of a pump-controlled crane, which follows from
    /// equilibrium.
    pub fn begun(&self, signal: Signal) -> Option<f64> {
        let channels = self.initial_channels();
        let of = |channel: &Option<usize>| channel.is_some_and(|k| COMPARED[k] == signal);
        self.initial_values[channels.iter().position(of)?]
    }

    /// Whether at least one sample contains a value of the signal; false for a signal that is not compared.
    pub fn is_measured(&self, signal: Signal) -> bool {
        let place = COMPARED.iter().position(|s| *s == signal);
        place.is_some_and(|k| self.samples.iter().any(|s| s.values[k].is_some()))
    }

    /// Index of the compared signal from which each initial value was taken.
    pub(crate) fn initial_channels(&self) -> [Option<usize>; INITIAL_VALUES] {
        match self.drive {
            Drive::Pump(_) => [Some(0), Some(1), Some(3), Some(4), Some(5), None],
            Drive::Valve(..) => [Some(0), Some(2), Some(3), None, None, None],
        }
    }

    /// Input at a sample, scaled so that a steady input changes by less than one per second.
    pub(crate) fn driving(&self, sample: usize) -> f64 {
        self.drive.driving((sample * self.every).min(self.drive.len() - 1))
    }
}

/// Linear interpolation at a fractional index; none next to a missing sample, and beyond the ends.
fn between(values: &[Option<f64>], at: f64) -> Option<f64> {
    let before = at.floor();
    let share = at - before;
    let sample = |k: f64| values.get((k >= 0.0).then_some(k as usize)?).copied().flatten();
    let first = sample(before)?;
    if share <= 0.0 {
        return Some(first);
    }
    Some(first + share * (sample(before + 1.0)? - first))
}

/// Duration of each input of a model \[s\].
fn input_period(model: &Description) -> f64 {
    match model.choices.circuit {
        CircuitChoice::SelfContained => model.numbers.control_period,
        CircuitChoice::ValveControlled => INPUT_PERIOD,
    }
}

/// Initial values of a simulation from those of the compared signals.
fn initial_values(
    model: &Description,
    beginnings: [Option<f64>; COMPARED.len()],
    release: Option<Release>,
) -> [Option<f64>; INITIAL_VALUES] {
    let [stroke, pump_a, piston_side, rod_side, pump_b, accumulator, _] = beginnings;
    let stroke = stroke.map(|stroke| stroke.clamp(0.0, model.numbers.stroke));
    match model.choices.circuit {
        CircuitChoice::SelfContained => {
            let deflection = release.map(|release| release.deflection);
            [stroke, pump_a, rod_side, pump_b, accumulator, deflection]
        }
        CircuitChoice::ValveControlled => [stroke, piston_side, rod_side, None, None, None],
    }
}

/// Initial value of a signal by linear regression over its first samples, because a pump side leaks by bars
/// per second and its sensor is noisy.
fn initial_value(track: &Track, begin: f64) -> Option<f64> {
    let there = track.time().iter().zip(track.values());
    let there: Vec<(f64, f64)> = there
        .filter(|(t, _)| (begin..=begin + INITIAL_TIME).contains(*t))
        .map(|(t, v)| (t - begin, *v))
        .collect();
    if there.len() < 3 {
        return track.at(begin);
    }
    let count = there.len() as f64;
    let (t, v) = there.iter().fold((0.0, 0.0), |(t, v), s| (t + s.0 / count, v + s.1 / count));
    let (along, square) = there
        .iter()
        .fold((0.0, 0.0), |(a, q), s| (a + (s.0 - t) * (s.1 - v), q + (s.0 - t).powi(2)));
    Some(v - t * along / square)
}
