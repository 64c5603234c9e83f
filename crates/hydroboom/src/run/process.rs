//! The machine's process, and the memory shared with it.

use miette::{IntoDiagnostic, Result, WrapErr};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// A place for the shared memory that goes away with us.
pub struct Memory {
    /// Its path.
    pub path: PathBuf,
}

impl Memory {
    /// A path that nobody uses.
    pub fn new() -> Result<Self> {
        let folder = Path::new("/dev/shm");
        let folder = if folder.is_dir() { folder.into() } else { std::env::temp_dir() };
        let path = folder.join(format!("hydroboom-{}", std::process::id()));
        // of a process that had our number and was killed
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

/// The machine's process.
pub struct Host(Child);

impl Host {
    /// Starts it, to play the crane that these options of `hydroboom machine` give.
    pub fn start(shared: &Path, crane: &[OsString]) -> Result<Self> {
        let program = std::env::current_exe().into_diagnostic()?;
        let mut command = Command::new(program);
        command.arg("machine").arg("--shared").arg(shared).args(crane).stdin(Stdio::null());
        // Ctrl-C is for us: the machine goes on, or nothing would be there to be stopped
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        Ok(Self(command.spawn().into_diagnostic().wrap_err("the machine's process")?))
    }

    /// Ends it.
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
