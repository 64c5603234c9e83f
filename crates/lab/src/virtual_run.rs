//! Run of the virtual crane, logged as by the data acquisition of a real crane.

use crate::LabError;
use crate::closed_loop::metrics::{Metrics, SustainedOscillation, TrackingError};
use crate::closed_loop::sample::Sample;
use crate::closed_loop::scenario::Course;
use crate::closed_loop::simulation::{Case, simulate_cases, simulate_closed_loop};
use crate::closed_loop::sustained_oscillation::sustained_oscillation;
use crate::log::Log;
use crate::run_log::{header, row};
use crate::simulate::Recording;
use crate::virtual_estimates::{EstimateSummary, ParallelEstimator};
use hydroboom_control::command::AxisCommand;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_files::FileError;
use hydroboom_virtual_crane::VirtualCrane;
use serde::Serialize;
use std::path::Path;

/// Input or course of the virtual crane in a run.
#[derive(Clone)]
pub enum Task<'a> {
    /// Course under one of the strategies, which use the model only.
    Course(&'a dyn Course, Strategy),
    /// A recorded input.
    Recording(Recording),
    /// Locked-valve oscillation test: the tip is dropped from a height at a piston position.
    Oscillation {
        /// Piston position \[m\].
        stroke: f64,
        /// Height of the tip above rest \[m\].
        drop: f64,
    },
}

/// Duration of the oscillation test \[s\].
const OSCILLATION: f64 = 4.0;

impl Task<'_> {
    /// Duration of the run \[s\].
    fn duration(&self) -> f64 {
        match self {
            Self::Course(course, _) => course.duration(),
            Self::Recording(recording) => recording.duration(),
            Self::Oscillation { .. } => OSCILLATION,
        }
    }
}

/// Columns of a log: measured signals, true states, or both.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contents {
    /// Signals that a data acquisition measures.
    Readings,
    /// Measured signals and true states.
    Truth,
    /// True states only.
    TruthAlone,
}

impl Contents {
    pub(crate) fn readings(self) -> bool {
        self != Self::TruthAlone
    }
    pub(crate) fn truth(self) -> bool {
        self != Self::Readings
    }
}

/// Log to be written by a run.
#[derive(Clone, Copy, Debug)]
pub struct LogOrder<'a> {
    /// Path of the file.
    pub path: &'a Path,
    /// Measured signals, true states, or both.
    pub contents: Contents,
    /// Whether the log includes the state estimator's outputs.
    pub estimates: bool,
    /// Interval between rows \[s\], rounded to whole control periods, at least one.
    pub interval: f64,
}

/// Results at the end of a run of the virtual crane.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Summary {
    /// Duration of the run \[s\].
    pub duration_s: f64,
    /// Tracking error; NaN for a recorded input.
    #[serde(flatten)]
    pub error: TrackingError,
    /// Whether the piston came to rest where its reference rested; none for a recorded input.
    pub stable: Option<bool>,
    /// Sustained oscillation while the reference rested, and after the course's end if it may have begun
    /// there.
    pub sustained_oscillation: Option<SustainedOscillation>,
    /// True piston position at the end \[mm\].
    pub stroke_mm: f64,
    /// True piston-side pressure at the end \[bar\], gauge.
    pub pressure_a_bar: f64,
    /// Largest magnitude of the motor torque over the run \[N m\].
    pub torque_nm: f64,
    /// Oil temperature at the end \[°C\].
    pub oil_c: f64,
    /// Estimates of the state estimator at the end; none for a crane without such a design.
    pub estimates: Option<EstimateSummary>,
}

