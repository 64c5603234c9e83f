//! A numeric key of a crane file.

/// One numeric key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Key {
    /// Table in the file.
    pub section: &'static str,
    /// Name within the table; it ends with the unit.
    pub name: &'static str,
    /// Usual spelling of the unit.
    pub unit: &'static str,
    /// Size of the unit in SI units.
    pub factor: f64,
    /// Whether only whole numbers are allowed: a count.
    pub is_whole: bool,
    /// Smallest allowed value, in this unit.
    pub low: f64,
    /// Largest allowed value, in this unit.
    pub high: f64,
    /// Value, in this unit, if a file leaves the key out: the effect is off, or a default. `None` for a required key.
    pub absent: Option<f64>,
    /// Meaning.
    pub meaning: &'static str,
}

impl Key {
    /// `section.name`.
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
