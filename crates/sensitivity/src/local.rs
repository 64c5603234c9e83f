//! Exact slopes at the machine as described.

use crate::case::Case;
use crate::error::SensitivityError;
use hydroboom_description::schema::Numbers;
use hydroboom_identify::{Free, prior};
use hydroboom_math::Dual;
use rayon::prelude::*;

/// Keys that one evaluation is differentiated by.
const TOGETHER: usize = 4;

/// How the outputs change with one key.
#[derive(Clone, Debug, PartialEq)]
pub struct Local {
    /// The key.
    pub key: Free,
    /// What is known of it: deviation of ln θ, from its provenance.
    pub known: f64,
    /// Slopes of the outputs along ln θ, in SI units and the case's order.
    pub slopes: Vec<f64>,
}

/// The outputs of the machine as described, and how they change with each key. `progress` is told the share that is
/// done.
///
/// # Errors
///
/// [`SensitivityError`] when an output cannot be computed.
pub fn local(
    case: &Case,
    free: &[Free],
    progress: &(dyn Fn() + Sync),
) -> Result<(Vec<f64>, Vec<Local>), SensitivityError> {
    type D = Dual<f64, TOGETHER>;
    let plain = case.description.numbers.to_array();
    let parts: Vec<&[Free]> = free.chunks(TOGETHER).collect();
    let runs: Result<Vec<Vec<D>>, SensitivityError> = parts
        .par_iter()
        .map(|part| {
            let mut numbers = plain.map(D::constant);
            for (direction, key) in part.iter().enumerate() {
                // dθ = θ d ln θ
                numbers[key.place].slope[direction] = plain[key.place];
            }
            let values = case.evaluate(&Numbers::from_array(numbers));
            progress();
            values
        })
        .collect();
    let runs = runs?;
    let values = match runs.first() {
        Some(first) => first.iter().map(|v| v.value).collect(),
        None => case.evaluate(&case.description.numbers)?,
    };
    let origins: Vec<String> =
        case.description.entries().map(|(_, _, o)| o.provenance.clone()).collect();
    let found = free
        .iter()
        .enumerate()
        .map(|(k, key)| {
            let (part, direction) = (k / TOGETHER, k % TOGETHER);
            let slopes = runs[part].iter().map(|v| v.slope[direction]).collect();
            Local { key: *key, known: prior(&origins[key.place]), slopes }
        })
        .collect();
    Ok((values, found))
}
