//! Monitor of the drive: does the motor turn as commanded?

/// Numbers of the monitor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveMonitor {
    /// Slowest response of the speed loop, with the fieldbus: time constant \[s\].
    pub response: f64,
    /// Deviation beyond what that response explains that counts as not following \[rev/s\].
    pub deviation: f64,
    /// Time for which it must last \[s\].
    pub deviation_time: f64,
    /// Speed against the command, or beyond it, that counts as uncommanded \[rev/s\].
    pub uncommanded: f64,
    /// Share of the commanded speed that a drive may overshoot besides, under an overhauling load.
    pub overshoot: f64,
    /// Time for which it must last \[s\].
    pub uncommanded_time: f64,
}

/// What the motor speed says of the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveVerdict {
    /// It follows.
    Follows,
    /// It turns slower or faster than commanded.
    Deviates,
    /// It turns although commanded to stand still, or against its command.
    Uncommanded,
}

/// State of the monitor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveMonitorState {
    /// Largest and smallest speed that a slow drive may still have \[rev/s\].
    high: f64,
    low: f64,
    /// Time for which the speed has deviated, and has been uncommanded \[s\].
    deviating: f64,
    uncommanded: f64,
}

impl DriveMonitorState {
    /// A motor speed \[rev/s\] as far as the drive can have it after what it was commanded.
    pub fn plausible(&self, read: f64) -> f64 {
        read.max(self.low.min(0.0)).min(self.high.max(0.0))
    }
}

impl DriveMonitor {
    /// Judges the motor speed `read` \[rev/s\] under the speed `commanded` in the last period, after
    /// `elapsed` \[s\].
    pub fn judge(
        &self,
        state: &mut DriveMonitorState,
        commanded: f64,
        read: f64,
        elapsed: f64,
    ) -> DriveVerdict {
        // an envelope of the command: it rises at once and decays as the slowest drive does
        let decay = (elapsed / self.response).min(1.0);
        state.high = commanded.max(state.high + (commanded - state.high) * decay);
        state.low = commanded.min(state.low + (commanded - state.low) * decay);
        let beyond = (read - state.high).max(state.low - read).max(0.0);
        let uncommanded = (read - state.high.max(0.0)).max(state.low.min(0.0) - read).max(0.0);
        let lasts = |time: f64, is: bool| if is { time + elapsed } else { 0.0 };
        state.deviating = lasts(state.deviating, beyond > self.deviation);
        let allowed = self.uncommanded + self.overshoot * state.high.max(-state.low).max(0.0);
        state.uncommanded = lasts(state.uncommanded, uncommanded > allowed);
        if state.uncommanded > self.uncommanded_time {
            return DriveVerdict::Uncommanded;
        }
        match state.deviating > self.deviation_time {
            true => DriveVerdict::Deviates,
            false => DriveVerdict::Follows,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MONITOR: DriveMonitor = DriveMonitor {
        response: 0.04,
        deviation: 5.0,
        deviation_time: 0.1,
        uncommanded: 2.0,
        overshoot: 0.1,
        uncommanded_time: 0.01,
    };

    /// Periods of 1 ms until the verdict is no longer [`DriveVerdict::Follows`].
    fn found(speeds: impl Fn(f64) -> (f64, f64)) -> Option<(u32, DriveVerdict)> {
        let mut state = DriveMonitorState::default();
        (0..2000).find_map(|k| {
            let (commanded, read) = speeds(f64::from(k) * 1e-3);
            match MONITOR.judge(&mut state, commanded, read, 1e-3) {
                DriveVerdict::Follows => None,
                verdict => Some((k, verdict)),
            }
        })
    }

    #[test]
    fn a_drive_that_lags_as_described_follows() {
        let lag = |t: f64, from: f64, to: f64| to + (from - to) * (-t / 0.03).exp();
        // a step, and a step back to zero
        assert_eq!(found(|t| (20.0, lag(t, 0.0, 20.0))), None);
        let back = |t: f64| {
            if t < 0.5 { (20.0, lag(t, 0.0, 20.0)) } else { (0.0, lag(t - 0.5, 20.0, 0.0)) }
        };
        assert_eq!(found(back), None);
    }

    #[test]
    fn a_drive_that_turns_by_itself_or_the_other_way_is_found_within_20_ms() {
        for speeds in [|_: f64| (0.0, 5.0), |_: f64| (10.0, -10.0), |_: f64| (-10.0, 4.0)] {
            let (periods, verdict) = found(speeds).unwrap();
            assert!(periods < 20 && verdict == DriveVerdict::Uncommanded, "{periods} {verdict:?}");
        }
    }

    #[test]
    fn a_drive_that_stays_behind_deviates() {
        let (periods, verdict) = found(|_| (20.0, 4.0)).unwrap();
        assert!(periods < 250 && verdict == DriveVerdict::Deviates, "{periods} {verdict:?}");
    }
}
