//! Statistics of a bus since its start: counters of exchanges and losses, and distributions of times.

/// Upper end of the histograms; longer times are counted there \[ns\].
const LONGEST: u64 = 1_000_000_000;

/// Counters since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Cycles that were begun.
    pub cycles: u64,
    /// Exchanges of process data, one or two a cycle.
    pub exchanges: u64,
    /// Exchanges whose frame did not come back in time.
    pub lost: u64,
    /// Exchanges that came back with a working counter that is not the expected one.
    pub low: u64,
    /// Received frames that answer no pending exchange: late, repeated, or of another sender.
    pub unexpected: u64,
    /// Cycles in which no new command had come.
    pub without_command: u64,
    /// Exchanges with outputs that passed the reference clock after the SYNC0 at which they were to be applied.
    pub late_outputs: u64,
    /// Exchanges that this computer began more than half a period late.
    pub late_begins: u64,
    /// Records of cycles that were dropped, as the queue to the log was full.
    pub records_lost: u64,
    /// Cycles in which a drive showed a warning (statusword bit 7).
    pub warnings: u64,
    /// Cycles in which a drive showed an active limit (statusword bit 11).
    pub limits: u64,
}

/// Distribution of times \[ns\]; longer ones than 1 s count as 1 s.
pub type Histogram = hdrhistogram::Histogram<u64>;

/// Distributions of times since the start.
#[derive(Clone, Debug)]
pub struct Times {
    /// Margin of the outputs to SYNC0, at the reference clock \[ns\].
    pub margin: Histogram,
    /// From the sending of a frame to its return, by this computer's clock \[ns\].
    pub round_trip: Histogram,
}

impl Times {
    /// Empty histograms; none where memory is short.
    pub(crate) fn new() -> Option<Self> {
        let empty = Histogram::new_with_bounds(1, LONGEST, 3).ok()?;
        Some(Self { margin: empty.clone(), round_trip: empty })
    }
}
