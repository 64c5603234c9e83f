//! Prefix of the names that a generated source exports.

use crate::error::ExportError;

/// Prefix of all type names and of all functions with external linkage, so that several cranes can be linked into one
/// program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Prefix(String);

impl Prefix {
    /// Largest number of characters of a prefix: all names stay below 63 characters, which common linkers distinguish.
    /// C99 itself guarantees 31 for external names (5.2.4.1).
    pub const LONGEST: usize = 24;

    /// A prefix for C names.
    ///
    /// # Errors
    ///
    /// [`ExportError::Prefix`] if it is empty, longer than [`LONGEST`](Self::LONGEST), begins with a digit or an
    /// underscore (reserved for the compiler), or contains anything but ASCII letters, digits and underscores.
    pub fn new(text: &str) -> Result<Self, ExportError> {
        let is_name = text.starts_with(|c: char| c.is_ascii_alphabetic())
            && text.len() <= Self::LONGEST
            && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        match is_name {
            true => Ok(Self(text.into())),
            false => Err(ExportError::Prefix { found: text.into(), longest: Self::LONGEST }),
        }
    }

    /// Prefix as text, as `hb_`.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl Default for Prefix {
    fn default() -> Self {
        Self("hb_".into())
    }
}
