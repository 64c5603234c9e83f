//! Logs of real machines: reading, assignment of columns to signals, and conversion to SI units.
//!
//! ```text
//! file -csv, MAT, MCAP, MDF-> Measurement (channels as logged) -Mapping-> Signals (the model's, in SI units)
//! ```
//!
//! Each channel keeps its own time base until two signals are compared. Uneven, missing or delayed samples are reported
//! there; resampling would hide them.

mod channel;
mod contradiction;
mod csv_file;
mod decompress;
mod dimension;
mod error;
mod guess;
mod heading;
mod magnitude;
mod mapping;
mod mapping_text;
mod mat;
pub mod mcap;
mod mdf;
mod outlier;
#[cfg(feature = "parquet")]
mod parquet_file;
mod path;
mod read;
mod recording;
mod sampled;
mod signal;
mod signals;
mod spark;
mod suspicion;
mod thinning;
mod time_base;
mod time_column;
mod time_scale;
mod time_unit;
mod unit;
mod unit_table;

pub use channel::{Channel, Measurement, Range, Segment};
pub use dimension::Dimension;
pub use error::MeasurementError;
pub use heading::Heading;
pub use magnitude::Expected;
pub use mapping::{Entry, Mapping};
pub use read::{digest, digest_of, read};
pub use signal::Signal;
pub use signals::{Signals, Track};
pub use spark::sparkline;
pub use suspicion::Suspicion;
pub use time_base::{Gap, TimeBase};
pub use time_column::TimeColumn;
pub use unit::{Unit, UnitError};
