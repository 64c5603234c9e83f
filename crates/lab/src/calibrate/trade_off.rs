//! Effect of one parameter on all published results. If it improves one and worsens another, no value of it
//! meets both.

use super::published::{RESULTS, shown, tests};
use crate::LabError;
use hydroboom_description::Description;

/// Results of a crane for several values of a key (in the key's unit), a row per value in the order of
/// [`published`](super::published()). `progress` receives the number of completed rows.
///
/// # Errors
///
/// [`LabError::Description`] if there is no such key, or the value is NaN or gives an impossible machine. Otherwise
/// see [`tests`](super::tests()) and [`shown`](super::shown()).
pub fn trade_off(
    model: &Description,
    crane: &Description,
    key: &str,
    values: &[f64],
    progress: &dyn Fn(usize),
) -> Result<Vec<[f64; RESULTS]>, LabError> {
    let mut rows = Vec::with_capacity(values.len());
    for value in values {
        let mut changed = crane.clone();
        changed.set(&format!("{key}={value}"))?;
        rows.push(shown(&tests(model, &changed)?)?);
        progress(rows.len());
    }
    Ok(rows)
}
