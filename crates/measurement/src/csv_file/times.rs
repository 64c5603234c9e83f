//! Detection of a table's time columns and their unit, from names, units and content.

use super::cell::Cell;
use super::columns::{Column, Kind};
use super::style::Style;
use crate::dimension::Dimension;
use crate::error::MeasurementError;
use crate::time_column::TimeColumn;
use crate::time_unit::{FAR, interval, resolve};

/// Tick of the Windows file time \[s\], used by TwinCAT Scope.
const TICK: f64 = 1e-7;

/// Source of the times of some columns.
#[derive(Clone, Debug)]
pub(super) enum Source {
    /// A column of numbers; time \[s\] = factor number + offset.
    Number { column: usize, factor: f64, offset: f64, is_far: bool },
    /// A column of dates and times; the column of dates if that is a separate one.
    Stamp { column: usize, date: Option<usize> },
    /// Row count times an interval \[s\].
    Counted { interval: f64 },
}

/// Columns with the same times.
pub(super) struct Base {
    pub(super) source: Source,
    pub(super) members: Vec<usize>,
}

/// The first rows, with the mapping's statements about the time.
pub(super) struct Times<'a> {
    pub(super) file: &'a str,
    pub(super) style: &'a Style,
    pub(super) columns: &'a [Column],
    pub(super) wanted: &'a TimeColumn,
}

