//! Paths given to commands: inputs and outputs.
//!
//! The type of an option states the role of its path, so that all paths of a command are checked before it
//! starts. No output may be an input, and no two outputs the same file.

use crate::machine_argument::MachineArgument;
use crate::output;
use clap::ArgMatches;
use hydroboom_files::{FileError, Identity, protect, try_place};
use miette::{Result, miette};
use serde::Serialize;
use std::any::Any;
use std::ffi::OsString;
use std::ops::Deref;
use std::path::{Path, PathBuf};

macro_rules! path_of_a_role {
    ($($(#[$doc:meta])* $name:ident),*) => { $(
        $(#[$doc])*
        #[derive(Clone, Debug, Serialize)]
        #[serde(transparent)]
        pub struct $name(PathBuf);

        impl From<OsString> for $name {
            fn from(path: OsString) -> Self {
                Self(path.into())
            }
        }

        impl Deref for $name {
            type Target = Path;

            fn deref(&self) -> &Path {
                &self.0
            }
        }
    )* };
}

path_of_a_role!(
    /// File that is read and never written.
    InputFile,
    /// File that is written. A file kept for the next run is also read first.
    OutputFile,
    /// Folder into which files are written.
    OutputFolder
);

/// Checks the paths of a command before it starts. An output that cannot be written is reported at once and
/// counts at the end, so that the other outputs are still made.
///
/// # Errors
///
/// If an output is an input, two outputs are the same file, or an output folder is a file.
pub fn check(arguments: &ArgMatches) -> Result<()> {
    for input in all::<InputFile>(arguments) {
        protect(&input);
    }
    for machine in all::<MachineArgument>(arguments) {
        if let Some(file) = machine.file() {
            protect(file);
        }
    }
    for folder in all::<OutputFolder>(arguments) {
        if folder.exists() && !folder.is_dir() {
            return Err(miette!(
                help = "name a folder; it is created if it does not exist",
                "{} is a file, and files are to be written into it",
                folder.display()
            ));
        }
    }
    let mut before: Vec<(Identity, OutputFile)> = Vec::new();
    for output in all::<OutputFile>(arguments) {
        match try_place(&output) {
            Err(error @ FileError::IsInput { .. }) => {
                return Err(miette!(help = "name another file to write", "{error}"));
            }
            Err(error) => {
                output::warn(&format!("{error}; the command continues without this output"))
            }
            Ok(()) => {}
        }
        // a path without stored content, such as a pipe, may be written twice
        let Some(identity) = Identity::of(&output) else { continue };
        if let Some((_, other)) = before.iter().find(|(known, _)| known.is_same(&identity)) {
            return Err(miette!(
                help = "name two files",
                "{} and {} are the same file, and both would be written",
                other.display(),
                output.display()
            ));
        }
        before.push((identity, output));
    }
    Ok(())
}

/// All values of a type that are given to a command and its subcommands, defaults included.
fn all<T: Any + Clone + Send + Sync>(arguments: &ArgMatches) -> Vec<T> {
    let mut all = Vec::new();
    let mut at = Some(arguments);
    while let Some(level) = at {
        for id in level.ids() {
            // an option of another type
            let Ok(Some(values)) = level.try_get_many::<T>(id.as_str()) else { continue };
            all.extend(values.cloned());
        }
        at = level.subcommand().map(|(_, below)| below);
    }
    all
}
