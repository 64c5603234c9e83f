//! Open-loop simulation of a crane under a given input, written as CSV.

use crate::closed_loop::scenario::{Course, due};
use crate::log::{self, Log};
use crate::{LabError, Plant, plant};
use hydroboom_description::Description;
use hydroboom_files::FileError;
use hydroboom_model::{Flows, Input, Outputs, Scheme};
use std::path::Path;

/// Longest recorded input \[B\]: one day of rows every 10 ms.
const LONGEST: u64 = 500_000_000;

/// Recorded input of motor speed \[rev/s\] and load-holding valve, each constant until the next row (zero-order hold).
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    rows: Vec<(f64, Input<f64>)>,
}

/// Input of an open-loop simulation.
pub enum Drive {
    /// Velocity feedforward along a course with its load changes.
    Course(Box<dyn Course>),
    /// A recorded input.
    Recording(Recording),
    /// A constant motor speed \[rev/s\] and valve for a duration \[s\].
    Constant(Input<f64>, f64),
}

/// Initial state, integration and log of an open-loop simulation.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Initial piston position \[m\].
    pub start_stroke: f64,
    /// Integration scheme, with which the crane is simulated.
    pub scheme: Scheme,
    /// Integration step \[s\].
    pub step: f64,
    /// Interval between rows of the log \[s\], rounded to whole integration steps, at least one.
    pub log_interval: f64,
    /// Whether the simulation starts with an open load-holding valve and the pump side pre-loaded as the crane file
    /// states; otherwise the pre-load is zero.
    pub preloaded: bool,
}

impl Recording {
    /// Reads a recorded input from a CSV file with the columns `time_s`, `motor_speed_rpm` and, if present, `valve` (1
    /// is energised). Without a valve column the valve is energised.
    ///
    /// # Errors
    ///
    /// [`LabError::Files`] if the file cannot be read or is too long. [`LabError::Input`] with the line and column of
    /// an invalid entry: no finite number, a valve outside 0 to 1, a speed beyond ±100 000 rpm, or a time that does
    /// not increase. The same if a column is missing, or there are fewer than two rows.
    pub fn read(path: &Path) -> Result<Self, LabError> {
        let name = path.display().to_string();
        let file = hydroboom_files::bytes(path, "recorded input", LONGEST)?;
        let wrong = |reason: String| LabError::Input { file: name.clone(), reason };
        let mut reader =
            csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(file.as_slice());
        let headers =
            reader.headers().map_err(|e| wrong(format!("cannot be read as CSV: {e}")))?.clone();
        let column = |wanted: &str| headers.iter().position(|h| h == wanted);
        let found = headers.iter().collect::<Vec<_>>().join(", ");
        let need = |wanted: &str| {
            column(wanted).ok_or_else(|| {
                wrong(format!(
                    "no column `{wanted}`; expected time_s, motor_speed_rpm and optionally valve \
                     (0 or 1), found: {found}"
                ))
            })
        };
        let (time, speed, valve) = (need("time_s")?, need("motor_speed_rpm")?, column("valve"));
        let mut rows: Vec<(f64, Input<f64>)> = Vec::new();
        for (index, record) in reader.records().enumerate() {
            let line = index + 2;
            let record = record.map_err(|e| wrong(format!("line {line}: {e}")))?;
            let number = |column: usize| -> Result<f64, LabError> {
                let text = record.get(column).unwrap_or("");
                text.parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(|| {
                    let header = headers.get(column).unwrap_or("");
                    wrong(format!("line {line}, `{header}`: \"{text}\" is not a finite number"))
                })
            };
            let holding_valve = valve.map_or(Ok(1.0), number)?;
            if !(0.0..=1.0).contains(&holding_valve) {
                return Err(wrong(format!(
                    "line {line}: the valve is 0 to 1, not {holding_valve}"
                )));
            }
            let (t, rpm) = (number(time)?, number(speed)?);
            if rpm.abs() > 1e5 {
                return Err(wrong(format!("line {line}: {rpm} rpm; is the column in rpm?")));
            }
            if rows.last().is_some_and(|(last, _)| *last >= t) {
                return Err(wrong(format!("line {line}: time does not increase at {t} s")));
            }
            rows.push((t, Input { pump_speed: rpm / 60.0, holding_valve }));
        }
        if rows.len() < 2 {
            return Err(wrong("fewer than two rows".into()));
        }
        Ok(Self { rows })
    }

    /// Duration from the first row to the last \[s\].
    pub fn duration(&self) -> f64 {
        self.rows[self.rows.len() - 1].0 - self.rows[0].0
    }

    /// Input at a time \[s\] since the first row: that of the last row up to this time. Before the first row it is the
    /// first, after the last row the last.
    pub fn at(&self, time: f64) -> Input<f64> {
        let first = self.rows[0].0;
        let next = self.rows.partition_point(|(t, _)| *t <= first + time);
        self.rows[next.saturating_sub(1)].1
    }
}

