//! Messages as columns: a topic's numbers by their paths, within bounded memory over all topics.

use super::container::Loss;
use super::definition::Definition;
use super::records::{Message, Schema, Topic};
use super::{cdr, json};
use crate::channel::Measurement;
use crate::error::MeasurementError;
use crate::path;
use crate::recording::Recording;
use crate::sampled::Assembly;
use crate::thinning::MOST;
use crate::time_column::TimeColumn;
use std::collections::{BTreeMap, HashMap};

/// Columns over all topics, at most.
const MOST_COLUMNS: usize = 4000;
/// Times that are larger are counted from something far away, and are shown from the first one on \[s\].
const FAR: i64 = 10_000_000;

/// Columns of all topics.
pub(super) struct Log<'a> {
    clock: Clock<'a>,
    topics: BTreeMap<String, Table>,
    /// Messages that are not read, by topic and what they are.
    unread: BTreeMap<String, u64>,
    columns: usize,
    messages: u64,
    has_more_columns: bool,
}

/// When messages were sampled.
struct Clock<'a> {
    /// The field that holds the time, where a mapping names one.
    stated: Option<&'a TimeColumn>,
    /// What times are counted from: zero, or the first one where it is far away; seconds and nanoseconds, so that no digit of
    /// these is lost.
    begin: Option<(i64, i64)>,
}

impl Clock<'_> {
    /// The time of a message \[s\]; none where the field is not in it.
    fn time(&mut self, log_time: u64, field: impl Fn(&str) -> Option<f64>) -> Option<f64> {
        let (seconds, nanoseconds) = match self.stated.and_then(|s| Some((s, s.column.as_deref()?)))
        {
            None => ((log_time / 1_000_000_000) as i64, (log_time % 1_000_000_000) as i64),
            Some((stated, column)) => {
                // a stamp is a time in two parts
                let stamp =
                    field(&format!("{column}.sec")).zip(field(&format!("{column}.nanosec")));
                match stamp {
                    Some((seconds, nanoseconds)) => (seconds as i64, nanoseconds as i64),
                    None => {
                        let unit = stated.unit.or_else(|| path::heading(column).unit);
                        let factor = unit.map_or(1.0, |u| u.factor);
                        let time = (stated.scale * field(column)? + stated.offset) * factor;
                        let whole = time.floor();
                        (whole as i64, ((time - whole) * 1e9) as i64)
                    }
                }
            }
        };
        let far = if seconds > FAR { (seconds, nanoseconds) } else { (0, 0) };
        let begin = *self.begin.get_or_insert(far);
        // in one division, so that a time is the number that its decimals are read as
        let whole = i128::from(seconds.checked_sub(begin.0)?) * 1_000_000_000;
        Some((whole + i128::from(nanoseconds.checked_sub(begin.1)?)) as f64 / 1e9)
    }
}

/// Columns of a topic.
struct Table {
    /// Paths of the numbers; the first column is the time.
    paths: Vec<String>,
    places: HashMap<String, usize>,
    data: Recording,
    row: Vec<f64>,
    encoding: Encoding,
    count: u64,
    damaged: u64,
    reason: String,
    timeless: u64,
}

enum Encoding {
    Json,
    Cdr(Definition),
}

impl<'a> Log<'a> {
    pub(super) fn new(time: Option<&'a TimeColumn>) -> Self {
        Self {
            clock: Clock { stated: time.filter(|t| t.column.is_some()), begin: None },
            topics: BTreeMap::new(),
            unread: BTreeMap::new(),
            columns: 0,
            messages: 0,
            has_more_columns: false,
        }
    }

    /// Adds a message.
    pub(super) fn add(&mut self, message: &Message<'_>) {
        if !self.topics.contains_key(&message.topic.name) {
            match encoding(message.topic) {
                Ok(encoding) => {
                    self.topics.insert(message.topic.name.clone(), Table::new(encoding));
                }
                Err(what) => {
                    let key = format!("{} ({what})", message.topic.name);
                    // what is counted is bounded by the file's channels
                    *self.unread.entry(key).or_default() += 1;
                    return;
                }
            }
        }
        let Some(table) = self.topics.get_mut(&message.topic.name) else { return };
        let room = MOST_COLUMNS - self.columns;
        let before = table.paths.len();
        self.has_more_columns |= !table.read(message.data, room);
        self.columns += table.paths.len() - before;
        table.keep(message.log_time, &mut self.clock);
        self.messages += 1;
        // a few rows more do no harm
        if self.messages.is_multiple_of(64) {
            self.thin();
        }
    }

