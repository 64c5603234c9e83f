//! Log of a run: an MCAP file, which Foxglove and PlotJuggler open, with one JSON message per control
//! period.
//!
//! An ordinary thread writes it. Every half second a chunk is completed and passed to the operating system.
//! If the process is killed, less than a second is lost, and the file stays readable up to there. A full
//! disk ends the log and leaves the run unaffected.

use crate::control_task::Record;
use crate::posix::survive_large_files;
use ::mcap::records::MessageHeader;
use ::mcap::write::NoSeek;
use ::mcap::{Compression, McapError, WriteOptions, Writer};
use hydroboom_control::command::AxisCommand;
use hydroboom_control::estimation::tip::TipEstimate;
use hydroboom_control::measurement::{AxisSignals, Measurement};
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::limits::MachineStatus;
use hydroboom_control::supervision::supervisor::State;
use hydroboom_files::{FileError, Output};
use hydroboom_measurement::mcap::{self, Loss, Stop};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, BufWriter};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Time between two chunks \[s\].
const CHUNK: f64 = 0.5;
const TOPIC: &str = "/control";
const CONTROL: &str = "hydroboom.Control";
/// Topic of the cycles of a bus.
const BUS_TOPIC: &str = "/bus";
const BUS: &str = "hydroboom.Bus";

/// Reason why a log cannot be written or read.
#[derive(Debug, Error)]
pub enum LogError {
    /// The file cannot be created or read.
    #[error(transparent)]
    File(#[from] FileError),
    /// Writing failed.
    #[error("{path}: {error}")]
    Mcap {
        /// Path of the log.
        path: String,
        /// Error of the MCAP library.
        error: McapError,
    },
    /// The log is damaged, and a replay needs every period.
    #[error(
        "{path} is damaged, and a replay needs every period ({reason}); `hydroboom log to-csv` reads what is left"
    )]
    Damaged {
        /// Path of the log.
        path: String,
        /// Lost part.
        reason: String,
    },
    /// A message was not written by this program.
    #[error("{path}: not a log of hydroboom run: {reason}")]
    Foreign {
        /// Path of the log.
        path: String,
        /// Deviation from the expected content.
        reason: String,
    },
}

/// Names with units, and types, of the fields.
fn fields() -> Vec<(&'static str, &'static str)> {
    let mut fields: Vec<(&str, &str)> = NUMBERS.iter().map(|(name, _)| (*name, "number")).collect();
    fields.extend([("state", "string"), ("cause", "string"), ("strategy", "string")]);
    fields.extend([("fallback", "boolean"), ("fallback_cause", "string")]);
    fields.push(("machine_state", "string"));
    fields
}

