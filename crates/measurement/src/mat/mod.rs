//! MAT files of MATLAB, Simulink, dSPACE, Dymola and OpenModelica: levels 4 to 7.3.
//!
//! ```text
//! file -level_4, level_5, level_7_3-> variables -arrange (times, signals of equal length), trajectory-> samples
//! ```

mod arrange;
mod level_4;
mod level_5;
mod level_7_3;
mod numbers;
mod simulink;
mod trajectory;
mod value;

use crate::channel::Measurement;
use crate::error::MeasurementError;
use crate::heading::TIMES;
use crate::sampled::Assembly;
use crate::time_column::TimeColumn;
use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

/// Reads a MAT file. The column of `time` is the name of the time variable, or its path (`s.time`).
///
/// # Errors
///
/// [`MeasurementError`] if the file has no usable signal, with a description of its content.
pub(crate) fn read(
    path: &Path,
    time: Option<&TimeColumn>,
) -> Result<Measurement, MeasurementError> {
    let file = path.display().to_string();
    let format = |reason: String| MeasurementError::Format { file: file.clone(), reason };
    let failed = |error| MeasurementError::File { file: file.clone(), error };
    let mut source = BufReader::new(File::open(path).map_err(failed)?);
    let mut begins = Vec::new();
    source.by_ref().take(10).read_to_end(&mut begins).map_err(failed)?;
    source.rewind().map_err(failed)?;
    let mut remarks = Vec::new();
    let variables = match begins.as_slice() {
        b"MATLAB 7.3" => level_7_3::read(path, &mut remarks),
        [b'M', b'A', b'T', b'L', b'A', b'B', ..] => level_5::read(source, &mut remarks),
        _ => level_4::read(source, &mut remarks),
    }
    .map_err(format)?;
    if let Some(samples) = trajectory::samples(&variables, &mut remarks) {
        let samples = samples.map_err(format)?;
        drop(variables);
        let mut assembly = Assembly::new(&file, time, remarks);
        assembly.add(samples)?;
        return assembly.finish();
    }
    let column = time.and_then(|t| t.column.as_deref());
    let arranged = arrange::arrange(&variables, column);
    drop(variables);
    remarks.extend(arranged.remarks);
    if let Some(wanted) = column.filter(|_| !arranged.has_wanted) {
        let reason = format!(
            "the mapping names \"{wanted}\" as the time; variables of numbers are: {}",
            arranged.names.join(", ")
        );
        return Err(MeasurementError::Mapping { file, reason });
    }
    if arranged.samples.is_empty() && !arranged.has_wanted {
        let names = match arranged.names.is_empty() {
            true => "no numbers".into(),
            false => arranged.names.join(", "),
        };
        let said: String = remarks.iter().map(|r| format!("; {r}")).collect();
        return Err(format(format!(
            "no variable is named as a time ({}); there are: {names}{said}",
            TIMES.join(", ")
        )));
    }
    let mut assembly = Assembly::new(&file, time, remarks);
    for samples in arranged.samples {
        assembly.add(samples)?;
    }
    assembly.finish()
}
