//! What can go wrong in an experiment.

use hydroboom_description::{BuildError, DescriptionError};
use hydroboom_design::DesignError;
use hydroboom_model::SimulationError;
use hydroboom_plant::PlantError;
use thiserror::Error;

/// Why an experiment has no result.
#[derive(Debug, Error)]
pub enum LabError {
    /// The crane file gives no model.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// A crane file or an override is wrong.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// The simulation stopped.
    #[error("{during}: {error}")]
    Simulation {
        /// What was being simulated.
        during: String,
        /// Why it stopped.
        error: SimulationError,
    },
    /// A recorded input cannot be used.
    #[error("{file}: {reason}")]
    Input {
        /// Name of the file.
        file: String,
        /// What is wrong, where, and what is expected.
        reason: String,
    },
    /// There is no such crane.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// A step that does not fit the run.
    #[error("a step of {step_us} us does not fit into a run of {duration_s} s")]
    Step {
        /// What was asked for.
        step_us: f64,
        /// Duration of the run.
        duration_s: f64,
    },
    /// A survey of the tip, or a fit to it, that cannot be.
    #[error(transparent)]
    Survey(#[from] hydroboom_design::tip_survey::SurveyError),
    /// No such scenario.
    #[error("no scenario \"{name}\"; there are {names}")]
    Scenario {
        /// What was asked for.
        name: String,
        /// Those there are.
        names: String,
    },
    /// Told to stop.
    #[error("stopped")]
    Stopped,
    /// A machine would exceed its margins.
    #[error("not applied, for it would exceed the crane's margins: {0}")]
    Margins(String),
    /// Too little oscillation to measure.
    #[error("{0}")]
    NoOscillation(String),
    /// An equation that a compared controller is designed by has no solution.
    #[error("{0}")]
    NoBaseline(&'static str),
    /// A controller cannot be designed, or the crane not be linearised.
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
        /// What the system says.
        error: std::io::Error,
    },
    /// A file cannot be read within its bounds, or written.
    #[error(transparent)]
    Files(#[from] hydroboom_files::FileError),
    /// A figure cannot be drawn.
    #[error("figure: {0}")]
    Figure(String),
}

impl LabError {
    /// Adds what was being simulated to a simulation's error.
    pub(crate) fn during(what: &str) -> impl FnOnce(SimulationError) -> Self {
        move |error| Self::Simulation { during: what.into(), error }
    }
}
