//! Numbers with five significant digits, more than logs determine of a key.

use std::fmt::{Display, Formatter, Result};

/// Number that is displayed with five significant digits, very small and very large ones with an exponent.
pub struct FiveDigits(pub f64);

impl Display for FiveDigits {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let size = self.0.abs();
        match size != 0.0 && !(1e-3..1e6).contains(&size) {
            true => write!(f, "{:.4e}", self.0),
            false => {
                let digits = (4 - size.max(1e-3).log10().floor() as i32).clamp(0, 7) as usize;
                write!(f, "{:.digits$}", self.0)
            }
        }
    }
}

/// Number rounded to five significant digits.
pub fn rounded(value: f64) -> f64 {
    format!("{value:.4e}").parse().unwrap_or(value)
}
