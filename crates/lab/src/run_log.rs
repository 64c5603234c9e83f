//! Run of the virtual crane as a time series with the columns of its log.

use crate::closed_loop::sample::Sample;
use crate::log::{Log, columns, scaled};
use crate::motion_test::Run;
use crate::virtual_run::Contents;
use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::AxisSignals;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_files::FileError;
use hydroboom_model::Outputs;
use hydroboom_virtual_crane::Truth;
use std::path::Path;

/// Names of the columns; a recorded input has no reference.
pub(crate) fn header(contents: Contents, has_reference: bool) -> Vec<String> {
    let mut header = vec!["time_s".to_string()];
    if contents.readings() {
        if has_reference {
            header.extend(columns(&SetPoint::NAMES, &SetPoint::UNITS, "reference_"));
        }
        header.extend(columns(&AxisCommand::NAMES, &AxisCommand::UNITS, "command_"));
        header.extend(columns(&AxisSignals::NAMES, &AxisSignals::UNITS, ""));
    }
    if contents.truth() {
        header.extend(columns(&Outputs::NAMES, &Outputs::UNITS, "true_"));
        header.extend(columns(&Truth::NAMES, &Truth::UNITS, "true_"));
    }
    header
}

/// Row of these columns.
pub(crate) fn row(contents: Contents, has_reference: bool, sample: &Sample) -> Vec<f64> {
    let mut row = vec![sample.time];
    if contents.readings() {
        if has_reference {
            row.extend(scaled(&sample.reference.to_array(), &SetPoint::UNITS));
        }
        row.extend(scaled(&sample.command.to_array(), &AxisCommand::UNITS));
        row.extend(scaled(&sample.signals.to_array(), &AxisSignals::UNITS));
    }
    if contents.truth() {
        row.extend(scaled(&sample.truth.outputs.to_array(), &Outputs::UNITS));
        row.extend(scaled(&sample.truth.beside_outputs(), &Truth::UNITS));
    }
    row
}

/// Writes a run in the format of `hydroboom virtual --log --truth`, a row every control period.
///
/// # Errors
///
/// [`FileError`] if the file cannot be written.
pub fn write_run(run: &Run, path: &Path) -> Result<(), FileError> {
    let mut log = Log::begin(path, &header(Contents::Truth, true));
    run.samples.iter().for_each(|sample| log.row(&row(Contents::Truth, true, sample)));
    log.finish()
}
