//! Signals of a log in SI units.

use crate::channel::{Channel, Measurement};
use crate::dimension::Dimension;
use crate::error::MeasurementError;
use crate::mapping::Mapping;
use crate::signal::Signal;
use crate::time_base::TimeBase;
use std::collections::BTreeMap;

/// Samples of one signal over its own times, in SI units, with linear interpolation and gaps.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// Times \[s\].
    time: Vec<f64>,
    /// Values in SI units.
    values: Vec<f64>,
    /// Largest interval between samples that is interpolated \[s\]; a longer one is a gap.
    reach: f64,
    /// Time constant of the first-order filter in the measurement chain \[s\]; zero for none.
    filter: f64,
    /// Times at which a new segment begins \[s\].
    breaks: Vec<f64>,
    /// Dimension of the values, where a signal may have one of several.
    dimension: Option<Dimension>,
}

/// Measured signals of a log in SI units, each with its own times.
///
/// ```
/// use hydroboom_measurement::{Channel, Mapping, Measurement, Signal, Signals};
/// let channel = Channel::new("x [mm]", vec![0.0, 0.1].into(), vec![100.0, 102.0]);
/// let log = Measurement { name: "log".into(), channels: vec![channel], remarks: Vec::new(), time: None };
/// let mapping = Mapping::parse("map.toml", "[log]\nstroke = \"x\"\n")?.completed(&log)?;
/// let stroke = Signals::of(&log, &mapping)?.need(Signal::Stroke, &log)?.at(0.05);
/// assert!(stroke.is_some_and(|metres| (metres - 0.101).abs() < 1e-12));
/// # Ok::<(), hydroboom_measurement::MeasurementError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Signals {
    tracks: BTreeMap<Signal, Track>,
}

impl Track {
    /// Signal from its times \[s\] and values in SI units. Samples that are not finite, and those whose time is not
    /// later than the one before, are left out. So is the surplus if one of both is longer. Intervals longer than five
    /// median intervals are gaps.
    pub fn new(time: &[f64], values: &[f64]) -> Self {
        let mut kept: (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        for (t, v) in time.iter().zip(values).filter(|(t, v)| t.is_finite() && v.is_finite()) {
            if kept.0.last().is_none_or(|last| t > last) {
                kept.0.push(*t);
                kept.1.push(*v);
            }
        }
        let reach = TimeBase::of(&kept.0).map_or(0.0, |base| 5.0 * base.interval);
        Self {
            time: kept.0,
            values: kept.1,
            reach,
            filter: 0.0,
            breaks: Vec::new(),
            dimension: None,
        }
    }

    /// Median sampling interval \[s\]; zero for fewer than two samples.
    pub fn interval(&self) -> f64 {
        TimeBase::of(&self.time).map_or(0.0, |base| base.interval)
    }

    /// Sets the time constant \[s\] of the first-order filter that the samples have passed; zero for none.
    pub fn filtered(self, filter: f64) -> Self {
        Self { filter, ..self }
    }

    /// Sets the times \[s\] at which new segments begin, in increasing order. There is no interpolation between the
    /// last sample before and the first one after.
    pub fn broken_at(self, breaks: Vec<f64>) -> Self {
        Self { breaks, ..self }
    }

    /// Whether a segment begins after `from` and not after `to` \[s\].
    fn is_broken(&self, from: f64, to: f64) -> bool {
        let next = self.breaks.partition_point(|b| *b <= from);
        self.breaks.get(next).is_some_and(|b| *b <= to)
    }

    /// Steps of the clock: times of the last sample before and the first one after \[s\].
    fn jumps(&self) -> Vec<(f64, f64)> {
        let around = |b: &f64| {
            let next = self.time.partition_point(|t| t < b);
            Some((*self.time.get(next.checked_sub(1)?)?, *self.time.get(next)?))
        };
        self.breaks.iter().filter_map(around).collect()
    }

    /// Intervals without a gap \[s\], as times of their first and last sample, in increasing order.
    pub fn stretches(&self) -> Vec<(f64, f64)> {
        let Some(first) = self.time.first() else { return Vec::new() };
        let mut stretches = vec![(*first, *first)];
        for pair in self.time.windows(2) {
            if pair[1] - pair[0] > self.reach || self.is_broken(pair[0], pair[1]) {
                stretches.push((pair[1], pair[1]));
            } else if let Some(last) = stretches.last_mut() {
                last.1 = pair[1];
            }
        }
        stretches
    }

    /// Sets the dimension of the values: a voltage, or a share of full spool travel for a valve's command.
    pub fn measured_as(self, dimension: Dimension) -> Self {
        Self { dimension: Some(dimension), ..self }
    }

    /// Whether its values are shares of full spool travel, and not volts.
    pub fn is_share(&self) -> bool {
        self.dimension == Some(Dimension::Share)
    }

    /// Time constant of the first-order filter that the samples have passed \[s\]; zero for none.
    pub fn filter(&self) -> f64 {
        self.filter
    }

    /// Times \[s\].
    pub fn time(&self) -> &[f64] {
        &self.time
    }

    /// Values in SI units.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Value in SI units at a time \[s\], interpolated linearly; none in a gap, before the first and after the last
    /// sample, and at a time that is NaN.
    pub fn at(&self, time: f64) -> Option<f64> {
        let next = self.time.partition_point(|t| *t <= time);
        let before = next.checked_sub(1)?;
        if self.time[before] == time {
            return Some(self.values[before]);
        }
        let (t0, t1) = (self.time[before], *self.time.get(next)?);
        if t1 - t0 > self.reach || self.is_broken(t0, t1) {
            return None;
        }
        let share = (time - t0) / (t1 - t0);
        Some(self.values[before] + share * (self.values[next] - self.values[before]))
    }

    /// Value in SI units of the last sample at or before a time \[s\] (zero-order hold); before all samples, and at a
    /// time that is NaN, the first one. None without samples.
    pub fn held(&self, time: f64) -> Option<f64> {
        let next = self.time.partition_point(|t| *t <= time);
        self.values.get(next.saturating_sub(1)).copied()
    }
}

impl Signals {
    /// Signals that a mapping assigns to the log's columns, converted to SI units and true sampling times. A column
    /// with fewer than two valid samples gives no signal.
    ///
    /// # Errors
    ///
    /// [`MeasurementError::Mapping`] if the mapping names a column that the log lacks, or a unit is unknown or of
    /// another dimension.
    pub fn of(log: &Measurement, mapping: &Mapping) -> Result<Self, MeasurementError> {
        let mut tracks = BTreeMap::new();
        for (signal, entry) in &mapping.entries {
            let channel = log.named(*signal, &entry.column)?;
            let (unit, _) = entry
                .unit_of(*signal, channel)
                .map_err(|reason| MeasurementError::Mapping { file: log.name.clone(), reason })?;
            let begin = channel.time.first().copied().unwrap_or(0.0);
            let time: Vec<f64> = channel.time.iter().map(|t| entry.taken(*t, begin)).collect();
            let values: Vec<f64> = channel.values.iter().map(|v| entry.si(&unit, *v)).collect();
            let track =
                Track::new(&time, &values).filtered(entry.filter).measured_as(unit.dimension);
            let breaks = channel.breaks.iter().filter_map(|k| time.get(*k).copied());
            let track = track.broken_at(breaks.collect());
            if track.time.len() >= 2 {
                tracks.insert(*signal, track);
            }
        }
        Ok(Self { tracks })
    }

