//! Horizon of the predictive controllers: blocks of constant commanded motor speed, short ones first (move
//! blocking).
//!
//! The first blocks last one control period, so that near an operating point the controller is as fast as a
//! regulator with that period. The regulator's cost-to-go is the terminal cost, which replaces a longer
//! horizon.
//!
//! Source: R. Cagienard, P. Grieder, E. C. Kerrigan, M. Morari, *Move blocking strategies in receding
//! horizon control*, Journal of Process Control 17(6), 2007.

/// Number of blocks in the horizon.
pub(super) const BLOCKS: usize = 30;

/// Control periods in each block; the horizon is 0.318 s for a control period of 1 ms.
pub(super) const PERIODS: [usize; BLOCKS] = [
    1, 1, 1, 1, 1, 1, 2, 2, 2, 2, 2, 2, 5, 5, 5, 5, 5, 5, 15, 15, 15, 15, 15, 15, 30, 30, 30, 30,
    30, 30,
];

/// Control periods before each block; the last entry is the whole horizon.
pub(super) const BEGINS: [usize; BLOCKS + 1] = {
    let mut begins = [0; BLOCKS + 1];
    let mut k = 0;
    while k < BLOCKS {
        begins[k + 1] = begins[k] + PERIODS[k];
        k += 1;
    }
    begins
};

/// Weight of the state at the end of each block \[periods\]. The cost is a sum over all periods, each
/// weighted at its beginning; within a block it is taken as linear. A block of m periods then contributes
/// (m + 1)/2 to its beginning and (m − 1)/2 to its end.
pub(super) const WEIGHTS: [f64; BLOCKS] = {
    let mut weights = [0.0; BLOCKS];
    let mut k = 0;
    while k < BLOCKS {
        let next = if k + 1 < BLOCKS { PERIODS[k + 1] + 1 } else { 0 };
        weights[k] = 0.5 * (PERIODS[k] - 1 + next) as f64;
        k += 1;
    }
    weights
};

/// Commands of the blocks one control period later. Each block takes the share of the next block that moves
/// into it; the last block is unchanged.
pub(super) fn advanced(commands: &[f64; BLOCKS]) -> [f64; BLOCKS] {
    std::array::from_fn(|k| {
        let next = commands[(k + 1).min(BLOCKS - 1)];
        commands[k] + (next - commands[k]) / PERIODS[k] as f64
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_blocks_add_up_to_the_horizon() {
        let all: f64 = WEIGHTS.iter().sum();
        assert_eq!(all + 0.5 * (PERIODS[0] + 1) as f64, BEGINS[BLOCKS] as f64);
        assert_eq!(WEIGHTS[..5], [1.0; 5]);
    }

    #[test]
    fn a_ramp_of_blocked_commands_stays_a_ramp_when_shifted() {
        let middle = |k: usize| BEGINS[k] as f64 + 0.5 * PERIODS[k] as f64;
        let ramp: [f64; BLOCKS] = std::array::from_fn(middle);
        // exact where the next block is as long, as with single-period blocks
        let later = advanced(&ramp);
        for k in (0..BLOCKS - 1).filter(|k| PERIODS[*k] == PERIODS[k + 1]) {
            assert!((later[k] - ramp[k] - 1.0).abs() < 1e-12, "block {k}: {}", later[k] - ramp[k]);
        }
    }
}