type Number = (&'static str, fn(&Record) -> Option<f64>);

/// Numbers of a record in the units of their names; none where a value does not exist.
const NUMBERS: [Number; 57] = [
    ("time_s", |r| Some(r.time)),
    ("course_time_s", |r| r.course_time),
    ("course_speed_mm_s", |r| r.course_time.map(|_| r.course_speed * 1e3)),
    ("reading_number", |r| Some(r.measurement.number as f64)),
    ("start_offset_mm", |r| Some(r.start_offset * 1e3)),
    ("reference_position_mm", |r| Some(r.reference.position * 1e3)),
    ("reference_velocity_mm_s", |r| Some(r.reference.velocity * 1e3)),
    ("stroke_mm", |r| Some(r.signals().stroke * 1e3)),
    ("error_mm", |r| r.error().map(|e| e * 1e3)),
    ("simulated_stroke_mm", |r| r.simulated.map(|s| s.axis().stroke * 1e3)),
    ("simulated_load_pressure_bar", |r| r.simulated.map(|s| s.axis().load_pressure * 1e-5)),
    ("pressure_pump_a_bar", |r| Some(r.signals().pressure_pump_a * 1e-5)),
    ("pressure_a_bar", |r| Some(r.signals().pressure_a * 1e-5)),
    ("pressure_b_bar", |r| Some(r.signals().pressure_b * 1e-5)),
    ("pressure_pump_b_bar", |r| Some(r.signals().pressure_pump_b * 1e-5)),
    ("pressure_accumulator_bar", |r| Some(r.signals().pressure_accumulator * 1e-5)),
    ("motor_speed_rpm", |r| Some(r.signals().motor_speed * 60.0)),
    ("command_motor_speed_rpm", |r| Some(r.decision.command.motor_speed * 60.0)),
    ("command_holding_valve", |r| Some(r.decision.command.holding_valve)),
    ("releasing", |r| Some(f64::from(u8::from(r.decision.releasing)))),
    ("waited_s", |r| Some(r.decision.waited)),
    ("controls", |r| Some(f64::from(u8::from(r.decision.controls)))),
    ("estimated_position_mm", |r| r.estimates.map(|e| e.state.position * 1e3)),
    ("estimated_velocity_mm_s", |r| r.estimates.map(|e| e.state.velocity * 1e3)),
    ("estimated_load_pressure_bar", |r| r.estimates.map(|e| e.state.load_pressure * 1e-5)),
    ("estimated_friction_bar", |r| r.estimates.map(|e| e.state.friction * 1e-5)),
    ("estimated_disturbance_bar", |r| r.estimates.map(|e| e.state.disturbance * 1e-5)),
    ("estimated_unknown_flow_rpm", |r| r.estimates.map(|e| e.state.unknown_flow * 60.0)),
    ("estimated_payload_kg", |r| r.estimates.map(|e| e.state.payload)),
    ("estimated_transition_pressure_bar", |r| {
        r.estimates.map(|e| e.state.transition_pressure * 1e-5)
    }),
    ("deviation_position_mm", |r| r.estimates.map(|e| e.deviation.position * 1e3)),
    ("deviation_velocity_mm_s", |r| r.estimates.map(|e| e.deviation.velocity * 1e3)),
    ("deviation_load_pressure_bar", |r| r.estimates.map(|e| e.deviation.load_pressure * 1e-5)),
    ("deviation_friction_bar", |r| r.estimates.map(|e| e.deviation.friction * 1e-5)),
    ("deviation_disturbance_bar", |r| r.estimates.map(|e| e.deviation.disturbance * 1e-5)),
    ("deviation_unknown_flow_rpm", |r| r.estimates.map(|e| e.deviation.unknown_flow * 60.0)),
    ("deviation_payload_kg", |r| r.estimates.map(|e| e.deviation.payload)),
    ("deviation_transition_pressure_bar", |r| {
        r.estimates.map(|e| e.deviation.transition_pressure * 1e-5)
    }),
    ("estimated_tip_x_mm", |r| tip(r, |tip| tip.x)),
    ("estimated_tip_y_mm", |r| tip(r, |tip| tip.y)),
    ("deviation_tip_x_mm", |r| tip(r, |tip| tip.deviation_x)),
    ("deviation_tip_y_mm", |r| tip(r, |tip| tip.deviation_y)),
    ("innovation_position_mm", |r| r.estimates.map(|e| e.innovation[0] * 1e3)),
    ("innovation_load_pressure_bar", |r| r.estimates.map(|e| e.innovation[1] * 1e-5)),
    ("mean_nis", |r| r.estimates.map(|e| e.mean_nis)),
    ("drive_lag_ms", |r| r.estimates.map(|e| e.drive_lag * 1e3)),
    ("control_late_us", |r| r.deadlines.map(|d| d.control_late as f64 * 1e-3)),
    ("control_execution_us", |r| r.deadlines.map(|d| d.control_execution as f64 * 1e-3)),
    ("control_missed", |r| r.deadlines.map(|d| d.control_missed as f64)),
    ("simulation_late_us", |r| r.deadlines.map(|d| d.simulation_late as f64 * 1e-3)),
    ("simulation_execution_us", |r| r.deadlines.map(|d| d.simulation_execution as f64 * 1e-3)),
    ("simulation_missed", |r| r.deadlines.map(|d| d.simulation_missed as f64)),
    ("delay_cycles", |r| r.link.and_then(|link| link.delay).map(|delay| delay.total)),
    ("measurement_delay_cycles", |r| {
        r.link.and_then(|link| link.delay).map(|delay| delay.measurement)
    }),
    ("measurements_lost", |r| r.link.map(|link| link.lost as f64)),
    ("datagrams_dropped", |r| r.link.map(|link| link.dropped as f64)),
    ("machine_fault_code", |r| match r.status {
        Some(MachineStatus::Fault { code }) => Some(f64::from(code)),
        _ => None,
    }),
];

/// Coordinate or length of the estimated tip \[mm\].
fn tip(record: &Record, of: fn(&TipEstimate<f64>) -> f64) -> Option<f64> {
    record.estimates.and_then(|e| e.tip).map(|tip| of(&tip) * 1e3)
}

/// State reported by the machine; empty if it reports none.
fn machine_state(record: &Record) -> &'static str {
    record.status.map_or("", MachineStatus::name)
}

