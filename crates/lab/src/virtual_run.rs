//! The virtual crane at work, logged as a real crane's data acquisition would.

use crate::LabError;
use crate::log::{Log, columns, scaled};
use crate::motion_test::{Sample, Strategy, steer};
use crate::simulate::Recording;
use hydroboom_control::{Motion, Reference};
use hydroboom_description::Description;
use hydroboom_model::Outputs;
use hydroboom_virtual_crane::{Command, Reading, Truth, VirtualCrane};
use serde::Serialize;
use std::path::Path;

/// What the virtual crane is told.
#[derive(Clone, Debug)]
pub enum Task {
    /// A motion under one of the strategies, which know the model only.
    Motion(Motion<f64>, Strategy),
    /// A recorded input.
    Recording(Recording),
}

/// What a log holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contents {
    /// What a data acquisition would see.
    Readings,
    /// The hidden states too.
    Truth,
}

/// A run in short.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Summary {
    /// Duration.
    pub duration_s: f64,
    /// RMS tracking error as read; none for a recorded input.
    pub rms_mm: Option<f64>,
    /// Peak tracking error as read.
    pub peak_mm: Option<f64>,
    /// Piston position at the end, truly.
    pub stroke_mm: f64,
    /// Pressure on the piston side at the end, truly.
    pub pressure_a_bar: f64,
    /// Largest torque of the motor.
    pub torque_nm: f64,
    /// Oil temperature at the end.
    pub oil_c: f64,
}

/// Runs the virtual crane and logs it once each control period; `progress` is told the share done.
///
/// # Errors
///
/// [`LabError`] when the crane cannot be simulated or the log cannot be written.
pub fn virtual_run(
    model: &Description,
    crane: &Description,
    task: &Task,
    log: Option<(&Path, Contents)>,
    mut progress: impl FnMut(f64),
) -> Result<Summary, LabError> {
    let mut writer = match log {
        Some((path, contents)) => Some((Log::begin(path, &header(contents, task))?, contents)),
        None => None,
    };
    let duration = match task {
        Task::Motion(motion, _) => motion.duration(),
        Task::Recording(recording) => recording.duration(),
    };
    let mut summary = Summary { duration_s: duration, ..Summary::default() };
    let (mut square, mut peak, mut count) = (0.0, 0.0_f64, 0_u64);
    let mut observe = |sample: &Sample| {
        if let Some((log, contents)) = &mut writer {
            log.row(&row(*contents, task, sample))?;
        }
        let truth = &sample.truth;
        summary.stroke_mm = truth.outputs.stroke * 1e3;
        summary.pressure_a_bar = truth.outputs.pressure_a * 1e-5;
        summary.torque_nm = summary.torque_nm.max(truth.motor_torque.abs());
        summary.oil_c = truth.oil_temperature;
        let error = sample.error();
        (square, count) = (square + error * error, count + 1);
        if error.abs() > peak.abs() {
            peak = error;
        }
        if count % 1000 == 0 {
            progress(sample.time / duration);
        }
        Ok(())
    };
    match task {
        Task::Motion(motion, strategy) => steer(model, crane, *strategy, motion, &mut observe)?,
        Task::Recording(recording) => follow(crane, recording, &mut observe)?,
    }
    if matches!(task, Task::Motion(..)) {
        summary.rms_mm = Some((square / count.max(1) as f64).sqrt() * 1e3);
        summary.peak_mm = Some(peak * 1e3);
    }
    writer.map_or(Ok(()), |(log, _)| log.finish())?;
    Ok(summary)
}

/// Sends a recorded input to the crane.
fn follow(
    crane: &Description,
    recording: &Recording,
    observe: &mut dyn FnMut(&Sample) -> Result<(), LabError>,
) -> Result<(), LabError> {
    let mut start = crane.start(crane.numbers.motion_start);
    if recording.at(0.0).holding_valve < 0.5 {
        start.preload = 0.0;
    }
    let mut real = VirtualCrane::new(crane, &start)?;
    let period = crane.numbers.control_period;
    let periods = (recording.duration() / period).round() as u64;
    for k in 0..=periods {
        let time = k as f64 * period;
        let input = recording.at(time);
        let command = Command { motor_speed: input.pump_speed, holding_valve: input.holding_valve };
        let reading = real.reading();
        // there is no reference to be away from
        let reference = Reference { position: reading.stroke, velocity: 0.0 };
        observe(&Sample { time, reference, reading, truth: real.truth(), command })?;
        if k < periods {
            real.advance(&command).map_err(LabError::during("recorded input"))?;
        }
    }
    Ok(())
}

fn header(contents: Contents, task: &Task) -> Vec<String> {
    let mut header = vec!["time_s".to_string()];
    if matches!(task, Task::Motion(..)) {
        header.extend(columns(&Reference::NAMES, &Reference::UNITS, "reference_"));
    }
    header.extend(columns(&Command::NAMES, &Command::UNITS, "command_"));
    header.extend(columns(&Reading::NAMES, &Reading::UNITS, ""));
    if contents == Contents::Truth {
        header.extend(columns(&Outputs::NAMES, &Outputs::UNITS, "true_"));
        header.extend(columns(&Truth::NAMES, &Truth::UNITS, "true_"));
    }
    header
}

fn row(contents: Contents, task: &Task, sample: &Sample) -> Vec<f64> {
    let mut row = vec![sample.time];
    if matches!(task, Task::Motion(..)) {
        row.extend(scaled(&sample.reference.to_array(), &Reference::UNITS));
    }
    row.extend(scaled(&sample.command.to_array(), &Command::UNITS));
    row.extend(scaled(&sample.reading.to_array(), &Reading::UNITS));
    if contents == Contents::Truth {
        row.extend(scaled(&sample.truth.outputs.to_array(), &Outputs::UNITS));
        row.extend(scaled(&sample.truth.beside_outputs(), &Truth::UNITS));
    }
    row
}
