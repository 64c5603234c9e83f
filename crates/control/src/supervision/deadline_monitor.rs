//! Deadline monitor: number of missed control periods in a sliding window.

/// Length of the sliding window \[control periods\].
pub const WINDOW: u32 = 256;
const WORDS: usize = (WINDOW / 64) as usize;

/// Monitor of missed deadlines in a sliding window of control periods, one bit each, the newest first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeadlineMonitor {
    missed: [u64; WORDS],
}

impl DeadlineMonitor {
    /// Registers an executed control period after `missed` ones that were not executed. Returns the number of missed
    /// ones among the last [`WINDOW`] control periods.
    pub fn executed(&mut self, missed: u32) -> u32 {
        (0..missed.min(WINDOW)).for_each(|_| self.shift(true));
        self.shift(false);
        self.missed.iter().map(|word| word.count_ones()).sum()
    }

    fn shift(&mut self, missed: bool) {
        let mut carried = u64::from(missed);
        for word in &mut self.missed {
            let out = *word >> 63;
            *word = (*word << 1) | carried;
            carried = out;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missed_periods_count_until_the_window_has_passed() {
        let mut monitor = DeadlineMonitor::default();
        assert_eq!(monitor.executed(5), 5);
        for _ in 0..WINDOW - 6 {
            assert_eq!(monitor.executed(0), 5);
        }
        assert_eq!(monitor.executed(0), 4);
        for _ in 0..5 {
            monitor.executed(0);
        }
        assert_eq!(monitor.executed(0), 0);
        assert_eq!(monitor.executed(u32::MAX), WINDOW - 1);
    }

    #[test]
    fn twelve_missed_periods_of_every_thirteen_are_counted() {
        let mut monitor = DeadlineMonitor::default();
        let most = (0..40).map(|_| monitor.executed(12)).max().unwrap();
        assert!(most > WINDOW * 9 / 10, "{most}");
    }
}
