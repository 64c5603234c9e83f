//! What the deadlines came to.

use hdrhistogram::Histogram;

/// Longest time that is told from longer ones \[ns\].
const LONGEST: u64 = 10_000_000_000;

/// Two looks at the thread's clock take no longer than this \[ns\].
const CLOCKS: u64 = 5_000;

/// Deadline accounting of one task; made before the cycle, and then without allocation.
#[derive(Clone, Debug)]
pub struct Timing {
    /// Period \[ns\].
    pub period: u64,
    /// How late the task was released \[ns\].
    lateness: Histogram<u64>,
    /// How long it took on its processor, without what others took from it \[ns\].
    execution: Histogram<u64>,
    /// Releases that came later than the next one was due.
    pub missed: u64,
    /// Steps taken.
    pub steps: u64,
    /// Longest execution \[ns\] and when it was \[ns since the first release\].
    pub worst: (u64, u64),
    /// Time \[ns\] during steps in which the task had no processor: pre-emption by others.
    pub taken: u64,
}

impl Timing {
    /// Nothing counted yet, of a task with a period \[ns\], of 1 ns at least; none where there is no memory for it.
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

    /// Counts a release that came `late` \[ns\].
    pub fn released(&mut self, late: u64) {
        self.lateness.saturating_record(late.max(1));
        self.missed += late / self.period;
    }

    /// Counts a step that took so long on its processor, and by the clock, at a time since the first
    /// release \[ns\].
    pub fn executed(&mut self, on_processor: u64, by_clock: u64, at: u64) {
        self.execution.saturating_record(on_processor.max(1));
        self.steps += 1;
        // less is what looking at both clocks takes
        self.taken += by_clock.saturating_sub(on_processor + CLOCKS);
        if on_processor > self.worst.0 {
            self.worst = (on_processor, at);
        }
    }

    /// How late the releases were: for each time \[us\] the share that was later.
    pub fn later_than(&self) -> Vec<(f64, f64)> {
        beyond(&self.lateness)
    }

    /// How long the steps took: for each time \[us\] the share that took longer.
    pub fn longer_than(&self) -> Vec<(f64, f64)> {
        beyond(&self.execution)
    }

    /// A share of the releases were at most so late \[us\].
    pub fn lateness_us(&self, share: f64) -> f64 {
        self.lateness.value_at_quantile(share) as f64 * 1e-3
    }

    /// A share of the steps took at most so long \[us\].
    pub fn execution_us(&self, share: f64) -> f64 {
        self.execution.value_at_quantile(share) as f64 * 1e-3
    }
}

/// For each recorded time \[us\] the share of all that is above; the last one, which nothing is above, left
/// out.
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
    fn every_step_is_counted_once_and_the_shares_fall_to_the_worst() {
        let mut timing = Timing::new(50_000).unwrap_or_else(|| panic!("no memory"));
        for k in 1..=1000_u64 {
            timing.released(k * 100);
            timing.executed(k, k + 20_000, k);
        }
        assert_eq!(timing.steps, 1000);
        // later than 50 us once, than 100 us never: 500 releases at or beyond a period, one beyond two
        assert_eq!(timing.missed, 501 + 1);
        assert_eq!(timing.worst, (1000, 1000));
        let later = timing.later_than();
        assert!(later.windows(2).all(|w| w[0].0 < w[1].0 && w[0].1 > w[1].1));
        let (_, half) = later.iter().find(|(us, _)| *us >= 50.0).copied().unwrap_or_default();
        assert!((half - 0.5).abs() < 2e-3, "{half}");
        assert!(timing.taken > 0);
    }
}
