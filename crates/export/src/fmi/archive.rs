//! FMU archive (zip), and the compiled shared libraries in it.

use super::{Unit, Version};
use std::io::{Cursor, Write};
use std::path::Path;
use std::process::Command;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Reason why an FMU archive cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum ArchiveError {
    /// A file operation failed.
    #[error("{what}: {error}")]
    System {
        /// The attempted operation.
        what: String,
        /// Error of the operating system.
        error: std::io::Error,
    },
    /// The compiler reports an error.
    #[error("the C compiler refuses what was generated: {said}")]
    Compiler {
        /// Output of the compiler.
        said: String,
    },
    /// The archive cannot be written.
    #[error(transparent)]
    Zip(#[from] zip::result::ZipError),
}

/// Platform of a compiled FMU: an operating system on 64-bit x86.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum System {
    /// Linux, compiled by the computer's C compiler.
    Linux,
    /// Windows, compiled by MinGW's cross-compiler.
    Windows,
}

impl System {
    /// All platforms.
    pub const ALL: [Self; 2] = [Self::Linux, Self::Windows];

    /// Name of the platform in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Linux => "Linux",
            Self::Windows => "Windows",
        }
    }

    /// Compiler and its additional options.
    fn compiler(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::Linux => ("cc", &["-fPIC", "-fvisibility=hidden"]),
            // its library's fma rounds twice; the binary needs only the system's own libraries
            Self::Windows => ("x86_64-w64-mingw32-gcc", &["-DHB_SOFT_FMA", "-static-libgcc"]),
        }
    }

    /// Path of the binary in the archive.
    fn place(self, unit: &Unit) -> String {
        let folder = match (self, unit.version) {
            (Self::Linux, Version::Two) => "linux64",
            (Self::Linux, Version::Three) => "x86_64-linux",
            (Self::Windows, Version::Two) => "win64",
            (Self::Windows, Version::Three) => "x86_64-windows",
        };
        let extension = if self == Self::Linux { "so" } else { "dll" };
        format!("binaries/{folder}/{}.{extension}", unit.identifier)
    }
}

/// Compiler options of all binaries: no instructions beyond the base architecture, so that older processors can run
/// them.
const OPTIONS: [&str; 3] = ["-std=c99", "-O2", "-ffp-contract=off"];

/// Runs a compiler in a folder; returns false if the compiler is not installed.
fn compiled(
    compiler: &str,
    folder: &Path,
    options: &[&[&str]],
) -> Result<Result<bool, String>, ArchiveError> {
    let run = Command::new(compiler).current_dir(folder).args(options.concat()).output();
    match run {
        Ok(output) if output.status.success() => Ok(Ok(true)),
        Ok(output) => Ok(Err(String::from_utf8_lossy(&output.stderr).into_owned())),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(Ok(false)),
        Err(error) => Err(ArchiveError::System { what: compiler.into(), error }),
    }
}

fn failed(what: &Path, error: std::io::Error) -> ArchiveError {
    ArchiveError::System { what: what.display().to_string(), error }
}

/// Name of the shared library in the folder for intermediate files.
const LIBRARY: &str = "fmu.so";

/// Compiles the shared library of an FMU for a system, in a folder for intermediate files; `None` if the compiler is
/// not installed. The Linux library contains the block's functions with and without fused multiply-add instructions
/// and selects by the processor; both compute the same bits.
///
/// # Errors
///
/// [`ArchiveError::System`] if the folder cannot be used or the compiler cannot be started.
/// [`ArchiveError::Compiler`] if it reports an error.
pub fn binary(unit: &Unit, system: System, folder: &Path) -> Result<Option<Vec<u8>>, ArchiveError> {
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
    let library = folder.join(LIBRARY);
    if system == System::Linux && dispatched(unit, folder)? {
        return std::fs::read(&library).map(Some).map_err(|e| failed(&library, e));
    }
    let (compiler, own) = system.compiler();
    let end = ["-lm", "-o", LIBRARY];
    match compiled(compiler, folder, &[&OPTIONS, own, &["-shared"], &sources, &end])? {
        Ok(true) => std::fs::read(&library).map(Some).map_err(|e| failed(&library, e)),
        Ok(false) => Ok(None),
        Err(said) => Err(ArchiveError::Compiler { said }),
    }
}

/// Compiles the Linux library with the block's functions twice, with and without fused multiply-add instructions,
/// selected by the processor at each call. Returns false if the compiler does not support that, for example for
/// another architecture. The packed source stays C99: the second names are defined on the command line.
fn dispatched(unit: &Unit, folder: &Path) -> Result<bool, ArchiveError> {
    let (compiler, own) = System::Linux.compiler();
    let mut renamed = String::new();
    let mut choices = String::from("#include \"hydroboom.h\"\n");
    for name in &unit.functions {
        renamed += &format!("#define {name} {name}_fma\n");
        choices += &format!(
            "extern __typeof__({name}) {name}_fma;\n#define {name} (__builtin_cpu_supports(\"fma\") ? {name}_fma : {name})\n"
        );
    }
    for (name, text) in [("renamed.h", renamed), ("choices.h", choices)] {
        let file = folder.join(name);
        std::fs::write(&file, text).map_err(|e| failed(&file, e))?;
    }
    let runs: [&[&str]; 4] = [
        &["-c", "hydroboom.c", "-o", "plain.o"],
        &["-mfma", "-include", "renamed.h", "-c", "hydroboom.c", "-o", "fused.o"],
        &["-include", "choices.h", "-c", "fmu.c", "-o", "functions.o"],
        &["-shared", "plain.o", "fused.o", "functions.o", "-lm", "-o", LIBRARY],
    ];
    for run in runs {
        if compiled(compiler, folder, &[&OPTIONS, own, run])? != Ok(true) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// The FMU's archive: its files and the available binaries. Equal inputs give equal bytes.
///
/// # Errors
///
/// [`ArchiveError::Zip`] if it cannot be written.
pub fn archive(unit: &Unit, binaries: &[(System, Vec<u8>)]) -> Result<Vec<u8>, ArchiveError> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    // stored without compression: the content is small, and readable by any tool
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    let system = |error| ArchiveError::System { what: "the archive".into(), error };
    let files = unit.files.iter().map(|(path, content)| (path.as_str(), content.as_bytes()));
    let places: Vec<String> = binaries.iter().map(|(system, _)| system.place(unit)).collect();
    let binaries =
        places.iter().zip(binaries).map(|(place, (_, b))| (place.as_str(), b.as_slice()));
    for (path, content) in files.chain(binaries) {
        writer.start_file(path, options)?;
        writer.write_all(content).map_err(system)?;
    }
    Ok(writer.finish()?.into_inner())
}
