//! Model that the controllers of a virtual crane use.

use crate::crane_file::{CraneFile, self_contained, text};
use crate::output;
use hydroboom_description::Description;
use miette::Result;
use std::path::Path;

/// Model that the controllers of a virtual crane use: the file `model` if named, else the crane file of the virtual
/// crane without overrides, else the paper's crane. A note on standard error names a model that was not asked for.
///
/// The file of the paper's virtual crane has the paper's crane as its model, as if it were not named.
///
/// # Errors
///
/// If a crane file is invalid, or the model is valve-controlled.
pub fn controller_model(crane: &CraneFile, model: Option<&Path>) -> Result<Description> {
    let read = |path: &Path| -> Result<Description> {
        self_contained(Description::parse(&path.display().to_string(), &text(path)?)?)
    };
    let (own, path) = match (model, crane.path()) {
        (Some(path), _) => return read(path),
        (None, None) => return Ok(Description::uia_single_boom()?),
        (None, Some(path)) => (read(path)?, path),
    };
    let (known, from) = match own.digest() == Description::uia_virtual()?.digest() {
        true => (Description::uia_single_boom()?, "of which this is the virtual crane".to_string()),
        false => (own, format!("as {} describes it", path.display())),
    };
    let without = if crane.is_overridden() { ", without --set" } else { "" };
    output::note(&format!(
        "the controllers know \"{}\", {from}{without}; --model names another crane file",
        known.name
    ));
    Ok(known)
}
