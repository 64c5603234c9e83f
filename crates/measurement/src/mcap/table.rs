//! Table of the messages with one topic and schema: numbers by their paths.

use super::clock::{Clock, Stamp};
use super::definition::Definition;
use super::records::{Schema, Topic};
use super::{cdr, json};
use crate::recording::Recording;
use crate::time_scale::TimeScale;
use std::collections::HashMap;

/// Columns of the messages with one topic and schema.
pub(super) struct Table {
    pub(super) topic: String,
    /// Name of the schema, if the file has it.
    pub(super) schema: String,
    /// Paths of the numbers; the first column is the time.
    pub(super) paths: Vec<String>,
    places: HashMap<String, usize>,
    pub(super) data: Recording,
    row: Vec<f64>,
    encoding: Encoding,
    count: u64,
    damaged: u64,
    reason: String,
    timeless: u64,
    /// Conversion of the time field's numbers to seconds.
    scale: Option<TimeScale>,
    /// Reason why the named field is not a time.
    pub(super) refused: Option<String>,
}

/// Decoder of a topic's messages.
pub(super) enum Encoding {
    Json,
    Cdr(Definition),
}

/// The decoder of a topic's messages.
///
/// # Errors
///
/// Name of an unsupported encoding.
pub(super) fn encoding(topic: &Topic) -> Result<Encoding, String> {
    let schema = || topic.schema.as_deref();
    let named =
        |schema: &Schema| format!("{}, {} {}", topic.encoding, schema.encoding, schema.name);
    match (topic.encoding.as_str(), schema()) {
        ("json", _) => Ok(Encoding::Json),
        ("cdr", Some(schema)) if schema.encoding == "ros2msg" => {
            let text = String::from_utf8_lossy(&schema.data);
            let definition = Definition::parse(&schema.name, &text);
            definition.map(Encoding::Cdr).map_err(|why| format!("{}: {why}", named(schema)))
        }
        (_, Some(schema)) => {
            Err(format!("{}; JSON, and CDR with ros2msg, are read", named(schema)))
        }
        (other, None) => {
            Err(format!("{other} without a schema; JSON, and CDR with ros2msg, are read"))
        }
    }
}

impl Table {
    pub(super) fn new(topic: &Topic, encoding: Encoding) -> Self {
        Self {
            topic: topic.name.clone(),
            schema: topic.schema.as_ref().map_or(String::new(), |s| s.name.clone()),
            paths: Vec::new(),
            places: HashMap::new(),
            data: Recording::new(0, usize::MAX),
            row: vec![f64::NAN],
            encoding,
            count: 0,
            damaged: 0,
            reason: String::new(),
            timeless: 0,
            scale: None,
            refused: None,
        }
    }

    /// Reads a message into the row; returns false if `room` does not suffice for its new columns, which are not yet
    /// part of the data.
    pub(super) fn read(&mut self, data: &[u8], room: usize) -> bool {
        self.row.fill(f64::NAN);
        let Self { paths, places, row, encoding, .. } = self;
        let (mut room, mut has_room, mut next) = (room, true, 0);
        let mut number = |path: &str, value: f64| {
            // messages are alike: usually the next number belongs to the next column
            let place = match paths.get(next).is_some_and(|p| p == path) {
                true => next,
                false => match places.get(path) {
                    Some(place) => *place,
                    None if room > 0 => {
                        room -= 1;
                        paths.push(path.into());
                        places.insert(path.into(), paths.len() - 1);
                        row.push(f64::NAN);
                        paths.len() - 1
                    }
                    None => {
                        has_room = false;
                        return;
                    }
                },
            };
            next = place + 1;
            row[place + 1] = if value.is_finite() { value } else { f64::NAN };
        };
        let read = match encoding {
            Encoding::Json => json::numbers(data, &mut number),
            Encoding::Cdr(definition) => cdr::numbers(definition, data, &mut number),
        };
        if let Err(reason) = read {
            self.row.fill(f64::NAN);
            if self.damaged == 0 {
                self.reason = reason;
            }
            self.damaged += 1;
        }
        has_room
    }

    /// Stores the row, unless it has no time.
    pub(super) fn keep(&mut self, log_time: u64, clock: &mut Clock<'_>) {
        self.count += 1;
        if self.refused.is_some() || !self.row.iter().any(|v| v.is_finite()) {
            return;
        }
        let there = |place: &usize| self.row.get(place + 1).copied().filter(|v| v.is_finite());
        match clock.stamp(log_time, |path| self.places.get(path).and_then(there)) {
            Some(Stamp::Exact(seconds, nanoseconds)) => match clock.time(seconds, nanoseconds) {
                Some(time) => {
                    self.row[0] = time;
                    self.data.push(self.count, &self.row);
                }
                None => self.timeless += 1,
            },
            Some(Stamp::Number(number)) => {
                self.row[0] = number;
                let Self { scale, data, row, count, .. } = self;
                let scale = scale.get_or_insert_with(|| clock.scale());
                let kept = scale.push(*count, row, |line, row| clock.record(data, line, row));
                self.refused = kept.err();
            }
            None => self.timeless += 1,
        }
    }

    /// Finishes the table after the last message.
    pub(super) fn end(&mut self, clock: &mut Clock<'_>) {
        let (Some(scale), None) = (&mut self.scale, &self.refused) else { return };
        let data = &mut self.data;
        self.refused = scale.finish(|line, row| clock.record(data, line, row)).err();
    }

    /// Adds remarks about the parts left out; `topic` is the name for the messages.
    pub(super) fn add_remarks(&self, topic: &str, remarks: &mut Vec<String>) {
        if let Some(remark) = self.scale.as_ref().and_then(|s| s.remark.as_ref()) {
            remarks.push(format!("{topic}: {remark}"));
        }
        if self.damaged > 0 {
            remarks.push(format!(
                "{} messages on {topic} cannot be read and are left out ({})",
                self.damaged, self.reason
            ));
        }
        if self.timeless > 0 {
            remarks.push(format!(
                "{} messages on {topic} have no time and are left out",
                self.timeless
            ));
        }
    }
}
