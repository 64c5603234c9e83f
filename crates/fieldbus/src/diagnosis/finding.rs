//! Finding: a defect of the bus or a risk to it, and what to do.

use std::fmt::{self, Display, Formatter};

/// Severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The bus does not start, or must not be run like this.
    Error,
    /// The bus runs, and is likely to be disturbed.
    Warning,
}

impl Severity {
    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Error => "error",
            Self::Warning => "warning",
        }
    }
}

/// Part of the bus that a finding concerns. Their order is that of causes: a broken cable causes a missing device, a
/// wrong object causes a refused state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Cables, plugs, ports.
    Cable,
    /// Number, order and identity of the devices.
    Devices,
    /// Objects and registers that the table writes.
    StartUp,
    /// Lists of process data and their sizes.
    ProcessData,
    /// Velocity unit and mode of a drive.
    Drive,
    /// Process-data watchdog.
    Watchdog,
    /// Distributed clock, SYNC0 and SYNC1, and the device's synchronisation objects.
    Synchronisation,
    /// State of a device, and its AL status code.
    State,
    /// Network card and interrupts of this computer.
    Host,
    /// Losses, margins and jitter of frames.
    Timing,
}

impl Stage {
    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cable => "cable",
            Self::Devices => "devices",
            Self::StartUp => "start-up",
            Self::ProcessData => "process-data",
            Self::Drive => "drive",
            Self::Watchdog => "watchdog",
            Self::Synchronisation => "synchronisation",
            Self::State => "state",
            Self::Host => "host",
            Self::Timing => "timing",
        }
    }
}

/// A defect of the bus, or a risk to it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// Its severity.
    pub severity: Severity,
    /// The part of the bus that it concerns.
    pub stage: Stage,
    /// What was found.
    pub cause: String,
    /// What to do.
    pub advice: String,
}

impl Finding {
    /// A finding that prevents operation.
    pub(crate) fn error(stage: Stage, cause: String, advice: impl Into<String>) -> Self {
        Self { severity: Severity::Error, stage, cause, advice: advice.into() }
    }

    /// A finding with which the bus runs.
    pub(crate) fn warning(stage: Stage, cause: String, advice: impl Into<String>) -> Self {
        Self { severity: Severity::Warning, stage, cause, advice: advice.into() }
    }
}

impl Display for Finding {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.cause, self.advice)
    }
}
