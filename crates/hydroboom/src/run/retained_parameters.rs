//! Parameters of the state estimator (oil, unknown flow, drive lag) from one run to the next, in a file.

use super::course_result::CourseResult;
use crate::output;
use hydroboom_control::estimation::retained_parameters::RetainedParameters;
use hydroboom_description::Description;
use hydroboom_realtime::control_task::{Fallback, Record};
use hydroboom_realtime::parameter_file;
use miette::{IntoDiagnostic, Result, miette};
use std::path::Path;

/// Parameters with their covariance from an earlier run; none if no file is named, or it does not exist yet.
///
/// # Errors
///
/// If the file cannot be read or is of another crane, or the folder of a new file does not exist.
pub fn read(path: Option<&Path>, model: &Description) -> Result<Option<RetainedParameters<f64>>> {
    match path {
        Some(path) if path.exists() => {
            let retained = parameter_file::read(model, path).into_diagnostic()?;
            let summary = parameter_file::summary(model, &retained);
            output::note(&format!("{}: loaded, {summary}", path.display()));
            Ok(Some(retained))
        }
        Some(path) => {
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
            if folder.is_some_and(|folder| !folder.is_dir()) {
                return Err(miette!("{}: its folder does not exist", path.display()));
            }
            output::note(&format!(
                "{}: does not exist yet; the estimator starts with the crane file",
                path.display()
            ));
            Ok(None)
        }
        None => Ok(None),
    }
}

/// Writes the parameters of a run's last record for the next run. Those of an estimator that diverged in one of the
/// courses are not written.
pub fn write(path: &Path, model: &Description, courses: &[CourseResult], last: Option<&Record>) {
    let diverged = Some(Fallback::Estimator.name());
    if courses.iter().any(|result| result.fallback_cause == diverged) {
        output::note(&format!("{}: not written, since the estimator diverged", path.display()));
        return;
    }
    let Some(estimates) = last.and_then(|record| record.estimates) else {
        output::note(&format!("{}: not written, since nothing was estimated", path.display()));
        return;
    };
    if !output::file(path, parameter_file::text(model, &estimates.parameters).as_bytes()) {
        return;
    }
    let summary = parameter_file::summary(model, &estimates.parameters);
    output::note(&format!("{}: written, {summary}", path.display()));
}
