//! One-at-a-time re-runs with a key at both ends of its uncertainty interval.
//!
//! Near a minimum a linear extrapolation predicts a decrease that does not exist, even to negative values. The re-run
//! gives the true values there.

use crate::case::Case;
use hydroboom_description::Description;
use hydroboom_description::schema::{KEYS, Numbers};
use hydroboom_identify::Free;
use rayon::prelude::*;

/// Lower and upper value of a key in its SI unit: θ e^∓s with the standard deviation s of ln θ \[-\], clipped to the
/// range that a crane file allows.
pub fn end_values(description: &Description, key: Free, deviation: f64) -> [f64; 2] {
    let (value, limits) = (key.value(description), &KEYS[key.place]);
    [-deviation, deviation]
        .map(|by| (value * by.exp()).clamp(limits.to_si(limits.low), limits.to_si(limits.high)))
}

/// Parameters of the crane, in SI units, with one key set to another value in its SI unit, which is not checked
/// against the key's range.
pub fn with_value(description: &Description, key: Free, value: f64) -> Numbers<f64> {
    let mut numbers = description.numbers.to_array();
    numbers[key.place] = value;
    Numbers::from_array(numbers)
}

/// Outputs of the case, in its order and in SI units, with each key at its lower and upper value: an entry for each
/// key. `None` where the crane cannot be built or simulated. `progress` is called after each key.
pub fn at_ends(
    case: &Case,
    ends: &[(Free, [f64; 2])],
    progress: &(dyn Fn() + Sync),
) -> Vec<[Option<Vec<f64>>; 2]> {
    ends.par_iter()
        .map(|(key, values)| {
            let at = |value| case.evaluate(&with_value(&case.description, *key, value)).ok();
            let found = values.map(at);
            progress();
            found
        })
        .collect()
}
