//! Is the model right, and how is it made so: a log beside the model driven by the same inputs.
//!
//! ```text
//! Signals -> Experiment (inputs, samples) -> prediction -> differences, ringing, whiteness
//!                                       \-> sensitivities (dual numbers) -> what would move it, fit
//! ```

mod differences;
mod error;
mod experiment;
mod fit;
mod free;
mod prediction;
mod remedy;
mod ringing;

pub use differences::{Difference, Differences, differences};
pub use error::IdentifyError;
pub use experiment::{COMPARED, Experiment, Sample, Window};
pub use fit::{Fit, Improvement, Tuned, fit, prior};
pub use free::Free;
pub use prediction::{Prediction, predict, sensitivities};
pub use remedy::{Remedies, Remedy, remedies};
pub use ringing::{Ringing, ringing};