/// Names and values of the states that are not outputs: angles, angular velocities, bristle.
fn hidden_states(crane: &dyn Plant) -> impl Iterator<Item = (String, f64)> {
    let named = crane.state_names().into_iter().zip(crane.state_vector());
    named.filter(|(name, _)| name.starts_with("ang") || name.starts_with("bristle"))
}

/// Header of the log.
fn header(crane: &dyn Plant) -> Vec<String> {
    let mut header = vec!["time_s".to_string(), "motor_speed_rpm".into(), "valve".into()];
    header.extend(log::columns(&Outputs::NAMES, &Outputs::UNITS, ""));
    header.extend(log::columns(&Flows::NAMES, &Flows::UNITS, "flow_"));
    header.extend(
        hydroboom_model::energy::Energy::NAMES.iter().map(|name| format!("energy_{name}_j")),
    );
    header.extend(hidden_states(crane).map(|(name, _)| name));
    header
}

fn log_row(crane: &dyn Plant, input: &Input<f64>) -> Vec<f64> {
    let mut row = vec![crane.time(), input.pump_speed * 60.0, input.holding_valve];
    row.extend(log::scaled(&crane.outputs().to_array(), &Outputs::UNITS));
    row.extend(log::scaled(&crane.flows(input).to_array(), &Flows::UNITS));
    row.extend(crane.energy().to_array());
    row.extend(hidden_states(crane).map(|(_, value)| value));
    row
}

/// Result of an open-loop simulation.
pub struct Simulated {
    /// The crane in its final state.
    pub crane: Box<dyn Plant>,
    /// Largest magnitude of the motor speed \[rev/s\]. The input has no limit.
    pub largest_motor_speed: f64,
    /// Largest gauge pressure in a chamber or on a side of the pump \[Pa\].
    pub peak_pressure: f64,
    /// Error of writing the requested log; success if none was requested.
    pub log: Result<(), FileError>,
}

/// Simulates a crane under a given input and writes a log, a row per `log_interval` rounded to whole steps. `progress`
/// receives the share done, 0 to 1. An error of writing the log does not stop the simulation.
///
/// # Errors
///
/// [`LabError::Plant`] if the crane has no state of rest, or cannot take a payload; [`LabError::Step`] if the step is
/// longer than the run; [`LabError::Simulation`] if a state leaves the model's range of validity.
pub fn simulate(
    description: &Description,
    drive: &Drive,
    settings: &Settings,
    log: Option<&Path>,
    mut progress: impl FnMut(f64),
) -> Result<Simulated, LabError> {
    let mut start = description.start(settings.start_stroke);
    if !settings.preloaded {
        start.preload = 0.0;
    };
    let mut crane = plant(description, &start, settings.scheme, settings.step)?;
    let controller = description.benchmark();
    let duration = match drive {
        Drive::Recording(recording) => recording.duration(),
        Drive::Constant(_, duration) => *duration,
        Drive::Course(course) => course.duration(),
    };
    let input_at = |time: f64| match drive {
        Drive::Recording(recording) => recording.at(time),
        Drive::Constant(input, _) => *input,
        Drive::Course(course) => Input {
            pump_speed: controller.velocity_feedforward(&course.reference(time)),
            holding_valve: 1.0,
        },
    };
    // zero-order hold of the course's value at mid-step; with the value at its start the input would lag by
    // half a step
    let held_from = |time: f64| match drive {
        Drive::Course(_) => input_at(time + 0.5 * settings.step),
        _ => input_at(time),
    };
    let mut loads = match drive {
        Drive::Course(course) => course.loads(),
        _ => &[],
    };

    if settings.step > duration {
        return Err(LabError::Step { step_us: settings.step * 1e6, duration_s: duration });
    }
    let mut log = log.map(|path| Log::begin(path, &header(crane.as_ref())));
    let (mut largest_motor_speed, mut peak_pressure) = (0.0_f64, highest(&crane.outputs()));
    let steps = (duration / settings.step).round() as u64;
    let every = (settings.log_interval / settings.step).round().max(1.0) as u64;
    for k in 0..=steps {
        let time = k as f64 * settings.step;
        let input = input_at(time);
        if let Some(mass) = due(&mut loads, time) {
            let mut heavier = description.clone();
            heavier.numbers.payload = mass;
            crane.set_parameters(&heavier)?;
        }
        if k % every == 0 {
            if let Some(log) = &mut log {
                log.row(&log_row(crane.as_ref(), &input));
            }
            progress(k as f64 / steps.max(1) as f64);
        }
        if k < steps {
            let held = held_from(time);
            crane.advance(&held, 1).map_err(LabError::during("simulation"))?;
            largest_motor_speed = largest_motor_speed.max(held.pump_speed.abs());
            peak_pressure = peak_pressure.max(highest(&crane.outputs()));
        }
    }
    let log = log.map_or(Ok(()), Log::finish);
    Ok(Simulated { crane, largest_motor_speed, peak_pressure, log })
}

/// Highest gauge pressure of chambers and pump \[Pa\].
fn highest(outputs: &Outputs<f64>) -> f64 {
    let chambers = outputs.pressure_a.max(outputs.pressure_b);
    chambers.max(outputs.pressure_pump_a).max(outputs.pressure_pump_b)
}
