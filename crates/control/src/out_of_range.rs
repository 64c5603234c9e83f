//! What was read back and cannot be.

/// Decimals and back, in another unit, may move a number at an end of its range by a share of this.
const DECIMALS: f64 = 1e-12;

/// A number that was read back and is not within its range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutOfRange {
    /// Its place among the fields of its record.
    pub field: usize,
    /// The lowest and the highest value that it may have beside the fields before it, in its unit.
    pub range: [f64; 2],
}

impl OutOfRange {
    /// Refuses a number that is not within its range, of the field at a place. NaN is within none.
    ///
    /// # Errors
    ///
    /// The field and its range.
    pub(crate) fn check(field: usize, number: f64, range: [f64; 2]) -> Result<(), Self> {
        let [lowest, highest] = range;
        let within = lowest - DECIMALS * lowest.abs()..=highest + DECIMALS * highest.abs();
        match within.contains(&number) && number.is_finite() {
            true => Ok(()),
            false => Err(Self { field, range }),
        }
    }
}