impl Times<'_> {
    /// Groups the columns by their times.
    pub(super) fn bases(&self, remarks: &mut Vec<String>) -> Result<Vec<Base>, MeasurementError> {
        let all = || (0..self.columns.len()).filter(|k| self.columns[*k].kind != Kind::Text);
        if let Some(interval) = self.wanted.sample_time {
            remarks.push(format!(
                "rows are counted, {:?} ms apart, as the sample time says",
                interval * 1e3
            ));
            let of_time = |k: &usize| {
                let column = &self.columns[*k];
                column.is_scope_time || column.kind == Kind::Stamp || column.read.is_named_as_time()
            };
            let members = all().filter(|k| !of_time(k)).collect();
            return Ok(vec![Base { source: Source::Counted { interval }, members }]);
        }
        let times = match self.wanted.column.as_deref() {
            Some(name) => self.named(name)?,
            None if self.columns.iter().any(|c| c.is_scope_time) => {
                all().filter(|k| self.columns[*k].is_scope_time).collect()
            }
            None if self.columns.iter().any(|c| c.interval.is_some()) => {
                return Ok(self.counted());
            }
            None => self.found(remarks)?,
        };
        let Some(first) = times.first().copied() else { return Ok(Vec::new()) };
        let date = self.date_beside(first);
        let is_time = |k: usize| times.contains(&k) || Some(k) == date;
        let mut bases: Vec<Base> = Vec::new();
        for (place, time) in times.iter().enumerate() {
            // columns before the first time column belong to it too
            let from = if place == 0 { 0 } else { *time };
            let to = times.get(place + 1).copied().unwrap_or(self.columns.len());
            let members: Vec<usize> =
                all().filter(|k| (from..to).contains(k) && !is_time(*k)).collect();
            if !members.is_empty() {
                let source = self.source(*time, date.filter(|_| place == 0), remarks)?;
                bases.push(Base { source, members });
            }
        }
        Ok(bases)
    }

    /// Columns with the sampling interval that the head states.
    fn counted(&self) -> Vec<Base> {
        let mut bases: Vec<Base> = Vec::new();
        let is_signal = |c: &Column| c.kind != Kind::Text && !c.read.is_named_as_time();
        for (k, column) in self.columns.iter().enumerate().filter(|(_, c)| is_signal(c)) {
            let interval = column.interval.unwrap_or(1e-3);
            let same = bases.last_mut().filter(
                |b| matches!(b.source, Source::Counted { interval: other } if other == interval),
            );
            match same {
                Some(base) => base.members.push(k),
                None => {
                    bases.push(Base { source: Source::Counted { interval }, members: vec![k] });
                }
            }
        }
        bases
    }

    /// The time column named by a mapping; all columns of that name if each channel has its own.
    fn named(&self, name: &str) -> Result<Vec<usize>, MeasurementError> {
        let called = |is: &dyn Fn(&Column) -> bool| -> Vec<usize> {
            (0..self.columns.len()).filter(|k| is(&self.columns[*k])).collect()
        };
        let by_heading = called(&|c| c.heading == name);
        let by_name = called(&|c| c.read.name == name);
        let numbered = name.rsplit_once('#').and_then(|(name, place)| {
            let place = place.parse::<usize>().ok()?.checked_sub(1)?;
            called(&|c| c.heading == name || c.read.name == name).get(place).copied()
        });
        match (by_heading.is_empty(), by_name.is_empty(), numbered) {
            (false, ..) => Ok(by_heading),
            (_, false, _) => Ok(by_name),
            (_, _, Some(one)) => Ok(vec![one]),
            _ => Err(MeasurementError::Mapping {
                file: self.file.into(),
                reason: format!(
                    "the mapping names \"{name}\" as the time; the columns are: {}",
                    self.headings()
                ),
            }),
        }
    }

    fn headings(&self) -> String {
        let all: Vec<&str> = self.columns.iter().map(|c| c.heading.as_str()).collect();
        let more =
            if all.len() > 40 { format!(" and {} more", all.len() - 40) } else { String::new() };
        format!("{}{more}", all[..all.len().min(40)].join(", "))
    }

    /// Columns whose name, unit and content are those of a time. The first applies to all columns before the second.
    fn found(&self, remarks: &mut Vec<String>) -> Result<Vec<usize>, MeasurementError> {
        let score = |k: usize| -> f64 {
            let column = &self.columns[k];
            let is_stamp = column.kind == Kind::Stamp;
            let has_unit = column.read.unit.is_some_and(|u| u.dimension == Dimension::Time);
            let is_named = column.read.is_named_as_time();
            if column.kind == Kind::Text || (!is_stamp && !self.goes_on(k)) {
                return 0.0;
            }
            // a word is stronger evidence than a letter, a small letter stronger than a capital one
            let by_name = match (is_named, column.read.name.as_str()) {
                (true, "T") => 0.5,
                // "temps" is a time in French, and elsewhere temperatures
                (true, name) if name.eq_ignore_ascii_case("temps") => 0.75,
                (true, name) if name.chars().count() == 1 => 1.0,
                (true, _) => 2.0,
                _ => 0.0,
            };
            let by_unit = if has_unit { 1.5 } else { 0.0 };
            let by_kind = if is_stamp { 2.0 } else { 0.0 };
            by_name + by_unit + by_kind
        };
        let mut best: Option<(f64, usize)> = None;
        for k in 0..self.columns.len() {
            if score(k) > best.map_or(0.0, |(most, _)| most) {
                best = Some((score(k), k));
            }
        }
        let Some((_, best)) = best else {
            return self.first_that_goes_on(remarks).map(|k| vec![k]);
        };
        // with a time column for each channel, the names differ only in a number at the end
        let base = stem(&self.columns[best].read.name);
        let is_again = |k: &usize| {
            let name = &self.columns[*k].read.name;
            *k == best
                || (*k > best
                    && stem(name) == base
                    && (*name == self.columns[best].read.name || base.len() > 2)
                    && (self.columns[*k].kind == Kind::Stamp || self.goes_on(*k)))
        };
        Ok((0..self.columns.len()).filter(is_again).collect())
    }

    /// Without a time column by name: the first column, if it increases in even steps.
    fn first_that_goes_on(&self, remarks: &mut Vec<String>) -> Result<usize, MeasurementError> {
        let first = self.columns.iter().position(|c| c.kind == Kind::Number);
        if let Some(first) = first
            && self.columns[first].read.unit.is_none()
            && self.is_even(first)
        {
            remarks.push(format!(
                "no column is named as a time: \"{}\" is taken for it, because it increases by even steps",
                self.columns[first].heading
            ));
            return Ok(first);
        }
        let named: Vec<&str> = self
            .columns
            .iter()
            .filter(|c| c.read.is_named_as_time())
            .map(|c| c.heading.as_str())
            .collect();
        let what = match named.as_slice() {
            [] => {
                "no column is named as a time, and the first does not increase by even steps".into()
            }
            names => format!("{} is named as a time, and does not go on as one", names.join(", ")),
        };
        let no_unit = self.columns.iter().all(|c| c.read.unit.is_none());
        let units = if no_unit { "; and no column has a unit" } else { "" };
        Err(MeasurementError::Format {
            file: self.file.into(),
            reason: format!(
                "it has no column of times: {what} (there are: {}){units}. If its rows are evenly spaced, give their interval (--sample-time-ms, or sample_time_ms \
                 in a mapping); else name the column ([log] time = \"...\" in a mapping)",
                self.headings()
            ),
        })
    }

    /// Numbers of a column in the first rows.
    fn numbers(&self, k: usize) -> Vec<f64> {
        let cells = self.style.sample.iter().filter_map(|row| row.get(k));
        cells.map(|c| c.number()).filter(|v| v.is_finite()).collect()
    }

    /// Whether a column increases like a clock in the first rows: at most one step in twenty is negative, and at
    /// least half are positive.
    fn goes_on(&self, k: usize) -> bool {
        let numbers = self.numbers(k);
        let steps = numbers.len().saturating_sub(1);
        let back = numbers.windows(2).filter(|w| w[1] < w[0]).count();
        let on = numbers.windows(2).filter(|w| w[1] > w[0]).count();
        // stamps with a coarser resolution than the row interval repeat
        steps == 0 || (on > 0 && back * 20 <= steps.max(20))
    }

    /// Whether a column increases in even steps in the first rows.
    fn is_even(&self, k: usize) -> bool {
        let numbers = self.numbers(k);
        let Some(usual) = interval(&numbers) else { return false };
        let even =
            numbers.windows(2).filter(|w| (w[1] - w[0] - usual).abs() <= 0.5 * usual).count();
        even * 20 >= numbers.len().saturating_sub(1) * 19
    }

    /// A column of dates next to a column of times of day.
    fn date_beside(&self, time: usize) -> Option<usize> {
        let stamp = |k: usize| {
            self.style.sample.iter().find_map(|row| match row.get(k) {
                Some(Cell::Stamp(stamp)) => Some(*stamp),
                _ => None,
            })
        };
        let has = |k: usize| stamp(k).map(|s| (s.day.is_some(), s.seconds.is_some()));
        let is_clock = self.columns[time].kind == Kind::Stamp && has(time) == Some((false, true));
        let is_date = |k: &usize| {
            self.columns.get(*k).is_some_and(|c| c.kind == Kind::Stamp)
                && has(*k) == Some((true, false))
        };
        let beside = [time.wrapping_sub(1), time + 1];
        beside.into_iter().find(is_date).filter(|_| is_clock)
    }

    fn source(
        &self,
        column: usize,
        date: Option<usize>,
        remarks: &mut Vec<String>,
    ) -> Result<Source, MeasurementError> {
        if self.columns[column].kind == Kind::Stamp {
            return Ok(Source::Stamp { column, date });
        }
        let numbers = self.numbers(column);
        let first = numbers.first().copied().unwrap_or(0.0);
        let unit = self.unit(column, first, interval(&numbers), remarks)?;
        let TimeColumn { scale, offset, .. } = *self.wanted;
        Ok(Source::Number {
            column,
            factor: unit * scale,
            offset: offset * unit,
            is_far: (first * scale + offset).abs() * unit > FAR,
        })
    }

    /// Size of one unit of a column's numbers \[s\].
    fn unit(
        &self,
        column: usize,
        first: f64,
        interval: Option<f64>,
        remarks: &mut Vec<String>,
    ) -> Result<f64, MeasurementError> {
        let Column { heading, read, is_scope_time, .. } = &self.columns[column];
        // a stated unit has priority
        let has_ticks = *is_scope_time && first > 1e15 && self.wanted.unit.is_none();
        if has_ticks {
            remarks.push("times are ticks of 100 ns, as TwinCAT Scope writes them".into());
        }
        let own = has_ticks.then_some(TICK);
        let (factor, remark) = resolve(heading, read, Some(self.wanted), own, first, interval)
            .map_err(|reason| MeasurementError::Mapping { file: self.file.into(), reason })?;
        remarks.extend(remark);
        Ok(factor)
    }
}

/// A name without a number at its end.
fn stem(name: &str) -> &str {
    name.trim_end_matches(|c: char| c.is_ascii_digit()).trim_end_matches(['_', '.', '#', ' ', '-'])
}
