//! MCAP logs: those of `hydroboom run`, and others with messages in JSON or ROS 2's CDR.
//!
//! ```text
//! file -container, records-> messages -json, cdr (by definition)-> numbers with paths -table (of a topic)-> columns
//!   -> channels
//! ```

mod cdr;
mod clock;
mod columns;
mod container;
mod definition;
mod json;
mod records;
mod table;

pub use container::{Loss, Stop, messages};
pub(crate) use records::MAGIC;
pub use records::{Message, Schema, Topic};

use crate::channel::Measurement;
use crate::error::MeasurementError;
use crate::time_column::TimeColumn;
use columns::Log;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Reads an MCAP log. The time is the log time, or the message field that `time` names as the column.
///
/// # Errors
///
/// [`MeasurementError`] if the file has no usable signal, with a description of its content.
pub(crate) fn read(
    path: &Path,
    time: Option<&TimeColumn>,
) -> Result<Measurement, MeasurementError> {
    let file = path.display().to_string();
    let stopped = |stop| match stop {
        Stop::File(error) => MeasurementError::File { file: file.clone(), error },
        Stop::Format(reason) => MeasurementError::Format { file: file.clone(), reason },
    };
    let source = File::open(path).map_err(|error| stopped(Stop::File(error)))?;
    let mut log = Log::new(time);
    let loss = messages(BufReader::with_capacity(1 << 16, source), |message| {
        log.add(message);
        Ok(())
    })
    .map_err(stopped)?;
    log.finish(&file, &loss)
}