/// Topic of an MCAP log, with messages in JSON.
#[derive(Debug)]
pub struct Topic {
    channel: u16,
    count: u32,
}

impl Topic {
    /// The header of its next message, at a time \[s\].
    fn next(&mut self, time: f64) -> MessageHeader {
        let time = (time * 1e9).round() as u64;
        let sequence = self.count;
        self.count = self.count.wrapping_add(1);
        let channel_id = self.channel;
        MessageHeader { channel_id, sequence, log_time: time, publish_time: time }
    }
}

/// Adds a topic whose messages have these fields, with their JSON types.
fn add_topic(
    writer: &mut Writer<NoSeek<BufWriter<Output>>>,
    topic: &str,
    title: &str,
    fields: &[(&str, &str)],
) -> Result<Topic, McapError> {
    let properties: Map<String, Value> =
        fields.iter().map(|(name, kind)| ((*name).to_string(), json!({ "type": kind }))).collect();
    let schema = json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": title, "type": "object", "properties": properties,
    });
    let schema = writer.add_schema(title, "jsonschema", schema.to_string().as_bytes())?;
    let channel = writer.add_channel(schema, topic, "json", &BTreeMap::new())?;
    Ok(Topic { channel, count: 0 })
}

/// Writer of an MCAP log with one message per control period.
pub struct LogWriter {
    path: String,
    writer: Writer<NoSeek<BufWriter<Output>>>,
    topic: Topic,
    chunk_from: f64,
}

impl LogWriter {
    /// Creates a log file.
    ///
    /// # Errors
    ///
    /// [`LogError::File`] if the file cannot be created, [`LogError::Mcap`] if its header cannot be written.
    pub fn begin(path: &Path) -> Result<Self, LogError> {
        survive_large_files();
        let name = path.display().to_string();
        let file = Output::begin(path)?;
        let failed = |error| LogError::Mcap { path: name.clone(), error };
        let mut writer = WriteOptions::new()
            .compression(Some(Compression::Zstd))
            .chunk_size(None)
            // a pipe cannot seek
            .disable_seeking(true)
            .library(concat!("hydroboom ", env!("CARGO_PKG_VERSION")))
            .create(NoSeek::new(BufWriter::new(file)))
            .map_err(failed)?;
        let topic = add_topic(&mut writer, TOPIC, CONTROL, &fields()).map_err(failed)?;
        Ok(Self { path: name, writer, topic, chunk_from: 0.0 })
    }

    /// Adds the topic of the bus cycles. `fields` are the names of the fields of its messages, with their JSON types.
    /// Readers of control periods skip it.
    ///
    /// # Errors
    ///
    /// [`LogError::Mcap`] when it cannot be written.
    pub fn add_bus_topic(&mut self, fields: &[(&str, &str)]) -> Result<Topic, LogError> {
        add_topic(&mut self.writer, BUS_TOPIC, BUS, fields)
            .map_err(|error| LogError::Mcap { path: self.path.clone(), error })
    }

    /// Appends a message of a topic, at a time since the start of the executive \[s\].
    ///
    /// # Errors
    ///
    /// [`LogError::Mcap`] when it cannot be written; earlier messages stay readable.
    pub fn add_message(
        &mut self,
        topic: &mut Topic,
        time: f64,
        message: Map<String, Value>,
    ) -> Result<(), LogError> {
        let data = Value::Object(message).to_string();
        self.writer
            .write_to_known_channel(&topic.next(time), data.as_bytes())
            .map_err(|error| LogError::Mcap { path: self.path.clone(), error })
    }

    /// Appends the record of a control period. Numbers that are not finite are left out, because JSON has none.
    ///
    /// # Errors
    ///
    /// [`LogError::Mcap`] if writing fails, as on a full disk. Earlier records stay readable.
    pub fn add(&mut self, record: &Record) -> Result<(), LogError> {
        let mut message = Map::new();
        for (name, of) in NUMBERS {
            // JSON has no NaN: such a value is omitted
            if let Some(number) = of(record).and_then(serde_json::Number::from_f64) {
                message.insert(name.into(), Value::Number(number));
            }
        }
        let decision = &record.decision;
        message.insert("state".into(), json!(decision.state.name()));
        message.insert("cause".into(), json!(decision.cause.map_or("", |cause| cause.code())));
        message.insert("strategy".into(), json!(record.strategy.name()));
        message.insert("fallback".into(), json!(record.fallback.is_some()));
        let fallback = record.fallback.map_or("", |cause| cause.name());
        message.insert("fallback_cause".into(), json!(fallback));
        message.insert("machine_state".into(), json!(machine_state(record)));
        let header = self.topic.next(record.time);
        let data = Value::Object(message).to_string();
        let written = self.writer.write_to_known_channel(&header, data.as_bytes());
        let chunk_ends = record.time >= self.chunk_from + CHUNK;
        written
            .and_then(|()| match chunk_ends {
                true => {
                    self.chunk_from = record.time;
                    self.writer.flush()
                }
                false => Ok(()),
            })
            .map_err(|error| LogError::Mcap { path: self.path.clone(), error })
    }

