//! Renamed options: the old name is refused with a hint to the new one.

use miette::{Result, bail};

/// Refuses an option given by its old name.
///
/// # Errors
///
/// If it is given, with the new name.
pub fn refuse(is_given: bool, old: &str, new: &str) -> Result<()> {
    if is_given {
        bail!("{old} is now {new}: the same with that name");
    }
    Ok(())
}
