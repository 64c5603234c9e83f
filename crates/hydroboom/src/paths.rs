//! Files and folders that commands are given: what is read, and what is written.
//!
//! An option has the type of its role, and so every command's paths are looked at before it begins: no
//! output is an input, and no two outputs are one file.

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
    /// A file that is read, and never written.
    InputFile,
    /// A file that is written; one that a command keeps for its next run is read first, too.
    OutputFile,
    /// A folder that files are written into.
    OutputFolder
);

/// Looks at the paths of a command before it begins. An output that cannot be written is told at once
/// and counts at the end: what else the command makes is not lost for it.
///
/// # Errors
///
/// When an output is an input, two outputs are one file, or a folder to write into is a file.
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
                help = "name a folder: it is made where it is not there",
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
            Err(error) => output::warn(&format!("{error}; all else goes on")),
            Ok(()) => {}
        }
        // what holds no content, such as a pipe, may be written twice
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

/// All values of a type that a command and its subcommands were given, defaults too.
fn all<T: Any + Clone + Send + Sync>(arguments: &ArgMatches) -> Vec<T> {
    let mut found = Vec::new();
    let mut at = Some(arguments);
    while let Some(level) = at {
        for id in level.ids() {
            // an option of another type
            let Ok(Some(values)) = level.try_get_many::<T>(id.as_str()) else { continue };
            found.extend(values.cloned());
        }
        at = level.subcommand().map(|(_, below)| below);
    }
    found
}
