//! Assignment of columns to signals.

use crate::channel::{Channel, Measurement};
use crate::error::MeasurementError;
use crate::guess::by_size;
use crate::signal::Signal;
use crate::time_column::TimeColumn;
use crate::unit::{Unit, UnitError};
use std::collections::BTreeMap;

/// Conversion of a column to a signal: `signal = sign (scale column + offset)` in a unit, logged with a delay and by a
/// clock with a rate error.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Heading or name of the column.
    pub column: String,
    /// Unit after scale and offset; `None` for the unit stated in the log.
    pub unit: Option<Unit>,
    /// Factor on the column, in the unit per unit of the column.
    pub scale: f64,
    /// 1, or −1 if the column has the opposite sign.
    pub sign: f64,
    /// Offset added to the scaled column, in the unit.
    pub offset: f64,
    /// Time by which the logged times are late, relative to sampling \[s\].
    pub delay: f64,
    /// Relative rate error of the column's clock \[-\]: it counts 1 + drift seconds in one second.
    pub drift: f64,
    /// Time constant of the first-order filter in the measurement chain \[s\]; zero for none.
    pub filter: f64,
    /// Whether the column was found by its name and not stated by the user.
    pub is_column_guessed: bool,
    /// Whether the unit was found by magnitude and not stated.
    pub is_unit_guessed: bool,
}

/// Assignment of a log's columns to signals.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mapping {
    /// The time column, if it is not found by its name.
    pub time: TimeColumn,
    /// Column of each assigned signal, with its conversion.
    pub entries: BTreeMap<Signal, Entry>,
}

impl Entry {
    /// Entry of a column without scale, offset, delay or filter, whose unit is that of the log.
    pub fn of(column: &str) -> Self {
        Self {
            column: column.into(),
            unit: None,
            scale: 1.0,
            sign: 1.0,
            offset: 0.0,
            delay: 0.0,
            drift: 0.0,
            filter: 0.0,
            is_column_guessed: false,
            is_unit_guessed: false,
        }
    }

    /// True sampling time \[s\] of a sample that is logged at `time` \[s\]: begin + (time − begin)/(1 + drift) −
    /// delay, where `begin` \[s\] is the first time of the channel.
    pub fn taken(&self, time: f64, begin: f64) -> f64 {
        begin + (time - begin) / (1.0 + self.drift) - self.delay
    }

    /// Value of the signal in SI units (rotation in rev/s) for a number of the column, with this unit after scale and
    /// offset.
    pub fn si(&self, unit: &Unit, number: f64) -> f64 {
        unit.si(self.sign * (self.scale * number + self.offset))
    }

    /// Unit of a channel as a signal, and whether it is guessed: stated by the mapping, by the log, or guessed by
    /// magnitude.
    ///
    /// # Errors
    ///
    /// Text with the reason and the remedy, if the log states a unit that is unknown or of another dimension.
    pub fn unit_of(&self, signal: Signal, channel: &Channel) -> Result<(Unit, bool), String> {
        if let Some(unit) = self.unit {
            return Ok((unit, self.is_unit_guessed));
        }
        let heading = &channel.heading;
        let state = format!(
            "state it in a mapping: [log.{}] column = {heading:?}, unit = \"...\"",
            signal.key()
        );
        if let Some(text) = &channel.unknown_unit {
            let error = match Unit::of_dimension(text, signal.dimension()) {
                Err(error) => error.to_string(),
                Ok(unit) => unit.name.into(),
            };
            return Err(format!(
                "the column \"{heading}\" for {}: {error}; {state}",
                signal.symbol()
            ));
        }
        match channel.unit {
            Some(unit) if signal.accepts(unit.dimension) => Ok((unit, false)),
            Some(unit) => {
                let wanted = signal.dimension();
                let text = unit.name.into();
                let error = UnitError::Dimension { text, found: unit.dimension, wanted };
                Err(format!(
                    "the column \"{heading}\" for {}: {error}; if it is {} all the same, {state}, with scale and offset where \
                     it takes them",
                    signal.symbol(),
                    signal.symbol()
                ))
            }
            None => Ok((by_size(signal, channel, self.scale), true)),
        }
    }
}

