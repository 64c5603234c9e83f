//! Monitor of the drive: does the motor turn as commanded?
//!
//! A slow drive may still be anywhere between the speeds it has been commanded; that envelope closes as the
//! slowest drive does, within its limits of slew and torque:
//!
//! ```text
//! |n'| ≤ slew,   |2π J n' + D Δp/(2π)| ≤ T_max
//! ```

use core::f64::consts::TAU;

/// Numbers of the monitor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveMonitor {
    /// Slowest response of the speed loop, with the fieldbus: time constant \[s\].
    pub response: f64,
    /// Slew limit of the drive \[rev/s²\].
    pub slew: f64,
    /// Smallest torque that the motor has, T_max \[N·m\].
    pub torque: f64,
    /// Moment of inertia of motor and pump, J \[kg·m²\].
    pub inertia: f64,
    /// Displacement of the pump, D \[m³/rev\].
    pub displacement: f64,
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
    /// Judges the motor speed `read` \[rev/s\] under the speed `commanded` in the last period and the pump's
    /// pressure difference, p_PA − p_PB \[Pa\], after `elapsed` \[s\].
    pub fn judge(
        &self,
        state: &mut DriveMonitorState,
        commanded: f64,
        read: f64,
        pressure: f64,
        elapsed: f64,
    ) -> DriveVerdict {
        // the envelope opens to a command at once
        let decay = (elapsed / self.response).min(1.0);
        let load = self.displacement * pressure / TAU;
        let by = |torque: f64| (torque / (TAU * self.inertia)).min(self.slew).max(0.0) * elapsed;
        let (falls, rises) = (by(self.torque + load), by(self.torque - load));
        state.high = commanded.max(state.high - ((state.high - commanded) * decay).min(falls));
        state.low = commanded.min(state.low + ((commanded - state.low) * decay).min(rises));
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
        slew: 500.0,
        torque: 32.0,
        inertia: 0.01,
        displacement: 1e-5,
        deviation: 5.0,
        deviation_time: 0.1,
        uncommanded: 2.0,
        overshoot: 0.1,
        uncommanded_time: 0.01,
    };

    /// Pressure difference of the pump \[Pa\].
    const LOAD: f64 = 60e5;

    /// Periods of 1 ms, after a speed commanded for long, until the verdict is no longer
    /// [`DriveVerdict::Follows`].
    fn found(
        before: f64,
        pressure: f64,
        speeds: impl Fn(f64) -> (f64, f64),
    ) -> Option<(u32, DriveVerdict)> {
        let mut state = DriveMonitorState { high: before, low: before, ..Default::default() };
        (0..2000).find_map(|k| {
            let (commanded, read) = speeds(f64::from(k) * 1e-3);
            match MONITOR.judge(&mut state, commanded, read, pressure, 1e-3) {
                DriveVerdict::Follows => None,
                verdict => Some((k, verdict)),
            }
        })
    }

    #[test]
    fn a_drive_that_lags_as_described_follows() {
        let lag = |t: f64, from: f64, to: f64| to + (from - to) * (-t / 0.03).exp();
        // a step, and a step back to zero
        assert_eq!(found(0.0, LOAD, |t| (20.0, lag(t, 0.0, 20.0))), None);
        let back = |t: f64| {
            if t < 0.5 { (20.0, lag(t, 0.0, 20.0)) } else { (0.0, lag(t - 0.5, 20.0, 0.0)) }
        };
        assert_eq!(found(0.0, LOAD, back), None);
    }

    #[test]
    fn a_drive_at_its_slew_limit_or_short_of_torque_follows() {
        // 50 rev/s back, for which the drive takes longer than its response
        let braking = 50.0 / MONITOR.slew;
        assert!(braking > 2.0 * MONITOR.response);
        let at = |slew: f64| move |t: f64| (-25.0, (25.0 - slew * t).max(-25.0));
        assert_eq!(found(25.0, LOAD, at(MONITOR.slew)), None);
        // the motor is left with a tenth of its torque to brake a load that it lowers
        let heavy = 0.9 * MONITOR.torque * TAU / MONITOR.displacement;
        let slew = 0.1 * MONITOR.torque / (TAU * MONITOR.inertia);
        let slowed = |t: f64| (20.0, (-20.0 + slew * t).min(20.0));
        assert_eq!(found(-20.0, heavy, slowed), None);
        // under a light load the same motor is not driven as commanded
        assert!(found(-20.0, 0.0, slowed).is_some());
    }

    #[test]
    fn a_drive_that_turns_by_itself_or_the_other_way_is_found_within_20_ms() {
        for speeds in [|_: f64| (0.0, 5.0), |_: f64| (10.0, -10.0), |_: f64| (-10.0, 4.0)] {
            let (periods, verdict) = found(0.0, LOAD, speeds).unwrap();
            assert!(periods < 20 && verdict == DriveVerdict::Uncommanded, "{periods} {verdict:?}");
        }
    }

    #[test]
    fn a_drive_that_stays_behind_deviates() {
        let (periods, verdict) = found(0.0, LOAD, |_| (20.0, 4.0)).unwrap();
        assert!(periods < 250 && verdict == DriveVerdict::Deviates, "{periods} {verdict:?}");
    }
}
