//! Crane files: one TOML file describes a machine.
//!
//! Every key carries its unit in its name and, if given as a table, where its value comes from:
//!
//! ```toml
//! [boom]
//! length_mm = { value = 3600.0, provenance = "printed", source = "section 2.1" }
//! mass_kg = { value = 86.0, range = [80.0, 92.0] }
//! damping_ratio = 0.001
//! ```
//!
//! `range` has the values that the number may have, in the key's unit; [`Description::ranges`] has them
//! for all keys, by default spreads where the file has none.
//!
//! [`Description::parse`] reads and checks a file, [`Description::set`] overrides single keys, and
//! [`Description::crane`] builds the model. The keys are listed once, in [`schema`].

// its models are built in the control cycle, too, which cannot panic
#![deny(clippy::disallowed_methods)]

mod build;
mod check;
mod difference;
mod digest;
mod equipment_defaults;
mod error;
mod excerpt;
mod parse;
mod placeholder;
mod range;
pub mod schema;
mod spread;

pub use build::BuildError;
pub use difference::{Difference, by_weight, is_of_machine};
pub use equipment_defaults::FilledIn;
pub use error::{DescriptionError, Problem};
pub use parse::suggestion;
pub use placeholder::{PLACEHOLDER, as_placeholders};
pub use range::{RangeSource, Ranges, ValueRange};
pub use schema::{Choices, Key, Numbers, Tuning};

/// Where a value comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct Origin {
    /// `printed`, `derived`, `data sheet`, `estimate`, `calibrated`, `tuned`, `measured`, or
    /// `given` where the file does not say, `set` where the command line did, `absent` for an effect
    /// that the file leaves out, `placeholder` where `hydroboom new` filled it in and nobody has touched it, `typical` where [`Description::virtual_crane`] filled it in.
    pub provenance: String,
    /// Table, section, data sheet or reasoning behind it.
    pub source: String,
    /// Line of the file, counted from one.
    pub line: Option<usize>,
}

impl Origin {
    /// Provenance of a key that the file does not have and need not have.
    const ABSENT: &str = "absent";

    /// Of such a key.
    fn absent() -> Self {
        let source = "not in the file: its default".into();
        Self { provenance: Self::ABSENT.into(), source, line: None }
    }
}

impl Origin {
    /// Whether the crane file or an override states the key: not a default, nor of another circuit.
    pub fn is_stated(&self) -> bool {
        self.line.is_some() || self.provenance == "set"
    }

    /// Of a key that another circuit or structure has.
    fn foreign() -> Self {
        Self { provenance: "foreign".into(), source: "not of this crane".into(), line: None }
    }
}

/// A machine, as described by its file: numbers in SI units, choices, and the origin of each.
#[derive(Clone, Debug)]
pub struct Description {
    /// Name of the machine.
    pub name: String,
    /// All numbers, in SI units.
    pub numbers: Numbers<f64>,
    /// All choices.
    pub choices: Choices,
    /// Relative lengths of the boom's segments, from the bearing to the tip.
    pub segment_shares: Vec<f64>,
    /// Origin of every number, in the order of [`schema::KEYS`].
    origins: Vec<Origin>,
    /// Range of every number that the file gives one, in SI units, in the order of [`schema::KEYS`].
    file_ranges: Vec<Option<[f64; 2]>>,
    /// Whether its file is embedded in the program: no lines that a user could look at.
    is_embedded: bool,
}

/// The paper's crane.
pub const UIA_SINGLE_BOOM: &str = include_str!("../../../cranes/uia-single-boom.toml");

/// The virtual crane.
pub const UIA_VIRTUAL: &str = include_str!("../../../cranes/uia-virtual.toml");

/// A forestry crane's lift, valve-controlled.
pub const PATU_LIFT: &str = include_str!("../../../cranes/patu-lift.toml");

impl Description {
    /// A forestry crane's lift with a valve-controlled circuit and a boom of links, embedded.
    ///
    /// # Errors
    ///
    /// None, as a test shows; the signature is that of any file.
    pub fn patu_lift() -> Result<Self, DescriptionError> {
        Self::embedded("cranes/patu-lift.toml (embedded)", PATU_LIFT)
    }

