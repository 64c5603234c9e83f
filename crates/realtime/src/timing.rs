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
    /// Nothing counted yet, of a task with a period \[ns\]; none where there is no memory for it.
    pub fn new(period: u64) -> Option<Self> {
        let empty = Histogram::new_with_bounds(1, LONGEST, 3).ok()?;
        Some(Self {
            period,
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

    /// A share of the releases were at most so late \[us\].
    pub fn lateness_us(&self, share: f64) -> f64 {
        self.lateness.value_at_quantile(share) as f64 * 1e-3
    }

    /// A share of the steps took at most so long \[us\].
    pub fn execution_us(&self, share: f64) -> f64 {
        self.execution.value_at_quantile(share) as f64 * 1e-3
    }
}
