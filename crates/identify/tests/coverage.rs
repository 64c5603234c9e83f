//! Intervals on logs of virtual cranes, which the model is not the true one of.

#[path = "made/draws.rs"]
mod draws;

use draws::{KEYS, coverage};

/// What is called neither open nor biased is where it is said to be. Ten draws; a hundred by hand, in the example `interval_coverage`.
#[test]
fn intervals_on_virtual_cranes_hold_the_truth_or_the_key_is_called_biased() {
    let rows = coverage(2029, 0..10);
    let mut told = 0;
    for (key, row) in KEYS.iter().zip(&rows) {
        let [count, holds] = row.determined;
        eprintln!("{key}: {holds} of {count} determined, biased {:?}: {}", row.biased, row.reason);
        // of ten that hold in nineteen cases of twenty, three miss once in a hundred times
        assert!(holds + 2 >= count, "{key}: {holds} of {count} intervals hold the truth");
        told += count;
    }
    assert!(told >= 5, "{told} intervals are called determined");
}
