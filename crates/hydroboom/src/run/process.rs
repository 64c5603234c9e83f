//! Process of the machine, and the memory shared with it.

use miette::{IntoDiagnostic, Result, WrapErr};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// Path of the shared memory, removed with the value.
pub struct Memory {
    /// Its path.
    pub path: PathBuf,
}

impl Memory {
    /// New, unused path.
    pub fn new() -> Result<Self> {
        let folder = Path::new("/dev/shm");
        let folder = if folder.is_dir() { folder.into() } else { std::env::temp_dir() };
        let path = folder.join(format!("hydroboom-{}", std::process::id()));
        // left by a killed process with the same number
        if path.exists() {
            std::fs::remove_file(&path).into_diagnostic()?;
        }
        Ok(Self { path })
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

/// Process of the machine.
pub struct Host(Child);

impl Host {
    /// Starts the process with options of `hydroboom machine` for the crane.
    pub fn start(shared: &Path, crane: &[OsString]) -> Result<Self> {
        let program = std::env::current_exe().into_diagnostic()?;
        let mut command = Command::new(program);
        command.arg("machine").arg("--shared").arg(shared).args(crane).stdin(Stdio::null());
        // Ctrl-C must not end the machine before the controller has stopped it
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        Ok(Self(command.spawn().into_diagnostic().wrap_err("the machine's process")?))
    }

    /// Ends the process.
    pub fn end(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        self.end();
    }
}
