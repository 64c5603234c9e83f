//! Sampling properties of a channel.

/// Sampling times of a channel: interval, jitter and gaps.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeBase {
    /// First time \[s\].
    pub begin: f64,
    /// Last time \[s\].
    pub end: f64,
    /// Median sampling interval \[s\].
    pub interval: f64,
    /// Largest deviation of an interval from the median \[s\], gaps excluded.
    pub jitter: f64,
    /// Intervals longer than 2.5 median intervals, where samples are missing.
    pub gaps: Vec<Gap>,
    /// Number of samples with the same time as the one before.
    pub repeated: usize,
}

/// Interval with missing samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Time of the last sample before the gap \[s\].
    pub from: f64,
    /// Time of the first sample after the gap \[s\].
    pub to: f64,
}

/// Ratio of an interval to the median above which it is a gap.
const GAP: f64 = 2.5;

impl TimeBase {
    /// Sampling properties of times \[s\] in non-decreasing order; none without two different times.
    pub fn of(time: &[f64]) -> Option<Self> {
        let (begin, end) = (*time.first()?, *time.last()?);
        let mut intervals: Vec<f64> = time.windows(2).map(|w| w[1] - w[0]).collect();
        let repeated = intervals.iter().filter(|i| **i == 0.0).count();
        intervals.retain(|i| *i > 0.0);
        if intervals.is_empty() {
            return None;
        }
        let middle = intervals.len() / 2;
        let interval = *intervals.select_nth_unstable_by(middle, f64::total_cmp).1;
        let is_gap = |w: &&[f64]| w[1] - w[0] > GAP * interval;
        let gaps = time.windows(2).filter(is_gap).map(|w| Gap { from: w[0], to: w[1] }).collect();
        let jitter = intervals
            .iter()
            .filter(|i| **i <= GAP * interval)
            .map(|i| (i - interval).abs())
            .fold(0.0, f64::max);
        Some(Self { begin, end, interval, jitter, gaps, repeated })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_and_jitter_are_distinguished() {
        let mut time: Vec<f64> = (0..1000).map(|k| f64::from(k) * 0.01).collect();
        time[500] += 0.002;
        time.drain(700..720);
        let base = TimeBase::of(&time).unwrap();
        assert!((base.interval - 0.01).abs() < 1e-9);
        assert!((base.jitter - 0.002).abs() < 1e-9);
        assert_eq!(base.gaps.len(), 1);
        assert!((base.gaps[0].from - 6.99).abs() < 1e-9 && (base.gaps[0].to - 7.2).abs() < 1e-9);
        assert!(TimeBase::of(&[1.0]).is_none() && TimeBase::of(&[1.0, 1.0]).is_none());
    }
}
