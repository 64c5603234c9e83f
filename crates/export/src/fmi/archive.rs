//! The archive that an FMU is, and the binary in it.

use super::Unit;
use std::io::{Cursor, Write};
use std::path::Path;
use std::process::Command;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Why there is no archive.
#[derive(Debug, thiserror::Error)]
pub enum ArchiveError {
    /// The system does not let it be made.
    #[error("{what}: {error}")]
    System {
        /// What was to be done.
        what: String,
        /// What the system says.
        error: std::io::Error,
    },
    /// The compiler refuses the source.
    #[error("the C compiler refuses what was generated: {said}")]
    Compiler {
        /// What it says.
        said: String,
    },
    /// The archive cannot be written.
    #[error(transparent)]
    Zip(#[from] zip::result::ZipError),
}

/// The shared library of an FMU for this machine, made by its C compiler `cc` in a folder for intermediate files; none where there is
/// no compiler.
///
/// # Errors
///
/// [`ArchiveError`] when the folder cannot be used, or the compiler refuses the source.
pub fn binary(unit: &Unit, folder: &Path) -> Result<Option<Vec<u8>>, ArchiveError> {
    let failed =
        |what: &Path, error| ArchiveError::System { what: what.display().to_string(), error };
    std::fs::create_dir_all(folder).map_err(|e| failed(folder, e))?;
    let mut sources = Vec::new();
    for (path, content) in unit.files.iter().filter(|(path, _)| path.starts_with("sources/")) {
        let name = path.trim_start_matches("sources/");
        let file = folder.join(name);
        std::fs::write(&file, content).map_err(|e| failed(&file, e))?;
        if name.ends_with(".c") {
            sources.push(name);
        }
    }
    // no instruction that an older processor lacks: the same binary is to run elsewhere
    let compiled = Command::new("cc")
        .current_dir(folder)
        .args(["-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden"])
        .args(&sources)
        .args(["-lm", "-o", "fmu.so"])
        .output();
    let output = match compiled {
        Ok(output) => output,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(failed(Path::new("cc"), error)),
    };
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        return Err(ArchiveError::Compiler { said });
    }
    let library = folder.join("fmu.so");
    std::fs::read(&library).map(Some).map_err(|e| failed(&library, e))
}

/// The FMU: its files, and the binary where there is one. The same files give the same bytes.
///
/// # Errors
///
/// [`ArchiveError::Zip`] when it cannot be put together.
pub fn archive(unit: &Unit, binary: Option<&[u8]>) -> Result<Vec<u8>, ArchiveError> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    // stored: what is in it is small, and can be looked at by anything
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    let system = |error| ArchiveError::System { what: "the archive".into(), error };
    let files = unit.files.iter().map(|(path, content)| (path.as_str(), content.as_bytes()));
    for (path, content) in files.chain(binary.map(|bytes| (unit.library.as_str(), bytes))) {
        writer.start_file(path, options)?;
        writer.write_all(content).map_err(system)?;
    }
    Ok(writer.finish()?.into_inner())
}