/// Simulates the virtual crane in a task and writes the requested logs. Returns the summary, and the logs that could
/// not be written with the reasons. `progress` receives the share done, 0 to 1.
///
/// # Errors
///
/// [`LabError::Plant`] if the crane has no state of rest at the start; [`LabError::Simulation`] if a state leaves the
/// model's range of validity; for a course also those of [`simulate_closed_loop`].
pub fn virtual_run(
    model: &Description,
    crane: &Description,
    task: &Task,
    logs: &[LogOrder<'_>],
    mut progress: impl FnMut(f64),
) -> Result<(Summary, Vec<FileError>), LabError> {
    let period = crane.numbers.control_period;
    let (loads, is_released) = match task {
        Task::Course(course, _) => (course.loads(), true),
        Task::Recording(recording) => (&[][..], recording.at(0.0).holding_valve >= 0.5),
        Task::Oscillation { .. } => (&[][..], false),
    };
    let mut estimator = ParallelEstimator::new(model, crane, loads, is_released);
    let has_reference = matches!(task, Task::Course(..));
    let mut writers = Vec::with_capacity(logs.len());
    for order in logs {
        let mut header = header(order.contents, has_reference);
        let estimates = order.estimates && estimator.is_some();
        if estimates {
            header.extend(ParallelEstimator::header());
        }
        let log = Log::begin(order.path, &header);
        let every = (order.interval / period).round().max(1.0) as u64;
        writers.push((log, order.contents, estimates, every));
    }
    let duration = task.duration();
    let mut summary = Summary { duration_s: duration, ..Summary::default() };
    let (mut metrics, mut count) = (Metrics::new(), 0_u64);
    let mut observe = |sample: &Sample| {
        if let Some(estimator) = &mut estimator {
            estimator.see(sample);
        }
        for (log, contents, estimates, every) in &mut writers {
            if count % *every == 0 {
                let mut row = row(*contents, has_reference, sample);
                if let Some(estimator) = estimator.as_ref().filter(|_| *estimates) {
                    row.extend(estimator.row());
                }
                log.row(&row);
            }
        }
        summary.add(sample);
        metrics.add(sample);
        count += 1;
        if count % 1000 == 0 {
            progress(sample.time / duration);
        }
        Ok(())
    };
    simulate_task(model, crane, task, &mut observe)?;
    if let Task::Course(course, strategy) = task {
        let found = sustained_oscillation(model, crane, (*strategy).into(), *course, &metrics)?;
        summary.finish(&metrics, found);
    }
    summary.estimates = estimator.and_then(|estimator| estimator.summary());
    let lost = writers.into_iter().filter_map(|(log, ..)| log.finish().err()).collect();
    Ok((summary, lost))
}

/// Simulates the virtual crane in a task.
fn simulate_task(
    model: &Description,
    crane: &Description,
    task: &Task,
    observe: &mut dyn FnMut(&Sample) -> Result<(), LabError>,
) -> Result<(), LabError> {
    match task {
        Task::Course(course, strategy) => {
            simulate_closed_loop(model, crane, *strategy, *course, observe)
        }
        Task::Recording(recording) => {
            let mut start = crane.start(crane.numbers.motion_start);
            if recording.at(0.0).holding_valve < 0.5 {
                start.preload = 0.0;
            }
            let real = VirtualCrane::new(crane, &start)?;
            let command = |time| {
                let input = recording.at(time);
                AxisCommand { motor_speed: input.pump_speed, holding_valve: input.holding_valve }
            };
            follow(real, task.duration(), command, observe)
        }
        Task::Oscillation { stroke, drop } => {
            let mut start = crane.start(*stroke);
            start.rod_side_pressure = crane.numbers.oscillation_rod_side;
            start.preload = 0.0;
            let mut real = VirtualCrane::new(crane, &start)?;
            real.lift(drop / crane.numbers.boom_length)
                .map_err(LabError::during("lifting the boom"))?;
            let held = AxisCommand { motor_speed: 0.0, holding_valve: 0.0 };
            follow(real, task.duration(), |_| held, observe)
        }
    }
}

/// Summaries of all strategies along a course, simulated together; `progress` receives the share done.
///
/// # Errors
///
/// See [`simulate_closed_loop`]; the first strategy that fails ends all.
pub fn strategies(
    model: &Description,
    crane: &Description,
    course: &dyn Course,
    mut progress: impl FnMut(f64),
) -> Result<Vec<(Strategy, Summary)>, LabError> {
    let duration = course.duration();
    let cases = Strategy::ALL.map(|strategy| Case { crane, controller: strategy.into(), course });
    let mut gathered =
        cases.map(|_| (Summary { duration_s: duration, ..Summary::default() }, Metrics::new()));
    let mut count = 0_u64;
    let ends = simulate_cases(model, &cases, |lane, sample| {
        let (summary, metrics) = &mut gathered[lane];
        summary.add(sample);
        metrics.add(sample);
        count += 1;
        if count.is_multiple_of(10_000) {
            progress(sample.time / duration);
        }
    });
    let mut results = Vec::with_capacity(Strategy::ALL.len());
    for ((strategy, end), (mut summary, metrics)) in
        Strategy::ALL.into_iter().zip(ends).zip(gathered)
    {
        end?;
        let found = sustained_oscillation(model, crane, strategy.into(), course, &metrics)?;
        summary.finish(&metrics, found);
        results.push((strategy, summary));
    }
    Ok(results)
}

impl Summary {
    fn add(&mut self, sample: &Sample) {
        let truth = &sample.truth;
        self.stroke_mm = truth.outputs.stroke * 1e3;
        self.pressure_a_bar = truth.outputs.pressure_a * 1e-5;
        self.torque_nm = self.torque_nm.max(truth.motor_torque.abs());
        self.oil_c = truth.oil_temperature;
    }

    fn finish(&mut self, metrics: &Metrics, found: Option<SustainedOscillation>) {
        self.error = metrics.tracking_error();
        self.stable = Some(found.is_none());
        self.sustained_oscillation = found;
    }
}

/// Sends commands that are a function of time only.
fn follow(
    mut real: VirtualCrane,
    duration: f64,
    command: impl Fn(f64) -> AxisCommand<f64>,
    observe: &mut dyn FnMut(&Sample) -> Result<(), LabError>,
) -> Result<(), LabError> {
    let period = real.period();
    let periods = (duration / period).round() as u64;
    for k in 0..=periods {
        let time = k as f64 * period;
        let command = command(time);
        let reading = real.signals();
        // without a reference the error is defined as zero
        let reference = SetPoint { position: reading.stroke, velocity: 0.0 };
        observe(&Sample {
            time,
            reference,
            signals: reading,
            load_changed: false,
            truth: real.truth(),
            command,
            periods_without_solution: 0,
        })?;
        if k < periods {
            real.advance(&command).map_err(LabError::during("virtual crane"))?;
        }
    }
    Ok(())
}
