//! Validation and identification of a model: a log is compared with the model driven by the same inputs.
//!
//! ```text
//! Signals -> Experiment (inputs, samples) -> prediction -> differences, ringing, whiteness
//!                                       \-> sensitivities (dual numbers) -> what would move it, fit
//! ```

mod advice;
mod differences;
mod drive;
mod error;
mod experiment;
mod explained;
mod fault_isolation;
mod fit;
mod free;
mod hold_out;
mod limits;
mod motor;
mod noise;
mod number;
mod oscillation;
mod oscillation_features;
mod prediction;
mod prior;
mod remedy;
mod ringing;
mod structural_limit;
mod verdict;
mod whiteness;

pub use advice::experiment_for;
pub use differences::{Difference, Differences, Unresolved, differences};
pub use error::IdentifyError;
pub use experiment::{COMPARED, Experiment, Sample, Window};
pub use explained::{Explained, Part, explained};
pub use fault_isolation::{Fault, Isolated, SignalFault, isolate};
pub use fit::{
    Allowed, Channel, Determination, Effect, Fit, Improvement, LIMIT, Nuisance, Profile, Progress,
    Task, Tuned, fit, profile,
};
pub use free::Free;
pub use hold_out::{HeldOut, PredictionError, Stretch, held_out};
pub use limits::{LIMITS, Limits};
pub use number::{Number, Stepper};
pub use prediction::{Prediction, predict, sensitivities};
pub use prior::prior;
pub use remedy::{Moved, Remedies, Remedy, remedies};
pub use ringing::{Ringing, ringing};
pub use verdict::{Aspect, Judgement, complaints, verdict};
