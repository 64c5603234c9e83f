//! Reasons why a model and a log cannot be compared.

use hydroboom_description::BuildError;
use hydroboom_measurement::MeasurementError;
use thiserror::Error;

/// Reason why a model and a log cannot be compared, or a fit cannot be made.
#[derive(Debug, Error)]
pub enum IdentifyError {
    /// A required signal is missing in the log.
    #[error(transparent)]
    Measurement(#[from] MeasurementError),
    /// The description gives no model, or no initial state of rest.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The type of model is not supported.
    #[error(
        "the model has {found} coordinates; logs are compared with the published model, of three segments, or with a \
         valve-controlled crane of two or three links. A crane with a pump of its own becomes such a model by --set boom.segments=3 --set \
         base.stiffness_knm_per_rad=0"
    )]
    Segments {
        /// Number of its coordinates.
        found: usize,
    },
    /// Too little of the log is usable.
    #[error("{log}: {reason}")]
    Log {
        /// Name of the log.
        log: String,
        /// Reason, and what to do.
        reason: String,
    },
    /// The state leaves the model's range of validity.
    #[error(
        "{log}: the simulation breaks off after {time:.3} s: a pressure or position is not a number any more"
    )]
    Broken {
        /// Name of the log.
        log: String,
        /// Time since its beginning \[s\].
        time: f64,
    },
    /// Stopped on request.
    #[error("stopped")]
    Stopped,
    /// The saved state of a search does not fit this search.
    #[error(
        "the search that was saved moves {saved} numbers, this one {moved}: the keys or logs are others"
    )]
    Resume {
        /// Number of parameters in this search.
        moved: usize,
        /// Number of saved parameters.
        saved: usize,
    },
    /// The simulation fails at a fixed value of a key.
    #[error("with {key} held at {value:.4e} (SI units) the simulation breaks off")]
    Unsteady {
        /// The key.
        key: String,
        /// Fixed value.
        value: f64,
    },
    /// A key is not among the free ones.
    #[error("{key} is not among the keys that are moved; a profile is of one that is")]
    NotFree {
        /// The key.
        key: String,
    },
    /// Not a delay or offset of a channel.
    #[error(
        "\"{name}\" is no delay or offset of a channel: stroke.delay_ms, pressure_a.offset_bar and alike, or delay, offset, all"
    )]
    Nuisance {
        /// Requested name.
        name: String,
    },
    /// Unknown key.
    #[error("no key \"{key}\" of a crane file{suggestion}")]
    Key {
        /// Requested key.
        key: String,
        /// Suggestion of similar keys.
        suggestion: String,
    },
}
