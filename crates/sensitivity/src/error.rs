//! Errors of a sensitivity study.

use hydroboom_description::BuildError;
use thiserror::Error;

/// Reason why an output cannot be computed.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SensitivityError {
    /// The description gives no valid model, or no equilibrium to start from.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The model does not have three segments.
    #[error(
        "the model has {found} coordinates; its sensitivity is that of the published model, of three segments"
    )]
    Segments {
        /// Number of coordinates found.
        found: usize,
    },
    /// The simulation leaves the model's range of validity.
    #[error("{what}: the simulation breaks off after {time:.3} s")]
    Broken {
        /// Name of the simulation.
        what: String,
        /// Time of the failure \[s\].
        time: f64,
    },
    /// The locked crane shows no oscillation whose frequency could be measured.
    #[error("the locked crane does not ring for two whole periods")]
    Silent,
    /// No row of the global study could be simulated.
    #[error(
        "of {asked} rows of the study none could be simulated whole: parameters that far off make no crane that works"
    )]
    Nothing {
        /// Number of requested rows.
        asked: usize,
    },
}
