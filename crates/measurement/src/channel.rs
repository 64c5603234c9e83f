//! Channels as they were logged.

use crate::error::MeasurementError;
use crate::heading::Heading;
use crate::signal::Signal;
use crate::time_column::TimeColumn;
use crate::unit::Unit;
use std::collections::HashMap;
use std::sync::Arc;

/// Channels that a message names, at most.
const MOST_NAMED: usize = 40;

/// What one sensor gave.
#[derive(Clone, Debug)]
pub struct Channel {
    /// Name, without its unit.
    pub name: String,
    /// The column's heading, as logged.
    pub heading: String,
    /// Unit, where the log states it.
    pub unit: Option<Unit>,
    /// What the log states as the unit, where that is none that is known.
    pub unknown_unit: Option<String>,
    /// Times \[s\], never going back; shared by channels that were sampled together.
    pub time: Arc<[f64]>,
    /// Samples at which a new segment begins, but for the first: the clock was set there, or samples are missing.
    pub breaks: Arc<[usize]>,
    /// Values in the log's unit; NaN where one is missing.
    pub values: Vec<f64>,
}

/// A part of a channel in which its clock runs on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Time of its first sample \[s\].
    pub begin: f64,
    /// Time of its last sample \[s\].
    pub end: f64,
    /// How many samples it has.
    pub samples: usize,
}

/// A log as it was read.
#[derive(Clone, Debug)]
pub struct Measurement {
    /// Name of its file.
    pub name: String,
    /// Its channels.
    pub channels: Vec<Channel>,
    /// What had to be done to read it.
    pub remarks: Vec<String>,
    /// The column that its times were found in; none where each signal has times of its own, or the format says which is the time.
    pub time: Option<TimeColumn>,
}

/// Smallest, mean and largest of the values that are there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Smallest.
    pub low: f64,
    /// Mean.
    pub mean: f64,
    /// Largest.
    pub high: f64,
    /// Values that are missing.
    pub missing: usize,
}

impl Channel {
    /// A channel whose unit is stated in its heading, or nowhere.
    pub fn new(heading: &str, time: Arc<[f64]>, values: Vec<f64>) -> Self {
        Self::of(Heading::parse(heading), heading, time, values)
    }

    /// A channel whose unit is stated beside its heading; where that is empty, the heading's own counts.
    pub fn with_unit(heading: &str, unit: &str, time: Arc<[f64]>, values: Vec<f64>) -> Self {
        Self::of(Heading::with_unit(heading, unit), heading, time, values)
    }

    /// A channel whose heading has been read.
    pub(crate) fn of(read: Heading, heading: &str, time: Arc<[f64]>, values: Vec<f64>) -> Self {
        let Heading { name, unit, unknown_unit } = read;
        let breaks = Arc::from([]);
        Self { name, heading: heading.into(), unit, unknown_unit, time, breaks, values }
    }

    /// The same with segments that begin at some samples, which increase.
    pub fn broken_at(self, breaks: Arc<[usize]>) -> Self {
        Self { breaks, ..self }
    }

    /// Its segments, one after the other.
    pub fn segments(&self) -> Vec<Segment> {
        let begins = std::iter::once(0).chain(self.breaks.iter().copied());
        let ends = self.breaks.iter().copied().chain([self.time.len()]);
        let segment = |(from, to): (usize, usize)| {
            let times = self.time.get(from..to)?;
            Some(Segment { begin: *times.first()?, end: *times.last()?, samples: times.len() })
        };
        begins.zip(ends).filter_map(segment).collect()
    }

    /// Smallest, mean and largest; none where no value is there.
    pub fn range(&self) -> Option<Range> {
        let there = || self.values.iter().filter(|v| v.is_finite());
        let count = there().count();
        (count > 0).then(|| Range {
            low: there().copied().fold(f64::INFINITY, f64::min),
            mean: there().sum::<f64>() / count as f64,
            high: there().copied().fold(f64::NEG_INFINITY, f64::max),
            missing: self.values.len() - count,
        })
    }
}

