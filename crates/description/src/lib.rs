//! Crane files: one TOML file describes a machine.
//!
//! Every key carries its unit in its name. If given as a table, it states the provenance of its value:
//!
//! ```toml
//! [boom]
//! length_mm = { value = 3600.0, provenance = "printed", source = "section 2.1" }
//! mass_kg = { value = 86.0, range = [80.0, 92.0] }
//! damping_ratio = 0.001
//! ```
//!
//! `range` holds the smallest and largest plausible value, in the key's unit. [`Description::ranges`] returns the
//! ranges of all keys, with default spreads for keys without one.
//!
//! [`Description::parse`] reads and checks a file, [`Description::set`] overrides single keys, and
//! [`Description::crane`] builds the model. The keys are listed once, in [`schema`], and their tables in [`section`].

// models are also built in the control cycle, which must not panic
#![deny(clippy::disallowed_methods)]

mod build;
mod check;
mod difference;
mod digest;
mod equipment_defaults;
mod error;
mod excerpt;
mod limit;
mod millimetres;
mod overrides;
mod parse;
mod placeholder;
mod range;
pub mod schema;
pub mod section;
mod spread;
mod suggestion;

pub use build::BuildError;
pub use difference::{Difference, by_weight, is_of_machine};
pub use digest::digest_of;
pub use equipment_defaults::FilledIn;
pub use error::{DescriptionError, Problem};
pub use millimetres::millimetres;
pub use placeholder::{PLACEHOLDER, as_placeholders};
pub use range::{RangeSource, Ranges, ValueRange};
pub use schema::{Choices, Key, Numbers, Tuning};
pub use suggestion::suggestion;

/// Provenance of a value.
#[derive(Clone, Debug, PartialEq)]
pub struct Origin {
    /// `printed`, `derived`, `data sheet`, `estimate`, `calibrated`, `tuned` or `measured` as stated by the file;
    /// `given` if the file states none; `set` for an override. `absent` marks an effect that the file leaves out,
    /// `placeholder` an unedited value from `hydroboom new`, and `typical` a value from
    /// [`Description::virtual_crane`].
    pub provenance: String,
    /// Table, section, data sheet or reasoning behind it.
    pub source: String,
    /// Line of the file, counted from one.
    pub line: Option<usize>,
}

impl Origin {
    /// Provenance of an optional key that the file leaves out.
    const ABSENT: &str = "absent";

    /// Origin of such a key.
    fn absent() -> Self {
        let source = "not in the file: its default".into();
        Self { provenance: Self::ABSENT.into(), source, line: None }
    }
}

impl Origin {
    /// Whether the crane file or an override states the key; false for defaults and keys of another kind of crane.
    pub fn is_stated(&self) -> bool {
        self.line.is_some() || self.provenance == "set"
    }

    /// Origin of a key that this kind of crane does not have.
    fn foreign() -> Self {
        Self { provenance: "foreign".into(), source: "not of this crane".into(), line: None }
    }
}

/// Description of a machine by its crane file: numbers in SI units, choices, and the origin of each.
///
/// ```
/// use hydroboom_description::{Description, UIA_SINGLE_BOOM};
///
/// let mut crane = Description::parse("crane.toml", UIA_SINGLE_BOOM)?;
/// crane.set("payload.mass_kg=100")?;
/// assert_eq!(crane.numbers.payload, 100.0);
/// // keys have their own unit, here `cylinder.stroke_mm = 500`, numbers SI units
/// assert!((crane.numbers.stroke - 0.5).abs() < 1e-12);
/// // a value beyond its limits is refused
/// assert!(crane.set("payload.mass_kg=-1").is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Description {
    /// Name of the machine.
    pub name: String,
    /// Values of all numeric keys, in SI units.
    pub numbers: Numbers<f64>,
    /// Values of all choices.
    pub choices: Choices,
    /// Lengths of the boom's segments as shares of its length, from the bearing to the tip.
    pub segment_shares: Vec<f64>,
    /// Origin of every number, in the order of [`schema::KEYS`].
    origins: Vec<Origin>,
    /// Range of every number, in SI units and the order of [`schema::KEYS`]; `None` where the file states none.
    file_ranges: Vec<Option<[f64; 2]>>,
    /// Whether its file is embedded in the program, so that line numbers have no meaning for the user.
    is_embedded: bool,
}

/// Crane file of the paper's crane.
pub const UIA_SINGLE_BOOM: &str = include_str!("../../../cranes/uia-single-boom.toml");

/// Crane file of the virtual crane.
pub const UIA_VIRTUAL: &str = include_str!("../../../cranes/uia-virtual.toml");

/// Crane file of the lift cylinder of a forestry crane, valve-controlled.
pub const PATU_LIFT: &str = include_str!("../../../cranes/patu-lift.toml");

impl Description {
    /// Lift cylinder of a forestry crane with a valve-controlled circuit and a boom of links, from its embedded file.
    ///
    /// # Errors
    ///
    /// None, as a test shows; the signature is that of any file.
    pub fn patu_lift() -> Result<Self, DescriptionError> {
        Self::embedded("cranes/patu-lift.toml (embedded)", PATU_LIFT)
    }

    /// The paper's crane, from its embedded file.
    ///
    /// # Errors
    ///
    /// None, as a test shows; the signature is that of any file.
    pub fn uia_single_boom() -> Result<Self, DescriptionError> {
        Self::embedded("cranes/uia-single-boom.toml (embedded)", UIA_SINGLE_BOOM)
    }

    /// The virtual crane, from its embedded file: a simulated substitute for the real crane, not identified from it.
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

    /// Keys of this kind of crane, with the value in the key's own unit and its origin.
    pub fn own_entries(&self) -> impl Iterator<Item = (&'static Key, f64, &Origin)> {
        let values = self.numbers.to_array();
        self.own_keys().map(move |index| {
            let key = &schema::KEYS[index];
            (key, key.to_unit(values[index]), &self.origins[index])
        })
    }

    /// Indices in [`schema::KEYS`] of the keys of this kind of crane.
    fn own_keys(&self) -> impl Iterator<Item = usize> {
        let segments = self.segment_shares.len();
        (0..schema::KEYS.len()).filter(move |index| {
            let key = &schema::KEYS[*index];
            self.choices.excludes(key.section, key.name, segments).is_none()
        })
    }

    /// Choices of this kind of crane: path and chosen name.
    pub fn own_choices(&self) -> Vec<(&'static str, &'static str)> {
        let segments = self.segment_shares.len();
        let is_own = |path: &str| {
            let (section, name) = path.split_once('.').unwrap_or((path, ""));
            self.choices.excludes(section, name, segments).is_none()
        };
        self.choices.list().into_iter().filter(|(path, _)| is_own(path)).collect()
    }

    /// All keys, with the value in the key's own unit and its origin.
    pub fn entries(&self) -> impl Iterator<Item = (&'static Key, f64, &Origin)> {
        let values = self.numbers.to_array();
        schema::KEYS
            .iter()
            .zip(values)
            .zip(&self.origins)
            .map(|((key, value), origin)| (key, key.to_unit(value), origin))
    }
}

/// Overrides of the embedded plant for tests with model mismatch, a `[set]` table.
pub const OFF_MODEL: &str = include_str!("../../../cranes/off-model.toml");

impl Description {
    /// The description with every override of a `[set]` table applied, and the overrides as
    /// `section.key = value`.
    ///
    /// # Errors
    ///
    /// [`DescriptionError`] if the text is not such a table or an override is invalid.
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
