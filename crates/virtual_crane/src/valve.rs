//! Delay of the 3/2 valve and its pilot lines.

use crate::lag::Lag;
use std::collections::VecDeque;

/// Dynamics from the command of the 3/2 valve to the share of the pilot pressure at the pilots.
#[derive(Clone, Debug)]
pub(crate) struct SwitchingValve {
    /// Commands within the dead time, oldest first, one a step.
    pending: VecDeque<f64>,
    lines: Lag,
}

impl SwitchingValve {
    /// A valve in steady state at `position`, with its dead time and the lines' time constant \[s\], updated in steps
    /// of `step` \[s\].
    pub(crate) fn new(delay: f64, lines: f64, step: f64, position: f64) -> Self {
        let pending = (delay / step).round() as usize;
        Self {
            pending: std::iter::repeat_n(position, pending).collect(),
            lines: Lag::new(lines, step, position),
        }
    }

    /// Advances by one step; returns the position, 0 to 1.
    pub(crate) fn advance(&mut self, command: f64) -> f64 {
        self.pending.push_back(command);
        let effective = self.pending.pop_front().unwrap_or(command);
        self.lines.advance(effective)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pilot_lines_fill_after_the_valve_has_switched() {
        let mut valve = SwitchingValve::new(30e-3, 10e-3, 1e-3, 0.0);
        let positions: Vec<f64> = (0..60).map(|_| valve.advance(1.0)).collect();
        assert!(positions[..30].iter().all(|p| *p == 0.0));
        assert!((positions[39] - (1.0 - (-1.0_f64).exp())).abs() < 1e-9, "{}", positions[39]);
        assert_eq!(SwitchingValve::new(0.0, 0.0, 1e-3, 0.0).advance(1.0), 1.0);
    }
}
