//! Channels as they were logged.

use crate::unit::Unit;
use std::sync::Arc;

/// What one sensor gave.
#[derive(Clone, Debug)]
pub struct Channel {
    /// Name, without its unit.
    pub name: String,
    /// The column's heading, as logged.
    pub heading: String,
    /// Unit, where the log names it.
    pub unit: Option<Unit>,
    /// Times \[s\], never going back; shared by channels that were sampled together.
    pub time: Arc<[f64]>,
    /// Values in the log's unit; NaN where one is missing.
    pub values: Vec<f64>,
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
    /// Headings of all channels, for messages.
    pub fn headings(&self) -> String {
        self.channels.iter().map(|c| c.heading.as_str()).collect::<Vec<_>>().join(", ")
    }

    /// A channel by its heading or name.
    pub fn channel(&self, name: &str) -> Option<&Channel> {
        let by_heading = self.channels.iter().find(|c| c.heading == name);
        by_heading.or_else(|| self.channels.iter().find(|c| c.name == name))
    }
}
