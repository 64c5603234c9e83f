//! Which column is which signal.

use crate::channel::{Channel, Measurement};
use crate::error::MeasurementError;
use crate::guess::by_size;
use crate::signal::Signal;
use crate::time_column::TimeColumn;
use crate::unit::{Unit, UnitError};
use std::collections::BTreeMap;

/// A column that holds a signal: `signal = sign (scale column + offset)` in a unit, as it was `delay` before, on a clock that
/// may run fast.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Heading or name of the column.
    pub column: String,
    /// Unit of what comes of scale and offset; the one that the log states for the column where none.
    pub unit: Option<Unit>,
    /// What the column is multiplied by.
    pub scale: f64,
    /// −1 where the column counts the other way.
    pub sign: f64,
    /// What is added to the scaled column, in the unit.
    pub offset: f64,
    /// How late the column is \[s\].
    pub delay: f64,
    /// How much too fast the column's clock runs: it counts 1 + drift seconds in one.
    pub drift: f64,
    /// Time constant of a first-order filter that the column went through \[s\]; zero for none.
    pub filter: f64,
    /// Whether the column was found by its name, and named by nobody.
    pub is_column_guessed: bool,
    /// Whether the unit was found by the size of the numbers, and stated nowhere.
    pub is_unit_guessed: bool,
}

/// Which column is which signal.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mapping {
    /// The time's column, where it is not named as one.
    pub time: TimeColumn,
    /// The columns.
    pub entries: BTreeMap<Signal, Entry>,
}

impl Entry {
    /// A column as it is.
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

    /// When a sample was taken that its channel has at a time \[s\], for a channel that begins at another.
    pub fn taken(&self, time: f64, begin: f64) -> f64 {
        begin + (time - begin) / (1.0 + self.drift) - self.delay
    }

    /// A number of the column in SI units, for the unit that it is in.
    pub fn si(&self, unit: &Unit, number: f64) -> f64 {
        unit.si(self.sign * (self.scale * number + self.offset))
    }

    /// The unit that a channel is in as a signal: the mapping's, the log's, or one that fits its size.
    ///
    /// # Errors
    ///
    /// What is wrong, and what to write: the log states a unit that is unknown or measures something else.
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
    /// This mapping, completed by what is guessed of what it does not name, with the unit of each column.
    ///
    /// # Errors
    ///
    /// [`MeasurementError::Mapping`] where it names a column that is not there, or the log states a unit that is unknown or of
    /// the wrong dimension.
    pub fn completed(self, log: &Measurement) -> Result<Self, MeasurementError> {
        let (mapping, refused) = self.completed_where_known(log)?;
        match refused.into_iter().next() {
            None => Ok(mapping),
            Some(reason) => Err(MeasurementError::Mapping { file: log.name.clone(), reason }),
        }
    }

    /// The same without the columns whose units are unknown or of the wrong dimension, and what is wrong with each of them.
    ///
    /// # Errors
    ///
    /// [`MeasurementError::Mapping`] where it names a column that is not there.
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

    /// What is taken without being stated anywhere: units by the size of numbers. Sentences, each with what to write.
    pub fn assumptions(&self, log: &Measurement) -> Vec<String> {
        let mut said = Vec::new();
        for (signal, entry) in &self.entries {
            let Some(unit) = entry.unit.filter(|_| entry.is_unit_guessed) else { continue };
            // of a switch nobody states one
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
        for (signal, others) in self.rivals(log) {
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