impl Measurement {
    /// What all channels are called, for messages.
    pub fn headings(&self) -> String {
        let more = self.channels.len().saturating_sub(MOST_NAMED);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        let named = self.channels.iter().take(MOST_NAMED).map(|c| self.address(c));
        format!("{}{more}", named.collect::<Vec<_>>().join(", "))
    }

    /// What a mapping calls the channels of this log, in their order, as [`Self::address`].
    pub fn addresses(&self) -> Vec<String> {
        let mut count: HashMap<&str, usize> = HashMap::new();
        for channel in &self.channels {
            *count.entry(&channel.heading).or_default() += 1;
        }
        let mut place: HashMap<&str, usize> = HashMap::new();
        let mut all = Vec::with_capacity(self.channels.len());
        for channel in &self.channels {
            let heading = channel.heading.as_str();
            let place = place.entry(heading).or_default();
            *place += 1;
            all.push(match count.get(heading) {
                Some(1) | None => heading.to_string(),
                Some(_) => format!("{heading}#{place}"),
            });
        }
        all
    }

    /// What a mapping calls a channel of this log: its heading, and `#2` behind it for the second that has the same.
    pub fn address(&self, channel: &Channel) -> String {
        let same: Vec<&Channel> =
            self.channels.iter().filter(|c| c.heading == channel.heading).collect();
        match same.iter().position(|c| std::ptr::eq(*c, channel)) {
            Some(place) if same.len() > 1 => format!("{}#{}", channel.heading, place + 1),
            _ => channel.heading.clone(),
        }
    }

    /// Channels that a name stands for: those with the heading, or else those with the name.
    fn called(&self, name: &str) -> Vec<&Channel> {
        let by_heading: Vec<&Channel> =
            self.channels.iter().filter(|c| c.heading == name).collect();
        match by_heading.is_empty() {
            true => self.channels.iter().filter(|c| c.name == name).collect(),
            false => by_heading,
        }
    }

    /// The channel that a mapping names for a signal.
    ///
    /// # Errors
    ///
    /// [`MeasurementError::Mapping`] when there is none, or when several are called so.
    pub(crate) fn named(&self, signal: Signal, column: &str) -> Result<&Channel, MeasurementError> {
        let called = self.called(column);
        let wrong = |reason: String| MeasurementError::Mapping { file: self.name.clone(), reason };
        match (called.as_slice(), self.channel(column)) {
            (_, Some(channel)) => Ok(channel),
            ([], None) => Err(wrong(format!(
                "log.{} names the column \"{column}\"; there are: {}",
                signal.key(),
                self.headings()
            ))),
            (several, None) => {
                let all: Vec<String> =
                    several.iter().map(|c| format!("\"{}\"", self.address(c))).collect();
                Err(wrong(format!(
                    "log.{} names the column \"{column}\", which {} columns are called; say which: {}",
                    signal.key(),
                    several.len(),
                    all.join(", ")
                )))
            }
        }
    }

    /// The same as [`Self::channel`], to be changed.
    pub(crate) fn channel_mut(&mut self, name: &str) -> Option<&mut Channel> {
        let found = std::ptr::from_ref(self.channel(name)?);
        self.channels.iter_mut().find(|c| std::ptr::eq(std::ptr::from_ref(*c), found))
    }

    /// A channel by its heading or name, where no other is called so; of several the second is `name#2`.
    pub fn channel(&self, name: &str) -> Option<&Channel> {
        match self.called(name).as_slice() {
            [one] => Some(one),
            [] => {
                let (name, place) = name.rsplit_once('#')?;
                let place = place.parse::<usize>().ok()?.checked_sub(1)?;
                self.called(name).get(place).copied()
            }
            _ => None,
        }
    }
}