    /// Samples of a signal; none if it was not measured.
    pub fn get(&self, signal: Signal) -> Option<&Track> {
        self.tracks.get(&signal)
    }

    /// Adds or replaces the samples of a signal.
    pub fn insert(&mut self, signal: Signal, track: Track) {
        self.tracks.insert(signal, track);
    }

    /// Samples of a required signal. `log` is named in the error, with its columns.
    ///
    /// # Errors
    ///
    /// [`MeasurementError::Missing`] if it was not measured.
    pub fn need(&self, signal: Signal, log: &Measurement) -> Result<&Track, MeasurementError> {
        self.get(signal).ok_or_else(|| {
            let misfits = Mapping::misfits(log).into_iter().filter(|(of, _)| *of == signal);
            let misfit = |(_, channel): (Signal, &Channel)| {
                let unit = channel.unit?;
                Some(format!("; \"{}\" is {}", channel.heading, unit.dimension.words()))
            };
            MeasurementError::Missing {
                missing: signal.symbol().into(),
                key: signal.key(),
                columns: log.headings(),
                misfits: misfits.filter_map(misfit).collect(),
            }
        })
    }

    /// Intervals \[s\] in which the driving signal has no gap, and neither its clock nor that of the `others` was set.
    /// If gaps leave less than half of an unevenly logged signal, only the clock steps divide it.
    pub fn segments(&self, driving: Signal, others: &[Signal]) -> Vec<(f64, f64)> {
        let Some(track) = self.get(driving) else { return Vec::new() };
        let (Some(first), Some(last)) = (track.time.first(), track.time.last()) else {
            return Vec::new();
        };
        let mut parts = track.stretches();
        let known: f64 = parts.iter().map(|(from, to)| to - from).sum();
        // a gap from a clock step is not counted as missing time
        let (mut all, mut set) = (last - first, Vec::new());
        for (from, to) in track.jumps() {
            all -= to - from;
            set.push((from, to));
        }
        if known < 0.5 * all {
            parts = vec![(*first, *last)];
        }
        set.extend(others.iter().filter_map(|s| self.get(*s)).flat_map(Track::jumps));
        for (before, after) in set {
            let cut = |(from, to): (f64, f64)| match from < after && before < to {
                true => vec![(from, before.max(from)), (after.min(to), to)],
                false => vec![(from, to)],
            };
            parts = parts.into_iter().flat_map(cut).filter(|(from, to)| from < to).collect();
        }
        parts
    }

    /// Interval \[s\] in which all measured ones among `signals` have samples: from the latest of their first samples
    /// to the earliest of their last samples. None if it is empty or none of them was measured. A signal that was not
    /// measured does not count.
    pub fn overlap(&self, signals: &[Signal]) -> Option<(f64, f64)> {
        let (mut begin, mut end) = (f64::NEG_INFINITY, f64::INFINITY);
        for track in signals.iter().filter_map(|s| self.get(*s)) {
            begin = begin.max(*track.time.first()?);
            end = end.min(*track.time.last()?);
        }
        (begin < end && begin.is_finite() && end.is_finite()).then_some((begin, end))
    }
}
