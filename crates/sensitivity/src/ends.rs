//! The machine re-run with a key at both ends of what is known of it.
//!
//! Near a minimum a slope foretells a decrease that does not come, and may lead below zero: there the ends tell what is so.

use crate::case::Case;
use hydroboom_description::Description;
use hydroboom_description::schema::{KEYS, Numbers};
use hydroboom_identify::Free;
use rayon::prelude::*;

/// Values of a key \[SI\], less and more: θ e^∓s with deviation s of ln θ, no further than the key's limits.
pub fn end_values(description: &Description, key: Free, deviation: f64) -> [f64; 2] {
    let (value, limits) = (key.value(description), &KEYS[key.place]);
    [-deviation, deviation]
        .map(|by| (value * by.exp()).clamp(limits.to_si(limits.low), limits.to_si(limits.high)))
}

/// Numbers of the machine with a key at another value \[SI\].
pub fn with_value(description: &Description, key: Free, value: f64) -> Numbers<f64> {
    let mut numbers = description.numbers.to_array();
    numbers[key.place] = value;
    Numbers::from_array(numbers)
}

/// Outputs of the case, in its order and in SI units, with each key at both ends: none where there is no such machine, or it cannot follow. `progress` is
/// told of each key that is done.
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