impl Mapping {
    /// Completes the mapping with guesses for the signals that it does not name, and with the unit of each column.
    ///
    /// # Errors
    ///
    /// [`MeasurementError::Mapping`] if the mapping names a column that the log lacks, or if the log states a unit
    /// that is unknown or of another dimension.
    pub fn completed(self, log: &Measurement) -> Result<Self, MeasurementError> {
        let (mapping, refused) = self.completed_where_known(log)?;
        match refused.into_iter().next() {
            None => Ok(mapping),
            Some(reason) => Err(MeasurementError::Mapping { file: log.name.clone(), reason }),
        }
    }

    /// Completes the mapping as [`Self::completed`], but leaves out columns whose unit is unknown or of another
    /// dimension, and returns the reason for each.
    ///
    /// # Errors
    ///
    /// [`MeasurementError::Mapping`] if the mapping names a column that the log lacks.
    pub fn completed_where_known(
        mut self,
        log: &Measurement,
    ) -> Result<(Self, Vec<String>), MeasurementError> {
        let mut taken: Vec<&Channel> = Vec::new();
        for (signal, entry) in &self.entries {
            taken.push(log.named(*signal, &entry.column)?);
        }
        for (signal, entry) in Self::guess(log).entries {
            let channel = log.named(signal, &entry.column)?;
            if !taken.iter().any(|other| std::ptr::eq(*other, channel)) {
                self.entries.entry(signal).or_insert(entry);
            }
        }
        let mut refused = Vec::new();
        for (signal, mut entry) in std::mem::take(&mut self.entries) {
            match entry.unit_of(signal, log.named(signal, &entry.column)?) {
                Ok((unit, is_guessed)) => {
                    (entry.unit, entry.is_unit_guessed) = (Some(unit), is_guessed);
                    self.entries.insert(signal, entry);
                }
                Err(reason) => refused.push(reason),
            }
        }
        if let (None, None, Some(found)) = (&self.time.column, self.time.sample_time, &log.time) {
            let found = found.clone();
            self.time = TimeColumn { column: found.column, is_guessed: true, ..self.time };
            self.time.unit = self.time.unit.or(found.unit);
        }
        Ok((self, refused))
    }

    /// Units assumed by magnitude because the log states none: a sentence each, with the line of a mapping that states
    /// them.
    pub fn assumptions(&self, log: &Measurement) -> Vec<String> {
        let mut said = Vec::new();
        for (signal, entry) in &self.entries {
            let Some(unit) = entry.unit.filter(|_| entry.is_unit_guessed) else { continue };
            // the state of a switch has no unit
            if *signal != Signal::HoldingValve {
                said.push(format!(
                    "\"{}\" has no unit: {} is taken in {} by its size; [log.{}] column = {:?}, unit = \"...\" in a mapping states it",
                    entry.column,
                    signal.symbol(),
                    unit.name,
                    signal.key(),
                    entry.column
                ));
            }
        }
        for (signal, columns) in Self::ambiguous(log) {
            if !self.entries.contains_key(&signal) {
                said.push(format!(
                    "none is taken for {} of {}, which are called the same: [log.{}] column = \"{}\" in a mapping says which",
                    signal.symbol(),
                    columns.join(", "),
                    signal.key(),
                    columns[0]
                ));
            }
        }
        for (signal, others) in self.alternatives(log) {
            said.push(format!(
                "{} may be {} too, and differs from \"{}\": [log.{}] column = \"...\" in a mapping says which",
                others.join(", "),
                signal.symbol(),
                self.entries[&signal].column,
                signal.key()
            ));
        }
        for (signal, channel) in Self::misfits(log) {
            if !self.entries.contains_key(&signal)
                && let Some(unit) = channel.unit
            {
                said.push(format!(
                    "\"{}\" is not taken for {}: {} is {}",
                    channel.heading,
                    signal.symbol(),
                    unit.name,
                    unit.dimension.words()
                ));
            }
        }
        said
    }
}
