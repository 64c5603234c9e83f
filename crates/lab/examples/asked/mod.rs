//! Which cranes of a family an example is asked to look at.

use std::num::ParseIntError;

/// The numbers behind the example's name: a seed, and cranes of its family. Without cranes the first `all` of the seed, without a seed the first twelve of
/// `seed`.
pub fn asked(seed: u64, all: u64) -> Result<(u64, Vec<u64>), ParseIntError> {
    let numbers = std::env::args().skip(1).map(|n| n.parse()).collect::<Result<Vec<u64>, _>>()?;
    Ok(match numbers.as_slice() {
        [] => (seed, (0..12).collect()),
        [seed] => (*seed, (0..all).collect()),
        [seed, cranes @ ..] => (*seed, cranes.to_vec()),
    })
}

/// Each of them at each speed.
pub fn jobs(cranes: &[u64], speeds: [f64; 2]) -> Vec<(u64, f64)> {
    cranes.iter().flat_map(|k| speeds.map(|speed| (*k, speed))).collect()
}
