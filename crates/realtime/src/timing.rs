//! Deadline statistics of a real-time task.

use hdrhistogram::Histogram;

/// Largest time that the histograms resolve \[ns\].
const LONGEST: u64 = 10_000_000_000;

/// Upper bound of the time to read the thread's clock twice \[ns\].
const CLOCKS: u64 = 5_000;

/// Deadline statistics of one task: release delays, execution times and missed releases. Memory is allocated only by
/// [`new`](Self::new).
#[derive(Clone, Debug)]
pub struct Timing {
    /// Period of the task \[ns\].
    pub period: u64,
    /// Release delay \[ns\].
    lateness: Histogram<u64>,
    /// Execution time on the processor, without pre-emption \[ns\].
    execution: Histogram<u64>,
    /// Number of missed releases, each a full period of delay.
    pub missed: u64,
    /// Number of executed steps.
    pub steps: u64,
    /// Longest execution time \[ns\], and the time of its occurrence since the first release \[ns\].
    pub worst: (u64, u64),
    /// Time during steps in which the task was pre-empted \[ns\].
    pub taken: u64,
}

impl Timing {
    /// Statistics of a task with a period \[ns\], at least 1 ns, before its first release; none if there is no memory.
    pub fn new(period: u64) -> Option<Self> {
        let empty = Histogram::new_with_bounds(1, LONGEST, 3).ok()?;
        Some(Self {
            period: period.max(1),
            lateness: empty.clone(),
            execution: empty,
            missed: 0,
            steps: 0,
            worst: (0, 0),
            taken: 0,
        })
    }

    /// Counts a release with a delay `late` \[ns\].
    pub fn released(&mut self, late: u64) {
        self.lateness.saturating_record(late.max(1));
        self.missed += late / self.period;
    }

    /// Counts a step: its time on the processor \[ns\], its time by the clock \[ns\], and the time since the first
    /// release \[ns\].
    pub fn executed(&mut self, on_processor: u64, by_clock: u64, at: u64) {
        self.execution.saturating_record(on_processor.max(1));
        self.steps += 1;
        // a smaller difference is the time to read both clocks
        self.taken += by_clock.saturating_sub(on_processor + CLOCKS);
        if on_processor > self.worst.0 {
            self.worst = (on_processor, at);
        }
    }

    /// Distribution of the release delay: pairs of a delay \[us\] and the share of releases with a longer one \[-\].
    /// The largest delay is left out; empty before two different delays.
    pub fn later_than(&self) -> Vec<(f64, f64)> {
        beyond(&self.lateness)
    }

    /// Distribution of the execution time: pairs of a time \[us\] and the share of steps that take longer \[-\].
    /// The longest time is left out; empty before two different times.
    pub fn longer_than(&self) -> Vec<(f64, f64)> {
        beyond(&self.execution)
    }

    /// Quantile of the release delay \[us\]; `share` from 0 to 1, a larger one counts as 1. 0 before the first
    /// release.
    pub fn lateness_us(&self, share: f64) -> f64 {
        self.lateness.value_at_quantile(share) as f64 * 1e-3
    }

    /// Quantile of the execution time \[us\]; `share` from 0 to 1, a larger one counts as 1. 0 before the first step.
    pub fn execution_us(&self, share: f64) -> f64 {
        self.execution.value_at_quantile(share) as f64 * 1e-3
    }
}

/// Complementary distribution: for each recorded time \[us\] the share of values above it, without the
/// largest one.
fn beyond(histogram: &Histogram<u64>) -> Vec<(f64, f64)> {
    let all = histogram.len().max(1) as f64;
    let mut counted = 0;
    let mut shares = Vec::new();
    for step in histogram.iter_recorded() {
        counted += step.count_at_value();
        shares.push((step.value_iterated_to() as f64 * 1e-3, 1.0 - counted as f64 / all));
    }
    shares.pop();
    shares
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_step_is_counted_once_and_shares_fall_towards_the_worst() {
        let mut timing = Timing::new(50_000).unwrap_or_else(|| panic!("no memory"));
        for k in 1..=1000_u64 {
            timing.released(k * 100);
            timing.executed(k, k + 20_000, k);
        }
        assert_eq!(timing.steps, 1000);
        // 501 delays of at least one period, one of them of two
        assert_eq!(timing.missed, 501 + 1);
        assert_eq!(timing.worst, (1000, 1000));
        let later = timing.later_than();
        assert!(later.windows(2).all(|w| w[0].0 < w[1].0 && w[0].1 > w[1].1));
        let (_, half) = later.iter().find(|(us, _)| *us >= 50.0).copied().unwrap_or_default();
        assert!((half - 0.5).abs() < 2e-3, "{half}");
        assert!(timing.taken > 0);
    }
}
