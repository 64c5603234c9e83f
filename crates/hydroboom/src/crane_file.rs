//! Options that select a crane.

use crate::paths::InputFile;
use crate::{origin, output};
use clap::Args;
use hydroboom_description::schema::CircuitChoice;
use hydroboom_description::{Description, DescriptionError, UIA_SINGLE_BOOM, UIA_VIRTUAL};
use hydroboom_lab::paper;
use miette::{IntoDiagnostic, Result, miette};
use std::ffi::OsString;
use std::path::Path;

/// The options that choose a crane.
#[derive(Args)]
pub struct CraneFile {
    /// Crane file; an embedded one when not given: the paper's crane, or the virtual one.
    #[arg(long, value_name = "FILE")]
    crane: Option<InputFile>,
    /// Override a key, e.g. --set boom.segments=10, within its range where the file states one; can be repeated,
    /// and all are applied together.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

impl CraneFile {
    /// Whether the crane is an embedded one, with or without overrides.
    pub fn is_embedded(&self) -> bool {
        self.crane.is_none()
    }

    /// Whether the crane with its overrides is the paper's. The paper's values are shown for no other.
    ///
    /// # Errors
    ///
    /// If the crane file or an override is invalid.
    pub fn is_papers_crane(&self) -> Result<bool> {
        let mut crane = match &self.crane {
            Some(path) => Description::parse(&path.display().to_string(), &text(path)?)?,
            None => Description::uia_single_boom()?,
        };
        crane.set_together_within_range(self.set.iter().map(String::as_str))?;
        Ok(paper::is_its_crane(&crane))
    }

    /// Path of the crane file, if one is named.
    pub fn path(&self) -> Option<&Path> {
        self.crane.as_deref()
    }

    /// The options as arguments of a command in another process.
    pub fn arguments(&self) -> Vec<OsString> {
        let crane = self.crane.iter().flat_map(|path| ["--crane".into(), path.as_os_str().into()]);
        crane.chain(self.set.iter().flat_map(|set| ["--set".into(), set.into()])).collect()
    }

    /// The options as text for a command that is suggested, each after a space.
    pub fn options(&self) -> String {
        self.arguments().iter().map(|part| format!(" {}", part.to_string_lossy())).collect()
    }

    /// Text of the crane file without the overrides; the paper's by default.
    ///
    /// # Errors
    ///
    /// If the file cannot be read.
    pub fn text(&self) -> Result<String> {
        self.crane.as_deref().map_or_else(|| Ok(UIA_SINGLE_BOOM.into()), text)
    }

    /// Overrides `section.key=value` as entered.
    pub fn overrides(&self) -> &[String] {
        &self.set
    }

    /// Whether there are overrides.
    pub fn is_overridden(&self) -> bool {
        !self.set.is_empty()
    }

    /// Reads the crane, the paper's by default, applies the overrides, and prints warnings.
    ///
    /// # Errors
    ///
    /// If the crane file or an override is invalid. Also for a valve-controlled crane, because most experiments need
    /// the pump.
    pub fn read(&self) -> Result<Description> {
        self.read_or(Description::uia_single_boom)
    }

    /// Reads the crane as [`read`](Self::read) does, with another default.
    ///
    /// # Errors
    ///
    /// As of [`read`](Self::read).
    pub fn read_or(
        &self,
        embedded: impl FnOnce() -> Result<Description, DescriptionError>,
    ) -> Result<Description> {
        self_contained(self.read_any_or(embedded)?)
    }

    /// Reads a crane with any circuit, the paper's by default.
    ///
    /// # Errors
    ///
    /// If the crane file or an override is invalid.
    pub fn read_any(&self) -> Result<Description> {
        self.read_any_or(Description::uia_single_boom)
    }

    /// Reads a crane with any circuit, and records it for the origin of reports.
    fn read_any_or(
        &self,
        embedded: impl FnOnce() -> Result<Description, DescriptionError>,
    ) -> Result<Description> {
        let mut description = match &self.crane {
            Some(path) => Description::parse(&path.display().to_string(), &text(path)?)?,
            None => {
                let description = embedded()?;
                let text = match description.name == UIA_NAME {
                    true => UIA_SINGLE_BOOM,
                    false => UIA_VIRTUAL,
                };
                origin::embedded(&description.name, text);
                description
            }
        };
        description.set_together_within_range(self.set.iter().map(String::as_str))?;
        for warning in description.warnings() {
            output::warn(&warning.to_string());
        }
        Ok(description)
    }
}

/// The crane, if it has the paper's circuit with a pump of its own.
///
/// # Errors
///
/// If it is valve-controlled.
pub fn self_contained(description: Description) -> Result<Description> {
    match description.choices.circuit {
        CircuitChoice::SelfContained => Ok(description),
        CircuitChoice::ValveControlled => Err(miette!(
            help = "check, show, log inspect, estimate, validate and tune take valve-controlled cranes",
            "this command is for self-contained cranes, and circuit.type of \"{}\" is valve-controlled",
            description.name
        )),
    }
}

/// Name of the paper's crane in its embedded file.
const UIA_NAME: &str = "UiA single boom";

/// Longest crane file, mapping or survey \[B\].
const LONGEST_FILE: u64 = 4_000_000;

/// Text of a crane file, which is recorded for the origin of reports.
///
/// # Errors
///
/// If the file cannot be read, is too long, or is no text.
pub fn text(path: &Path) -> Result<String> {
    text_of(path, "crane file")
}

/// Text of a file written by a user, which is recorded for the origin of reports; `what` names its kind.
///
/// # Errors
///
/// If the file cannot be read, is longer than 4 MB, or is no text.
pub fn text_of(path: &Path, what: &'static str) -> Result<String> {
    let text = hydroboom_files::text(path, what, LONGEST_FILE).into_diagnostic()?;
    origin::read(what, path, &text);
    Ok(text)
}
