//! Errors of experiments.

use hydroboom_description::{BuildError, DescriptionError};
use hydroboom_design::DesignError;
use hydroboom_model::SimulationError;
use hydroboom_plant::PlantError;
use thiserror::Error;

/// Reason why an experiment in simulation has no result.
#[derive(Debug, Error)]
pub enum LabError {
    /// No model can be built from the crane file.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// A crane file or an override is invalid.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// The simulation stopped, because a state left the model's range of validity.
    #[error("{during}: {error}")]
    Simulation {
        /// Name of the simulated experiment, as controller and course.
        during: String,
        /// Reason of the stop.
        error: SimulationError,
    },
    /// A recorded input cannot be used.
    #[error("{file}: {reason}")]
    Input {
        /// Name of the file.
        file: String,
        /// Defect, its place, and the expected content.
        reason: String,
    },
    /// The crane cannot be built.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The integration step is longer than the run.
    #[error("a step of {step_us} us does not fit into a run of {duration_s} s")]
    Step {
        /// Requested step \[us\].
        step_us: f64,
        /// Duration of the run \[s\].
        duration_s: f64,
    },
    /// A survey of the tip, or a fit to it, is invalid.
    #[error(transparent)]
    Survey(#[from] hydroboom_design::tip_survey::SurveyError),
    /// Unknown scenario.
    #[error("no scenario \"{name}\"; there are {names}")]
    Scenario {
        /// Requested name.
        name: String,
        /// Available names.
        names: String,
    },
    /// Stopped on request.
    #[error("stopped")]
    Stopped,
    /// A machine would exceed its margins of pressure, end-stop distance, tracking error or motor speed under the
    /// commands. States each margin with the largest value and its time.
    #[error("not applied, for it would exceed the crane's margins: {0}")]
    Margins(String),
    /// The oscillation is too small or too short to measure.
    #[error("{0}")]
    NoOscillation(String),
    /// A design equation of a baseline has no solution.
    #[error("{0}")]
    NoBaseline(&'static str),
    /// A performance bound cannot be computed.
    #[error("{0}")]
    NoBound(String),
    /// A controller cannot be designed, or the crane cannot be linearised.
    #[error(transparent)]
    Design(#[from] DesignError),
    /// A model cannot be identified.
    #[error(transparent)]
    Identify(#[from] hydroboom_identify::IdentifyError),
    /// A file cannot be written or read.
    #[error("{path}: {error}")]
    File {
        /// Its path.
        path: String,
        /// Error of the operating system.
        error: std::io::Error,
    },
    /// A file exceeds its bounds, or cannot be read or written.
    #[error(transparent)]
    Files(#[from] hydroboom_files::FileError),
    /// A figure cannot be drawn.
    #[error("figure: {0}")]
    Figure(String),
}

impl LabError {
    /// Adds the simulated object to a simulation's error.
    pub(crate) fn during(what: &str) -> impl FnOnce(SimulationError) -> Self {
        move |error| Self::Simulation { during: what.into(), error }
    }
}