    /// Abandons the log and keeps the part written so far in a file next to the target path. Returns that
    /// file's path.
    ///
    /// # Errors
    ///
    /// [`LogError::File`] if the part cannot be kept.
    pub fn leave(self) -> Result<PathBuf, LogError> {
        let (output, _) = self.writer.into_inner().into_inner().into_parts();
        Ok(output.leave()?)
    }

    /// Completes the log file under its name.
    ///
    /// # Errors
    ///
    /// [`LogError::Mcap`] if its end cannot be written, [`LogError::File`] if the file cannot be completed.
    pub fn finish(mut self) -> Result<(), LogError> {
        let path = self.path.clone();
        let failed = |error| LogError::Mcap { path, error };
        self.writer.finish().map_err(failed)?;
        let file = self.writer.into_inner().into_inner();
        match file.into_inner() {
            Ok(output) => Ok(output.finish()?),
            Err(error) => {
                let (error, file) = error.into_parts();
                Err(file.get_ref().failed(error).into())
            }
        }
    }
}

/// Records as CSV text with the columns of a log, one row per control period; a number that is not finite is an empty
/// cell.
pub fn csv(records: &[Record]) -> String {
    let names: Vec<&str> = fields().into_iter().map(|(name, _)| name).collect();
    let mut text = names.join(",") + "\n";
    for record in records {
        let number = |of: fn(&Record) -> Option<f64>| {
            of(record).filter(|v| v.is_finite()).map_or(String::new(), |v| v.to_string())
        };
        let mut cells: Vec<String> = NUMBERS.iter().map(|(_, of)| number(*of)).collect();
        let cause = record.decision.cause.map_or("", |cause| cause.code());
        cells.extend(
            [record.decision.state.name(), cause, record.strategy.name()].map(String::from),
        );
        cells.push(record.fallback.is_some().to_string());
        cells.push(record.fallback.map_or("", |cause| cause.name()).into());
        cells.push(machine_state(record).into());
        text += &cells.join(",");
        text.push('\n');
    }
    text
}

/// Control period read from a log, with the fields that a replay needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Measurement; none before the first one. Signals that are absent from the log are NaN. Its time is
    /// that of the row.
    pub measurement: Option<Measurement>,
    /// Time of the course \[s\]; none while the controller did not move the load.
    pub course_time: Option<f64>,
    /// Largest speed of the course \[m/s\]; none outside a course, and in logs of versions that did not
    /// record it.
    pub course_speed: Option<f64>,
    /// Reference position \[m\] and velocity \[m/s\] of the piston.
    pub reference: SetPoint<f64>,
    /// Part of the reference position that is the decaying offset at the start \[m\].
    pub start_offset: f64,
    /// Command that was sent: motor speed \[rev/s\] and load-holding valve.
    pub command: AxisCommand<f64>,
    /// State of the supervisor.
    pub state: State,
    /// Whether the load was being released from its valves.
    pub releasing: bool,
    /// Time since the executive began \[s\].
    pub time: f64,
    /// Code of the fault; empty without one.
    pub cause: String,
    /// Active control strategy.
    pub strategy: Strategy,
}

/// Calls `each` with every readable message in order and returns the loss. A log without a message is an
/// error.
fn messages(
    path: &Path,
    mut each: impl FnMut(Value) -> Result<(), String>,
) -> Result<Loss, LogError> {
    let name = path.display().to_string();
    let failed = |error| FileError::Read { path: path.into(), error };
    let foreign = |reason: String| LogError::Foreign { path: name.clone(), reason };
    let source = BufReader::new(File::open(path).map_err(failed)?);
    let mut count = 0_u64;
    let loss = mcap::messages(source, |message| {
        let schema = message.topic.schema.as_deref();
        if schema.is_some_and(|schema| schema.name == BUS) {
            return Ok(());
        }
        if schema.is_none_or(|schema| schema.name != CONTROL) {
            return Err(Stop::Format(format!("a message on {}", message.topic.name)));
        }
        let value = serde_json::from_slice(message.data);
        count += 1;
        value.map_err(|e| e.to_string()).and_then(&mut each).map_err(Stop::Format)
    })
    .map_err(|stop| match stop {
        Stop::File(error) => failed(error).into(),
        Stop::Format(reason) => foreign(reason),
    })?;
    if count == 0 {
        let lost = loss.remarks().iter().fold(String::new(), |said, r| format!("{said}; {r}"));
        return Err(foreign(format!("there is no control period in it{lost}")));
    }
    Ok(loss)
}

