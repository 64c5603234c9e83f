//! Why a model and a log cannot be compared.

use hydroboom_description::BuildError;
use hydroboom_measurement::MeasurementError;
use thiserror::Error;

/// Why a model and a log cannot be compared.
#[derive(Debug, Error)]
pub enum IdentifyError {
    /// The log has not what is needed.
    #[error(transparent)]
    Measurement(#[from] MeasurementError),
    /// The description gives no model, or no state of rest to start from.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The model is none of three segments.
    #[error(
        "the model has {found} coordinates; logs are compared with the published model, of three segments"
    )]
    Segments {
        /// Coordinates that it has.
        found: usize,
    },
    /// Too little of the log can be used.
    #[error("{log}: {reason}")]
    Log {
        /// Its name.
        log: String,
        /// What is wrong, and what to do.
        reason: String,
    },
    /// The simulation leaves what the model holds for.
    #[error(
        "{log}: the simulation breaks off after {time:.3} s: a pressure or position is not a number any more"
    )]
    Broken {
        /// The log.
        log: String,
        /// Time since its beginning \[s\].
        time: f64,
    },
    /// A key that is none.
    #[error("no key \"{key}\" of a crane file{suggestion}")]
    Key {
        /// What was asked for.
        key: String,
        /// What may be meant.
        suggestion: String,
    },
}
