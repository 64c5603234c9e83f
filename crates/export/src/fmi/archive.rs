//! The archive that an FMU is, and the binary in it.

use super::{Unit, Version};
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

/// A system that a binary is for, 64-bit x86.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum System {
    /// Linux, by the computer's C compiler.
    Linux,
    /// Windows, by MinGW's cross-compiler.
    Windows,
}

impl System {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Linux, Self::Windows];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Linux => "Linux",
            Self::Windows => "Windows",
        }
    }

    /// Compiler, and what it is told beyond what all are told.
    fn compiler(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::Linux => ("cc", &["-fPIC", "-fvisibility=hidden"]),
            // its library's fma rounds twice; nothing beyond the system's own libraries is needed where it runs
            Self::Windows => ("x86_64-w64-mingw32-gcc", &["-DHB_SOFT_FMA", "-static-libgcc"]),
        }
    }

    /// Where in an archive its binary is.
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

/// What all binaries are made with: no instruction that an older processor lacks, for the same binary is to run elsewhere.
const OPTIONS: [&str; 3] = ["-std=c99", "-O2", "-ffp-contract=off"];

/// A compiler's run in a folder; false where there is no such compiler.
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

/// The shared library of an FMU for a system, made by its C compiler in a folder for intermediate files; none where there is
/// no such compiler. For Linux it has the block's functions twice and takes those with fused multiply-add instructions where the
/// processor has them; both compute the same bits.
///
/// # Errors
///
/// [`ArchiveError`] when the folder cannot be used, or the compiler refuses the source.
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

/// Makes the library for Linux with the block's functions twice, without fused multiply-add instructions and with them, of which
/// each call takes what the processor has; false where the compiler cannot do that (it is for another kind of processor,
/// say). What is packed as source stays C99: the second names are put before it on the command line.
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

/// The FMU: its files, and the binaries that there are. The same files give the same bytes.
///
/// # Errors
///
/// [`ArchiveError::Zip`] when it cannot be put together.
pub fn archive(unit: &Unit, binaries: &[(System, Vec<u8>)]) -> Result<Vec<u8>, ArchiveError> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    // stored: what is in it is small, and can be looked at by anything
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
