//! Reading of a log in any supported format.

use crate::channel::Measurement;
use crate::error::MeasurementError;
use crate::time_column::TimeColumn;
use crate::{csv_file, mat, mcap, mdf};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// First bytes of a Parquet file.
const PARQUET: &[u8] = b"PAR1";

/// First bytes of MAT files of level 5 to 7, and of HDF5 files.
const MAT: [&[u8]; 2] = [b"MATLAB 5.0 MAT-file", b"\x89HDF\r\n\x1a\n"];
/// First bytes of other files that are often taken for logs, and their names.
const OTHERS: [(&[u8], &str); 4] = [
    (b"\x1f\x8b", "packed by gzip: unpack it"),
    (b"PK\x03\x04", "a spreadsheet or a ZIP archive: save the table as CSV"),
    (b"\xd0\xcf\x11\xe0", "an old spreadsheet: save the table as CSV"),
    (b"%PDF", "a PDF document"),
];

/// Reads a log: MCAP, MDF and Parquet by their first bytes, MAT by the file's name, anything else as delimited text.
/// `time` states the source of the rows' time, if the names of the columns do not show it.
///
/// # Errors
///
/// - [`MeasurementError::File`] if the file cannot be read, [`MeasurementError::NoFile`] if it is a folder or a pipe.
/// - [`MeasurementError::Format`] if its format is unknown or it is damaged.
/// - [`MeasurementError::Empty`] if it has too few rows, [`MeasurementError::Cell`] if a cell is not a number.
/// - [`MeasurementError::Mapping`] if `time` names no usable column, or does not apply to the format.
pub fn read(path: &Path, time: Option<&TimeColumn>) -> Result<Measurement, MeasurementError> {
    let failed = |error| MeasurementError::File { file: path.display().to_string(), error };
    // the format is detected first, and a pipe cannot be rewound
    if !std::fs::metadata(path).map_err(failed)?.is_file() {
        return Err(MeasurementError::NoFile { file: path.display().to_string() });
    }
    let mut begins = Vec::new();
    File::open(path).and_then(|f| f.take(19).read_to_end(&mut begins)).map_err(failed)?;
    if let Some((_, what)) = OTHERS.iter().find(|(b, _)| begins.starts_with(b)) {
        let reason = format!("it is {what}; CSV, MAT, MDF 4, MCAP and Parquet files are read");
        return Err(MeasurementError::Format { file: path.display().to_string(), reason });
    }
    let counted = |format: &str| match time.and_then(|t| t.sample_time) {
        None => Ok(()),
        Some(_) => Err(MeasurementError::Mapping {
            file: path.display().to_string(),
            reason: format!(
                "the sample time (--sample-time-ms, or sample_time_ms in a mapping) counts rows of text files; in {format} name the time: [log] time = \"...\" in a mapping"
            ),
        }),
    };
    // the times of these formats have a unit: another one needs a named column
    let nameless = |times: &str, stated: fn(&TimeColumn) -> bool| match time {
        Some(t) if t.column.is_none() && stated(t) => Err(MeasurementError::Mapping {
            file: path.display().to_string(),
            reason: format!("[log.time] has no column, and {times}: name the column that is meant"),
        }),
        _ => Ok(()),
    };
    let is_mat = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("mat"))
        || MAT.iter().any(|b| begins.starts_with(b));
    match begins.as_slice() {
        // the rest of the signature may be damaged, which the reader reports
        begins if begins.starts_with(&mcap::MAGIC[..5]) => counted("an MCAP file")
            .and_then(|()| {
                nameless(
                    "its unit, scale or offset is not for MCAP's times, which are nanoseconds",
                    |t| t.unit.is_some() || t.scale != 1.0 || t.offset != 0.0,
                )
            })
            .and_then(|()| mcap::read(path, time)),
        begins if mdf::BEGINS.iter().any(|b| begins.starts_with(b.as_slice())) => {
            counted("an MDF file")
                .and_then(|()| {
                    nameless("its unit is not for MDF's times, which are seconds", |t| {
                        t.unit.is_some()
                    })
                })
                .and_then(|()| mdf::read(path, time))
        }
        begins if begins.starts_with(PARQUET) => {
            counted("a Parquet file").and_then(|()| parquet(path, time))
        }
        _ if is_mat => counted("a MAT file").and_then(|()| mat::read(path, time)),
        _ => csv_file::read(path, &time.cloned().unwrap_or_default()),
    }
}

#[cfg(feature = "parquet")]
fn parquet(path: &Path, time: Option<&TimeColumn>) -> Result<Measurement, MeasurementError> {
    crate::parquet_file::read(path, time)
}

#[cfg(not(feature = "parquet"))]
fn parquet(path: &Path, _: Option<&TimeColumn>) -> Result<Measurement, MeasurementError> {
    let reason = "a Parquet file, which this build does not read: build it with --features parquet, or export CSV".into();
    Err(MeasurementError::Format { file: path.display().to_string(), reason })
}

/// SHA-256 of a file in hexadecimal, which identifies the log that a parameter was tuned to.
///
/// # Errors
///
/// [`MeasurementError::File`] if the file cannot be read.
pub fn digest(path: &Path) -> Result<String, MeasurementError> {
    let failed = |error| MeasurementError::File { file: path.display().to_string(), error };
    let mut file = File::open(path).map_err(failed)?;
    let mut hasher = Sha256::new();
    let mut buffer = vec![0; 1 << 16];
    loop {
        match file.read(&mut buffer).map_err(failed)? {
            0 => break,
            count => hasher.update(&buffer[..count]),
        }
    }
    Ok(hexadecimal(hasher))
}

/// SHA-256 of bytes in memory, in hexadecimal.
pub fn digest_of(bytes: &[u8]) -> String {
    let mut hasher = Sha256::new();
    hasher.update(bytes);
    hexadecimal(hasher)
}

fn hexadecimal(hasher: Sha256) -> String {
    hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}
