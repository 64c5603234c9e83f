//! Options that have another name now: the old one is refused with the new.

use miette::{Result, bail};

/// Refuses an option that was given by its old name.
pub fn refuse(is_given: bool, old: &str, new: &str) -> Result<()> {
    if is_given {
        bail!("{old} is now {new}: the same with that name");
    }
    Ok(())
}
