//! Why an output cannot be computed.

use hydroboom_description::BuildError;
use thiserror::Error;

/// Why an output cannot be computed.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SensitivityError {
    /// The description gives no such model, or no state of rest to start from.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The model is none of three segments.
    #[error(
        "the model has {found} coordinates; its sensitivity is that of the published model, of three segments"
    )]
    Segments {
        /// Coordinates that it has.
        found: usize,
    },
    /// The simulation leaves what the model holds for.
    #[error("{what}: the simulation breaks off after {time:.3} s")]
    Broken {
        /// What was simulated.
        what: String,
        /// When \[s\].
        time: f64,
    },
    /// Nothing rings.
    #[error("the locked crane does not ring for two whole periods")]
    Silent,
    /// No row of the global study could be simulated.
    #[error(
        "of {asked} rows of the study none could be simulated whole: parameters that far off make no crane that works"
    )]
    Nothing {
        /// Rows asked for.
        asked: usize,
    },
}
