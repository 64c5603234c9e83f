//! Local sensitivities: exact derivatives at the nominal parameters, by dual numbers.

use crate::case::Case;
use crate::error::SensitivityError;
use hydroboom_description::schema::Numbers;
use hydroboom_identify::{Free, prior};
use hydroboom_math::Dual;
use rayon::prelude::*;

/// Number of keys differentiated in one evaluation.
const TOGETHER: usize = 4;

/// Semi-relative sensitivities of the outputs to one key θ: derivatives with respect to ln θ.
#[derive(Clone, Debug, PartialEq)]
pub struct Local {
    /// Key of the crane file.
    pub key: Free,
    /// Standard deviation of ln θ \[-\], from the key's provenance.
    pub known: f64,
    /// Derivatives d output/d ln θ in the outputs' SI units, in the case's order: a change of θ by 1 % changes an
    /// output by a hundredth of it.
    pub slopes: Vec<f64>,
}

/// Nominal outputs in SI units, and their exact derivatives with respect to ln θ of each key by dual numbers, in the
/// order of `free`. `progress` is called after each evaluation, which differentiates by four keys.
///
/// # Errors
///
/// As [`Case::evaluate`], for the first output that cannot be computed.
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
