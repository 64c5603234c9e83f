//! A numeric key of a crane file.

/// Numeric key of a crane file: name, unit, limits and meaning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Key {
    /// Table of the key in the file, without brackets.
    pub section: &'static str,
    /// Name of the key within its table; it ends with the unit.
    pub name: &'static str,
    /// Unit in its usual spelling, for example `N·m`.
    pub unit: &'static str,
    /// One of this unit in SI units; 1e-3 for `mm`.
    pub factor: f64,
    /// Whether only whole numbers are allowed: a count.
    pub is_whole: bool,
    /// Smallest allowed value, in this unit.
    pub low: f64,
    /// Largest allowed value, in this unit.
    pub high: f64,
    /// Value, in this unit, if a file leaves the key out: a default, or a value that switches the effect off. `None`
    /// for a required key.
    pub absent: Option<f64>,
    /// Meaning of the number, with its source where it is a default.
    pub meaning: &'static str,
}

impl Key {
    /// Path of the key, `section.name`.
    pub fn path(&self) -> String {
        format!("{}.{}", self.section, self.name)
    }

    /// Converts a value from this unit to SI units.
    pub fn to_si(&self, value: f64) -> f64 {
        value * self.factor
    }

    /// Converts a value from SI units to this unit, without the conversion's rounding noise.
    pub fn to_unit(&self, value: f64) -> f64 {
        let exact = value / self.factor;
        let shortest: f64 = format!("{exact:.14e}").parse().unwrap_or(exact);
        if self.to_si(shortest) == value || (shortest - exact).abs() <= 1e-14 * exact.abs() {
            shortest
        } else {
            exact
        }
    }
}
