//! Messages as columns: a topic's numbers by their paths, with bounded memory over all topics.

use super::clock::Clock;
use super::container::Loss;
use super::records::{Message, Topic};
use super::table::{self, Table};
use crate::channel::Measurement;
use crate::error::MeasurementError;
use crate::path;
use crate::sampled::Assembly;
use crate::thinning::MOST;
use crate::time_column::TimeColumn;
use std::collections::{BTreeMap, HashMap};
use std::rc::Rc;

/// Largest number of columns over all topics.
const MOST_COLUMNS: usize = 4000;

/// Columns of all topics.
pub(super) struct Log<'a> {
    clock: Clock<'a>,
    tables: Vec<Table>,
    /// Destination of each channel's messages, by the topic's address. The topic is kept alive so that the address
    /// stays unique.
    by_channel: HashMap<*const Topic, (Rc<Topic>, Rc<Place>)>,
    /// Destination by topic and schema: channels of one topic may have different schemas.
    by_kind: HashMap<Topic, Rc<Place>>,
    /// Count of unsupported messages, by topic and encoding.
    unread: BTreeMap<String, u64>,
    columns: usize,
    messages: u64,
    has_more_columns: bool,
}

/// Destination of a channel's messages.
enum Place {
    /// Index of a table.
    Table(usize),
    /// Unsupported; the topic and the encoding.
    Unread(String),
}

impl<'a> Log<'a> {
    pub(super) fn new(time: Option<&'a TimeColumn>) -> Self {
        Self {
            clock: Clock::new(time),
            tables: Vec::new(),
            by_channel: HashMap::new(),
            by_kind: HashMap::new(),
            unread: BTreeMap::new(),
            columns: 0,
            messages: 0,
            has_more_columns: false,
        }
    }

    /// Adds a message.
    pub(super) fn add(&mut self, message: &Message<'_>) {
        let at = match &*self.place(message.topic) {
            Place::Table(at) => *at,
            Place::Unread(what) => {
                // the number of entries is bounded by the file's channels
                match self.unread.get_mut(what) {
                    Some(count) => *count += 1,
                    None => _ = self.unread.insert(what.clone(), 1),
                }
                return;
            }
        };
        let room = MOST_COLUMNS - self.columns;
        let before = self.tables[at].paths.len();
        self.has_more_columns |= !self.tables[at].read(message.data, room);
        let new = self.tables[at].paths.len() - before;
        if new > 0 {
            self.columns += new;
            self.thin(at, new);
            (0..new).for_each(|_| self.tables[at].data.add_column());
        }
        self.tables[at].keep(message.log_time, &mut self.clock);
        self.messages += 1;
        // checked only now and then: 64 rows more are acceptable
        if self.messages.is_multiple_of(64) {
            self.thin(at, 0);
        }
    }

    /// Destination of a channel's messages.
    fn place(&mut self, topic: &Rc<Topic>) -> Rc<Place> {
        if let Some((_, place)) = self.by_channel.get(&Rc::as_ptr(topic)) {
            return Rc::clone(place);
        }
        let Topic { name, encoding, schema } = &**topic;
        // JSON is read without its schema
        let schema = schema.clone().filter(|_| encoding != "json");
        let kind = Topic { name: name.clone(), encoding: encoding.clone(), schema };
        let tables = &mut self.tables;
        let new = || match table::encoding(topic) {
            Ok(encoding) => {
                tables.push(Table::new(topic, encoding));
                Rc::new(Place::Table(tables.len() - 1))
            }
            Err(what) => Rc::new(Place::Unread(format!("{name} ({what})"))),
        };
        let place = Rc::clone(self.by_kind.entry(kind).or_insert_with(new));
        self.by_channel.insert(Rc::as_ptr(topic), (Rc::clone(topic), Rc::clone(&place)));
        place
    }

    /// Averages the rows of the longest table while the limit of numbers is exceeded, counting `new` columns of table
    /// `at`.
    fn thin(&mut self, at: usize, new: usize) {
        loop {
            let with_new = |(k, table): (usize, &Table)| {
                let numbers = table.data.numbers_with(if k == at { new } else { 0 });
                (k, numbers)
            };
            let sizes = || self.tables.iter().enumerate().map(with_new);
            if sizes().map(|(_, numbers)| numbers).sum::<usize>() <= MOST {
                return;
            }
            let Some((largest, _)) = sizes().max_by_key(|(_, numbers)| *numbers) else { return };
            self.tables[largest].data.halve();
        }
    }

    /// The log, with remarks on the parts of the file that were lost.
    ///
    /// # Errors
    ///
    /// [`MeasurementError::Format`] if the file has no usable signal, with a description of its content.
    pub(super) fn finish(
        mut self,
        file: &str,
        loss: &Loss,
    ) -> Result<Measurement, MeasurementError> {
        self.tables.sort_by(|a, b| a.topic.cmp(&b.topic));
        self.tables.iter_mut().for_each(|table| table.end(&mut self.clock));
        if let Some(reason) = self.tables.iter_mut().find_map(|table| table.refused.take()) {
            return Err(MeasurementError::Mapping { file: file.into(), reason });
        }
        let mut remarks = loss.remarks();
        for (what, count) in &self.unread {
            remarks.push(format!("{count} messages on {what} are not read"));
        }
        if self.has_more_columns {
            remarks
                .push(format!("it has more than {MOST_COLUMNS} numbers: the others are left out"));
        }
        let mut counts = BTreeMap::<String, usize>::new();
        for path in self.tables.iter().flat_map(|t| &t.paths) {
            *counts.entry(path.clone()).or_default() += 1;
        }
        for table in &self.tables {
            let is_alone = self.tables.iter().filter(|t| t.topic == table.topic).count() == 1;
            match is_alone {
                true => table.add_remarks(&table.topic, &mut remarks),
                false => {
                    table.add_remarks(&format!("{} ({})", table.topic, table.schema), &mut remarks)
                }
            }
        }
        if self.clock.is_far() {
            remarks.push("time is counted from the first message".into());
        }
        let mut assembly = Assembly::new(file, None, remarks);
        for table in self.tables {
            let topic = &table.topic;
            if table.data.count < 2 {
                continue;
            }
            // std_msgs/msg/Float64 and the like: the topic is the signal's name
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

/// Whether a path belongs to a header's stamp, which is not a signal.
fn is_stamp(path: &str) -> bool {
    path.ends_with("stamp.sec") || path.ends_with("stamp.nanosec")
}

#[cfg(test)]
mod tests {
    use super::super::records::Schema;
    use super::*;

    #[test]
    fn a_schema_is_parsed_once_even_if_unsupported() {
        let topic = |data: &str| {
            let (name, encoding) = ("a/msg/B".into(), "ros2msg".into());
            let schema = Rc::new(Schema { name, encoding, data: data.as_bytes().to_vec() });
            Rc::new(Topic { name: "/a".into(), encoding: "cdr".into(), schema: Some(schema) })
        };
        let mut log = Log::new(None);
        let mut places = Vec::new();
        for data in ["float64 x", "float64[x] y"] {
            let place = log.place(&topic(data));
            // also for another channel with the same topic and schema
            assert!((0..3).all(|_| Rc::ptr_eq(&log.place(&topic(data)), &place)), "{data}");
            places.push(place);
        }
        assert!(matches!((&*places[0], &*places[1]), (Place::Table(0), Place::Unread(_))));
    }
}
