//! Channels of a log: samples of one quantity over time, as logged.

use crate::error::MeasurementError;
use crate::heading::Heading;
use crate::signal::Signal;
use crate::time_column::TimeColumn;
use crate::unit::Unit;
use std::collections::HashMap;
use std::sync::Arc;

/// Largest number of channels listed in a message.
const MOST_NAMED: usize = 40;

/// Samples of one logged quantity over time, as logged: in the log's unit, without resampling.
#[derive(Clone, Debug)]
pub struct Channel {
    /// Name from the heading, without its unit.
    pub name: String,
    /// Heading of the column, with its unit, as logged.
    pub heading: String,
    /// Unit; none if the log states no known one.
    pub unit: Option<Unit>,
    /// Text that the log states as the unit, if it is no known unit; else none.
    pub unknown_unit: Option<String>,
    /// Times \[s\], non-decreasing; shared by channels that were sampled together.
    pub time: Arc<[f64]>,
    /// Indices of the samples at which a new segment begins, without the first segment: there the clock was set or
    /// samples are missing.
    pub breaks: Arc<[usize]>,
    /// Values in the log's unit; NaN for a missing sample.
    pub values: Vec<f64>,
}

/// Part of a channel between two steps of its clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Time of its first sample \[s\].
    pub begin: f64,
    /// Time of its last sample \[s\].
    pub end: f64,
    /// Number of samples in the segment.
    pub samples: usize,
}

/// A log with all of its channels, as read from a file.
///
/// ```
/// let path = std::env::temp_dir().join(format!("hydroboom-measurement-{}.csv", std::process::id()));
/// std::fs::write(&path, "t [s],p_A [bar]\n0.0,80\n0.1,81\n0.2,82\n")?;
/// let log = hydroboom_measurement::read(&path, None)?;
/// assert_eq!(log.channel("p_A").map(|channel| channel.values.clone()), Some(vec![80.0, 81.0, 82.0]));
/// std::fs::remove_file(&path)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Measurement {
    /// Name of the file.
    pub name: String,
    /// Channels, in the order of the file.
    pub channels: Vec<Channel>,
    /// Repairs and omissions while reading, as sentences for the user.
    pub remarks: Vec<String>,
    /// The column that holds the time; `None` if each signal has its own times or the format defines the time.
    pub time: Option<TimeColumn>,
}

/// Smallest, mean and largest finite value of a channel, in the log's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Smallest value \[unit of the log\].
    pub low: f64,
    /// Arithmetic mean over the samples \[unit of the log\].
    pub mean: f64,
    /// Largest value \[unit of the log\].
    pub high: f64,
    /// Number of missing samples, which are NaN.
    pub missing: usize,
}

impl Channel {
    /// Channel whose unit is stated in its heading or not at all. `time` \[s\] is non-decreasing and as long as
    /// `values`, which are in the log's unit.
    pub fn new(heading: &str, time: Arc<[f64]>, values: Vec<f64>) -> Self {
        Self::of(Heading::parse(heading), heading, time, values)
    }

    /// Channel whose unit is stated apart from its heading; if `unit` is empty, the heading's unit applies. `time`
    /// \[s\] is non-decreasing and as long as `values`.
    pub fn with_unit(heading: &str, unit: &str, time: Arc<[f64]>, values: Vec<f64>) -> Self {
        Self::of(Heading::with_unit(heading, unit), heading, time, values)
    }

    /// A channel with a parsed heading.
    pub(crate) fn of(read: Heading, heading: &str, time: Arc<[f64]>, values: Vec<f64>) -> Self {
        let Heading { name, unit, unknown_unit } = read;
        let breaks = Arc::from([]);
        Self { name, heading: heading.into(), unit, unknown_unit, time, breaks, values }
    }

    /// The channel, divided into segments that begin at the sample indices `breaks`, in increasing order.
    pub fn broken_at(self, breaks: Arc<[usize]>) -> Self {
        Self { breaks, ..self }
    }

    /// Segments in order of time; a single one without a step of the clock.
    pub fn segments(&self) -> Vec<Segment> {
        let begins = std::iter::once(0).chain(self.breaks.iter().copied());
        let ends = self.breaks.iter().copied().chain([self.time.len()]);
        let segment = |(from, to): (usize, usize)| {
            let times = self.time.get(from..to)?;
            Some(Segment { begin: *times.first()?, end: *times.last()?, samples: times.len() })
        };
        begins.zip(ends).filter_map(segment).collect()
    }

    /// Smallest, mean and largest finite value; none if all samples are missing.
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
    /// Headings of all channels as one text, for messages.
    pub fn headings(&self) -> String {
        let more = self.channels.len().saturating_sub(MOST_NAMED);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        let named = self.channels.iter().take(MOST_NAMED).map(|c| self.address(c));
        format!("{}{more}", named.collect::<Vec<_>>().join(", "))
    }

    /// Names of all channels in a mapping, in the order of the channels; see [`Self::address`].
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

    /// Name of a channel in a mapping: its heading, followed by `#2` for the second channel with the same heading.
    pub fn address(&self, channel: &Channel) -> String {
        let same: Vec<&Channel> =
            self.channels.iter().filter(|c| c.heading == channel.heading).collect();
        match same.iter().position(|c| std::ptr::eq(*c, channel)) {
            Some(place) if same.len() > 1 => format!("{}#{}", channel.heading, place + 1),
            _ => channel.heading.clone(),
        }
    }

    /// Channels with this heading, or else with this name.
    fn called(&self, name: &str) -> Vec<&Channel> {
        let by_heading: Vec<&Channel> =
            self.channels.iter().filter(|c| c.heading == name).collect();
        match by_heading.is_empty() {
            true => self.channels.iter().filter(|c| c.name == name).collect(),
            false => by_heading,
        }
    }

    /// The channel that a mapping assigns to a signal.
    ///
    /// # Errors
    ///
    /// [`MeasurementError::Mapping`] if no channel or several have this name.
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

    /// Mutable variant of [`Self::channel`].
    pub(crate) fn channel_mut(&mut self, name: &str) -> Option<&mut Channel> {
        let found = std::ptr::from_ref(self.channel(name)?);
        self.channels.iter_mut().find(|c| std::ptr::eq(std::ptr::from_ref(*c), found))
    }

    /// The channel with this heading or name, if it is unique; `name#2` is the second of several.
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
