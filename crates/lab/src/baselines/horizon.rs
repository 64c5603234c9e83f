//! Horizon of the predictive controllers: blocks in which the commanded motor speed is constant, short ones first (move blocking).
//!
//! The first blocks are as long as a control period, so that near an operating point the controller is as fast as a regulator of that period. What comes after the
//! last block costs what the regulator's cost to go says, so that the horizon need not be longer.
//!
//! Source: R. Cagienard, P. Grieder, E. C. Kerrigan, M. Morari, *Move blocking strategies in receding horizon control*, Journal of Process Control 17(6), 2007.

/// Blocks of the horizon.
pub(super) const BLOCKS: usize = 30;

/// Control periods in each block: 0.318 s in all where the control period is 1 ms.
pub(super) const PERIODS: [usize; BLOCKS] = [
    1, 1, 1, 1, 1, 1, 2, 2, 2, 2, 2, 2, 5, 5, 5, 5, 5, 5, 15, 15, 15, 15, 15, 15, 30, 30, 30, 30,
    30, 30,
];

/// Control periods before each block; the last is the whole horizon.
pub(super) const BEGINS: [usize; BLOCKS + 1] = {
    let mut begins = [0; BLOCKS + 1];
    let mut k = 0;
    while k < BLOCKS {
        begins[k + 1] = begins[k] + PERIODS[k];
        k += 1;
    }
    begins
};

/// Weight of the state at each block's end, in periods: with the beginnings' shares the sum over all periods, each weighted at its beginning, where a cost is linear over a block. Of a
/// block of m periods its beginning has (m + 1)/2 and its end (m − 1)/2.
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

/// Commands of the blocks a control period later: each block takes what moves into it of the next one; the last stays.
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
    fn weights_add_up_to_the_periods_behind_the_first() {
        let all: f64 = WEIGHTS.iter().sum();
        assert_eq!(all + 0.5 * (PERIODS[0] + 1) as f64, BEGINS[BLOCKS] as f64);
        assert_eq!(WEIGHTS[..5], [1.0; 5]);
    }

    #[test]
    fn commands_that_are_a_ramp_over_time_stay_that_ramp() {
        let middle = |k: usize| BEGINS[k] as f64 + 0.5 * PERIODS[k] as f64;
        let ramp: [f64; BLOCKS] = std::array::from_fn(middle);
        // exact where the next block is as long, and where blocks are single periods
        let later = advanced(&ramp);
        for k in (0..BLOCKS - 1).filter(|k| PERIODS[*k] == PERIODS[k + 1]) {
            assert!((later[k] - ramp[k] - 1.0).abs() < 1e-12, "block {k}: {}", later[k] - ramp[k]);
        }
    }
}
