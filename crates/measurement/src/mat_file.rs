//! MAT files of MATLAB and Simulink, as levels 5 to 7 have them: numeric arrays, a time among them. Level 4, which
//! Hydroboom writes itself, is read too.

use crate::channel::{Channel, Measurement};
use crate::dimension::Dimension;
use crate::error::MeasurementError;
use crate::heading::Heading;
use matfile::{MatFile, NumericData};
use std::path::Path;
use std::sync::Arc;

/// Names of variables that hold the time.
const TIMES: [&str; 5] = ["t", "time", "tout", "t_s", "time_s"];

/// Bytes of a file, at most.
const LARGEST: u64 = 150 << 20;

pub(crate) fn read(path: &Path, time: Option<&str>) -> Result<Measurement, MeasurementError> {
    let file = path.display().to_string();
    let format = |reason: String| MeasurementError::Format { file: file.clone(), reason };
    let failed = |error| MeasurementError::File { file: file.clone(), error };
    let size = std::fs::metadata(path).map_err(failed)?.len();
    if size > LARGEST {
        return Err(format(format!(
            "{} MB: MAT files are read whole, up to {} MB; export it as CSV, which is read in parts",
            size >> 20,
            LARGEST >> 20
        )));
    }
    let bytes = std::fs::read(path).map_err(failed)?;
    let variables = match bytes.starts_with(b"MATLAB 5.0") {
        true => level_5(&bytes).map_err(format)?,
        false if bytes.starts_with(b"MATLAB 7.3") => {
            return Err(format(
                "a MAT file of level 7.3 (HDF5) is not read; save it with -v7 in MATLAB".into(),
            ));
        }
        false => level_4(&bytes).map_err(format)?,
    };
    let is_time = |name: &str| match time {
        Some(wanted) => name == wanted,
        None => TIMES.contains(&name.to_lowercase().as_str()),
    };
    let names = || variables.iter().map(|v| v.0.as_str()).collect::<Vec<_>>().join(", ");
    let Some((heading, values)) = variables.iter().find(|(name, _)| is_time(name)) else {
        return Err(format(format!(
            "no variable is named as a time ({}); there are: {}. Structures are not read: log arrays",
            TIMES.join(", "),
            names()
        )));
    };
    let unit = Heading::parse(heading).unit.filter(|u| u.dimension == Dimension::Time);
    let scale = unit.map_or(1.0, |u| u.factor);
    if values.len() < 2 {
        let found = format!("{heading} has {} values", values.len());
        return Err(MeasurementError::Empty { file, found });
    }
    if let Some(k) = values.windows(2).position(|w| w[0].is_nan() || w[1].is_nan() || w[1] < w[0]) {
        return Err(MeasurementError::Time {
            file,
            line: k as u64 + 2,
            column: heading.clone(),
            before: values[k],
            after: values[k + 1],
        });
    }
    let times: Arc<[f64]> = values.iter().map(|t| t * scale).collect();
    let mut remarks = Vec::new();
    let mut channels = Vec::new();
    for (name, values) in variables.iter().filter(|(name, _)| !is_time(name)) {
        let rows = times.len();
        if values.is_empty() || !values.len().is_multiple_of(rows) {
            remarks.push(format!(
                "{name} has {} values, the time {rows}: it is left out",
                values.len()
            ));
            continue;
        }
        let several = values.len() > rows;
        for (k, column) in values.chunks(rows).enumerate() {
            let heading = if several { format!("{name}_{}", k + 1) } else { name.clone() };
            let mut read = Heading::parse(name);
            if several {
                read.name = format!("{}_{}", read.name, k + 1);
            }
            let there = |v: &f64| if v.is_finite() { *v } else { f64::NAN };
            let values = column.iter().map(there).collect();
            channels.push(Channel::of(read, &heading, Arc::clone(&times), values));
        }
    }
    Ok(Measurement { name: file, channels, remarks })
}

fn level_5(bytes: &[u8]) -> Result<Vec<(String, Vec<f64>)>, String> {
    let mat = MatFile::parse(bytes).map_err(|e| format!("not read as a MAT file: {e}"))?;
    let numbers = |data: &NumericData| -> Vec<f64> {
        macro_rules! real {
            ($values:expr) => {
                $values.iter().map(|v| *v as f64).collect()
            };
        }
        match data {
            NumericData::Int8 { real, .. } => real!(real),
            NumericData::UInt8 { real, .. } => real!(real),
            NumericData::Int16 { real, .. } => real!(real),
            NumericData::UInt16 { real, .. } => real!(real),
            NumericData::Int32 { real, .. } => real!(real),
            NumericData::UInt32 { real, .. } => real!(real),
            NumericData::Int64 { real, .. } => real!(real),
            NumericData::UInt64 { real, .. } => real!(real),
            NumericData::Single { real, .. } => real!(real),
            NumericData::Double { real, .. } => real.clone(),
        }
    };
    Ok(mat.arrays().iter().map(|a| (a.name().to_string(), numbers(a.data()))).collect())
}

/// Level 4: for each matrix five integers, its name, its numbers by columns.
fn level_4(bytes: &[u8]) -> Result<Vec<(String, Vec<f64>)>, String> {
    let wrong = || "neither a MAT file of level 4 nor of level 5 to 7".to_string();
    let mut variables = Vec::new();
    let mut rest = bytes;
    while !rest.is_empty() {
        let (head, after) = rest.split_at_checked(20).ok_or_else(wrong)?;
        let integer = |k: usize| {
            let four = [head[4 * k], head[4 * k + 1], head[4 * k + 2], head[4 * k + 3]];
            u32::from_le_bytes(four) as usize
        };
        let (kind, rows, columns, imaginary, name) =
            (integer(0), integer(1), integer(2), integer(3), integer(4));
        // little endian doubles, full and real: what Hydroboom and -v4 write
        if kind != 0 || imaginary != 0 || name > 1000 {
            return Err(wrong());
        }
        let count = rows.checked_mul(columns).ok_or_else(wrong)?;
        let (text, after) = after.split_at_checked(name).ok_or_else(wrong)?;
        let size = count.checked_mul(8).ok_or_else(wrong)?;
        let (numbers, after) = after.split_at_checked(size).ok_or_else(wrong)?;
        let text = String::from_utf8_lossy(text).trim_end_matches('\0').to_string();
        let eight = |c: &[u8]| f64::from_le_bytes([c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7]]);
        variables.push((text, numbers.chunks_exact(8).map(eight).collect()));
        rest = after;
    }
    Ok(variables)
}