    /// Averages the longest topic's rows while there are too many numbers.
    fn thin(&mut self) {
        let numbers = |topics: &BTreeMap<String, Table>| -> usize {
            topics.values().map(|t| t.data.numbers()).sum()
        };
        while numbers(&self.topics) > MOST {
            let largest = self.topics.values_mut().max_by_key(|t| t.data.numbers());
            let Some(largest) = largest else { return };
            largest.data.halve();
        }
    }

    /// The log, with what was lost of the file.
    ///
    /// # Errors
    ///
    /// [`MeasurementError::Format`] when nothing in it can be used, with what is there.
    pub(super) fn finish(self, file: &str, loss: &Loss) -> Result<Measurement, MeasurementError> {
        let mut remarks = loss.remarks();
        for (what, count) in &self.unread {
            remarks.push(format!("{count} messages on {what} are not read"));
        }
        if self.has_more_columns {
            remarks
                .push(format!("it has more than {MOST_COLUMNS} numbers: the others are left out"));
        }
        let mut counts = BTreeMap::<String, usize>::new();
        for path in self.topics.values().flat_map(|t| &t.paths) {
            *counts.entry(path.clone()).or_default() += 1;
        }
        for (topic, table) in &self.topics {
            table.say(topic, &mut remarks);
        }
        if self.clock.begin.is_some_and(|(seconds, _)| seconds > 0) {
            remarks.push("time is counted from the first message".into());
        }
        let mut assembly = Assembly::new(file, None, remarks);
        for (topic, table) in self.topics {
            if table.data.count < 2 {
                continue;
            }
            // std_msgs/msg/Float64 and its like: the topic is the signal
            let is_single = table.paths.iter().filter(|p| !is_stamp(p)).count() == 1;
            let heading = |path: String| {
                let heading = match path.as_str() {
                    "data" if is_single => topic.clone(),
                    _ if counts.get(&path) == Some(&1) => path,
                    _ => format!("{topic}.{path}"),
                };
                let read = path::heading(&heading);
                (heading, read)
            };
            let headings = table.paths.into_iter().map(heading).collect();
            let recorded = table.data.finish(file, &format!("message (on {topic})"))?;
            assembly.add_recorded(headings, recorded);
        }
        assembly.finish().map_err(|error| match error {
            MeasurementError::Format { file, reason } => {
                let what =
                    "no topic has two messages of numbers (JSON, or CDR with a ros2msg schema)";
                MeasurementError::Format { file, reason: format!("{what}: {reason}") }
            }
            other => other,
        })
    }
}

/// How a topic's messages are read.
fn encoding(topic: &Topic) -> Result<Encoding, String> {
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

/// Whether a path is of a header's stamp, which is no signal.
fn is_stamp(path: &str) -> bool {
    path.ends_with("stamp.sec") || path.ends_with("stamp.nanosec")
}

impl Table {
    fn new(encoding: Encoding) -> Self {
        Self {
            paths: Vec::new(),
            places: HashMap::new(),
            data: Recording::new(0, usize::MAX),
            row: vec![f64::NAN],
            encoding,
            count: 0,
            damaged: 0,
            reason: String::new(),
            timeless: 0,
        }
    }

    /// Reads a message into the row; whether there was room for all its columns.
    fn read(&mut self, data: &[u8], room: usize) -> bool {
        self.row.fill(f64::NAN);
        let Self { paths, places, data: columns, row, encoding, .. } = self;
        let (mut room, mut has_room, mut next) = (room, true, 0);
        let mut number = |path: &str, value: f64| {
            // messages are alike: the next number is mostly the next column
            let place = match paths.get(next).is_some_and(|p| p == path) {
                true => next,
                false => match places.get(path) {
                    Some(place) => *place,
                    None if room > 0 => {
                        room -= 1;
                        paths.push(path.into());
                        places.insert(path.into(), paths.len() - 1);
                        columns.add_column();
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

    /// Keeps the row at a time, unless it is none.
    fn keep(&mut self, log_time: u64, clock: &mut Clock<'_>) {
        self.count += 1;
        let there = |place: &usize| self.row.get(place + 1).copied();
        let time = clock.time(log_time, |path| self.places.get(path).and_then(there));
        let has_numbers = self.row.iter().any(|v| v.is_finite());
        let Some(time) = time.filter(|t| t.is_finite() && has_numbers) else {
            self.timeless += u64::from(has_numbers);
            return;
        };
        self.row[0] = time;
        self.data.push(self.count, &self.row);
    }

    fn say(&self, topic: &str, remarks: &mut Vec<String>) {
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
