//! Logs of real machines: read, understood, and put on a common time base.
//!
//! ```text
//! file -csv, MAT, MCAP-> Measurement (channels as logged) -Mapping-> Signals (the model's, in SI units)
//! ```
//!
//! A channel keeps its own time base as long as it can: what is uneven, missing or late is seen there
//! and told, not hidden by a resampling.

mod channel;
mod csv_file;
mod error;
mod mapping;
mod mat;
mod mcap_file;
mod read;
mod sampled;
mod signal;
mod signals;
mod spark;
mod thinning;
mod time_base;
mod unit;

pub use channel::{Channel, Measurement, Range};
pub use error::MeasurementError;
pub use mapping::{Entry, Mapping, Suspicion};
pub use read::{digest, digest_of, read};
pub use signal::Signal;
pub use signals::{Signals, Track};
pub use spark::sparkline;
pub use time_base::{Gap, TimeBase};
pub use unit::{Dimension, Unit};