    /// The paper's crane, embedded.
    ///
    /// # Errors
    ///
    /// None, as a test shows; the signature is that of any file.
    pub fn uia_single_boom() -> Result<Self, DescriptionError> {
        Self::embedded("cranes/uia-single-boom.toml (embedded)", UIA_SINGLE_BOOM)
    }

    /// The virtual crane, embedded: stands in for the real one, and is no measurement of it.
    ///
    /// # Errors
    ///
    /// None, as a test shows; the signature is that of any file.
    pub fn uia_virtual() -> Result<Self, DescriptionError> {
        Self::embedded("cranes/uia-virtual.toml (embedded)", UIA_VIRTUAL)
    }

    fn embedded(name: &str, text: &str) -> Result<Self, DescriptionError> {
        Ok(Self { is_embedded: true, ..Self::parse(name, text)? })
    }

    /// Every key that a crane of this kind has, with its value and origin as in [`entries`](Self::entries).
    pub fn own_entries(&self) -> impl Iterator<Item = (&'static Key, f64, &Origin)> {
        let values = self.numbers.to_array();
        self.own_keys().map(move |index| {
            let key = &schema::KEYS[index];
            (key, key.to_unit(values[index]), &self.origins[index])
        })
    }

    /// Places in [`schema::KEYS`] of the keys that a crane of this kind has.
    fn own_keys(&self) -> impl Iterator<Item = usize> {
        let segments = self.segment_shares.len();
        (0..schema::KEYS.len()).filter(move |index| {
            let key = &schema::KEYS[*index];
            self.choices.excludes(key.section, key.name, segments).is_none()
        })
    }

    /// Every choice that a crane of this kind has, with its name.
    pub fn own_choices(&self) -> Vec<(&'static str, &'static str)> {
        let segments = self.segment_shares.len();
        let is_own = |path: &str| {
            let (section, name) = path.split_once('.').unwrap_or((path, ""));
            self.choices.excludes(section, name, segments).is_none()
        };
        self.choices.list().into_iter().filter(|(path, _)| is_own(path)).collect()
    }

    /// Every key with its value in the key's own unit and its origin.
    pub fn entries(&self) -> impl Iterator<Item = (&'static Key, f64, &Origin)> {
        let values = self.numbers.to_array();
        schema::KEYS
            .iter()
            .zip(values)
            .zip(&self.origins)
            .map(|((key, value), origin)| (key, key.to_unit(value), origin))
    }
}

/// Overrides that make the embedded off-model plant.
pub const OFF_MODEL: &str = include_str!("../../../cranes/off-model.toml");

impl Description {
    /// The description with every override of a `[set]` table applied, and the overrides as
    /// `section.key = value`.
    ///
    /// # Errors
    ///
    /// [`DescriptionError`] when the text is not such a table or an override is wrong.
    pub fn overridden(
        &self,
        name: &str,
        text: &str,
    ) -> Result<(Self, Vec<String>), DescriptionError> {
        let wrong = |message: String| {
            let help = "write a [set] table of \"section.key\" = value".into();
            DescriptionError::of(name, message, Some(help))
        };
        let table: toml::Table =
            text.parse().map_err(|e: toml::de::Error| wrong(e.message().to_string()))?;
        let set = table
            .get("set")
            .and_then(toml::Value::as_table)
            .ok_or_else(|| wrong("no [set] table".into()))?;
        let mut changed = self.clone();
        let mut overrides = Vec::new();
        let assignments: Vec<String> =
            set.iter().map(|(key, value)| format!("{key}={value}")).collect();
        changed.set_together(assignments.iter().map(String::as_str))?;
        for (key, value) in set {
            overrides.push(match value.as_float() {
                Some(small) if small != 0.0 && small.abs() < 1e-3 => format!("{key} = {small:e}"),
                _ => format!("{key} = {value}"),
            });
        }
        Ok((changed, overrides))
    }
}
