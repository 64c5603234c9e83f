//! Virtual crane in a process of its own, in real time, and the memory shared with it.

use super::control_setup::ControlSetup;
use crate::machine_choice::MachineChoice;
use hydroboom_realtime::executive::{self, Placement, RealTime, Tasks};
use hydroboom_realtime::session::Lookout;
use hydroboom_realtime::shared::Shared;
use miette::{IntoDiagnostic, Result, WrapErr};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// Runs a session in real time with the virtual crane in a process of its own, until its end condition holds.
///
/// # Errors
///
/// If the shared memory cannot be made, the process cannot be started, or the tasks cannot run.
pub fn run_in_real_time(
    cranes: &MachineChoice,
    setup: &ControlSetup,
    lookout: Lookout<'_>,
) -> Result<RealTime> {
    let memory = SharedMemoryFile::new()?;
    let open = |result: std::io::Result<Shared>| {
        result.into_diagnostic().wrap_err_with(|| memory.path.display().to_string())
    };
    let shared = open(Shared::create(&memory.path))?;
    let tampering = open(Shared::open(&memory.path))?;
    let mut process = MachineProcess::start(&memory.path, cranes.arguments())?;
    let (control, simulation) = setup.tasks(cranes)?;
    let n = &cranes.model.numbers;
    let tasks = Tasks {
        control,
        simulation,
        machine: Box::new(shared),
        periods: (n.simulation_period, n.control_period),
        placement: Placement::default(),
    };
    let mut number = 0;
    let real_time = executive::run(tasks, lookout, &mut |what| {
        number += 1;
        tampering.tamper(number, what);
    })
    .into_diagnostic()?;
    process.end();
    Ok(real_time)
}

/// File of the memory shared with the machine's process; it is removed with this value.
struct SharedMemoryFile {
    path: PathBuf,
}

impl SharedMemoryFile {
    /// An unused path named by this process, in memory where the system has such a folder.
    ///
    /// # Errors
    ///
    /// If a file that an earlier process left there cannot be removed.
    fn new() -> Result<Self> {
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

impl Drop for SharedMemoryFile {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

/// Process of the machine; it is ended with this value.
struct MachineProcess(Child);

impl MachineProcess {
    /// Starts `hydroboom machine` at a shared memory, with the options of a crane.
    ///
    /// # Errors
    ///
    /// If the process cannot be started.
    fn start(shared: &Path, crane: &[OsString]) -> Result<Self> {
        let program = std::env::current_exe().into_diagnostic()?;
        let mut command = Command::new(program);
        command.arg("machine").arg("--shared").arg(shared).args(crane).stdin(Stdio::null());
        // Ctrl-C must not end the machine before the controller has stopped it
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        Ok(Self(command.spawn().into_diagnostic().wrap_err("the machine's process")?))
    }

    /// Ends the process and waits for its end.
    fn end(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Drop for MachineProcess {
    fn drop(&mut self) {
        self.end();
    }
}