/// Table of the control periods of a log.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// Names of the columns.
    pub header: Vec<&'static str>,
    /// Cells as text, one row per readable control period.
    pub rows: Vec<Vec<String>>,
    /// Losses while reading, a sentence each: damaged chunks, a truncated end.
    pub remarks: Vec<String>,
}

/// Reads a log as a table, as far as it is readable.
///
/// # Errors
///
/// [`LogError::File`] if the file cannot be read. [`LogError::Foreign`] if it contains no control period, or was not
/// written by this program. Damage is
/// no error: it is in [`Table::remarks`].
pub fn read(path: &Path) -> Result<Table, LogError> {
    let header: Vec<&str> = fields().into_iter().map(|(name, _)| name).collect();
    let mut rows = Vec::new();
    let loss = messages(path, |value| {
        let cell = |name: &&str| match &value[*name] {
            Value::Null => String::new(),
            Value::String(text) => text.clone(),
            other => other.to_string(),
        };
        rows.push(header.iter().map(cell).collect());
        Ok(())
    })?;
    Ok(Table { header, rows, remarks: loss.remarks() })
}

/// Reads the control periods of a log for a replay. A truncated log yields the periods before the
/// truncation.
///
/// # Errors
///
/// - [`LogError::File`] if the file cannot be read.
/// - [`LogError::Damaged`] if a chunk or a message in it is damaged.
/// - [`LogError::Foreign`] if it was not written by this program, a message lacks a field, or there is no control
///   period in it.
pub fn rows(path: &Path) -> Result<Vec<Row>, LogError> {
    let mut rows = Vec::new();
    let loss = messages(path, |value| {
        rows.push(row(&value)?);
        Ok(())
    })?;
    match loss.is_damage() {
        false => Ok(rows),
        true => {
            let reason = loss.remarks().join("; ");
            Err(LogError::Damaged { path: path.display().to_string(), reason })
        }
    }
}

fn row(value: &Value) -> Result<Row, String> {
    let number = |name: &str, unit: f64| value[name].as_f64().map_or(f64::NAN, |v| v * unit);
    let text = |name: &str| value[name].as_str().ok_or_else(|| format!("a message without {name}"));
    let needed =
        |name: &str| value[name].as_f64().ok_or_else(|| format!("a message without {name}"));
    let (state, strategy) = (text("state")?, text("strategy")?);
    let number_of_measurement = needed("reading_number")? as u64;
    let time = needed("time_s")?;
    let signals = AxisSignals {
        stroke: number("stroke_mm", 1e-3),
        pressure_pump_a: number("pressure_pump_a_bar", 1e5),
        pressure_a: number("pressure_a_bar", 1e5),
        pressure_b: number("pressure_b_bar", 1e5),
        pressure_pump_b: number("pressure_pump_b_bar", 1e5),
        pressure_accumulator: number("pressure_accumulator_bar", 1e5),
        motor_speed: number("motor_speed_rpm", 1.0 / 60.0),
    };
    Ok(Row {
        measurement: (number_of_measurement > 0)
            .then(|| Measurement::new(number_of_measurement, time, [signals])),
        course_time: value["course_time_s"].as_f64(),
        course_speed: value["course_speed_mm_s"].as_f64().map(|speed| speed * 1e-3),
        reference: SetPoint {
            position: needed("reference_position_mm")? * 1e-3,
            velocity: needed("reference_velocity_mm_s")? * 1e-3,
        },
        start_offset: value["start_offset_mm"].as_f64().unwrap_or(0.0) * 1e-3,
        command: AxisCommand {
            motor_speed: needed("command_motor_speed_rpm")? / 60.0,
            holding_valve: needed("command_holding_valve")?,
        },
        state: State::from_name(state).ok_or_else(|| format!("no state \"{state}\""))?,
        releasing: value["releasing"].as_f64().is_some_and(|is| is > 0.5),
        time,
        cause: text("cause")?.into(),
        strategy: strategy.parse::<Strategy>().map_err(|why| format!("\"{strategy}\": {why}"))?,
    })
}
