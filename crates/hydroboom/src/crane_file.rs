//! The options that choose a crane.

use clap::Args;
use hydroboom_description::Description;
use miette::{IntoDiagnostic, Result, WrapErr};
use std::path::{Path, PathBuf};

/// The options that choose a crane.
#[derive(Args)]
pub struct CraneFile {
    /// Crane file; the paper's crane when not given.
    #[arg(long, value_name = "FILE")]
    crane: Option<PathBuf>,
    /// Override a key, e.g. --set boom.segments=10; can be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

impl CraneFile {
    /// Reads the crane, applies the overrides, and says what looks wrong.
    pub fn read(&self) -> Result<Description> {
        let mut description = match &self.crane {
            Some(path) => Description::parse(&path.display().to_string(), &text(path)?)?,
            None => Description::uia_single_boom()?,
        };
        for assignment in &self.set {
            description.set(assignment)?;
        }
        for warning in description.warnings() {
            eprintln!("warning: {warning}");
        }
        Ok(description)
    }
}

/// A file's text.
pub fn text(path: &Path) -> Result<String> {
    let bytes = std::fs::read(path)
        .into_diagnostic()
        .wrap_err_with(|| format!("{} cannot be read", path.display()))?;
    String::from_utf8(bytes)
        .map_err(|_| miette::miette!("{} is not a text file (UTF-8)", path.display()))
}
