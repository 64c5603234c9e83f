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
    /// The model is none that logs are compared with.
    #[error(
        "the model has {found} coordinates; logs are compared with the published model, of three segments, or with a \
         valve-controlled crane of two or three links. A crane with a pump of its own becomes such a model by --set boom.segments=3 --set \
         base.stiffness_knm_per_rad=0"
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
    /// Told to stop.
    #[error("stopped")]
    Stopped,
    /// Where a search is to begin again does not fit it.
    #[error(
        "the search that was saved moves {saved} numbers, this one {moved}: the keys or logs are others"
    )]
    Resume {
        /// Numbers that this search moves.
        moved: usize,
        /// Numbers that were saved.
        saved: usize,
    },
    /// The model breaks off where a key is held.
    #[error("with {key} held at {value:.4e} (SI units) the simulation breaks off")]
    Unsteady {
        /// The key.
        key: String,
        /// Where it was held.
        value: f64,
    },
    /// A key that is not among those that are moved.
    #[error("{key} is not among the keys that are moved; a profile is of one that is")]
    NotFree {
        /// The key.
        key: String,
    },
    /// A delay or offset of a channel that is none.
    #[error(
        "\"{name}\" is no delay or offset of a channel: stroke.delay_ms, pressure_a.offset_bar and alike, or delay, offset, all"
    )]
    Nuisance {
        /// What was asked for.
        name: String,
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
