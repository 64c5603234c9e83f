//! Drive monitor: measured motor speed against the envelope of its commands.
//!
//! A slow drive may still be anywhere between the speeds it has been commanded; that envelope closes as the
//! slowest drive does, within its limits of slew and torque:
//!
//! ```text
//! |n'| ≤ slew,   |2π J n' + D Δp/(2π)| ≤ T_max
//! ```

use core::f64::consts::TAU;
use hydroboom_math::{Real, record};

record! {
    /// Settings of the drive monitor.
    pub struct DriveMonitor<T> {
        /// Time constant of the slowest speed loop, including the fieldbus
        #[unit = "s"]
        pub response: T,
        /// Slew limit of the drive
        #[unit = "rev/s²"]
        pub slew: T,
        /// Smallest value of the motor's largest torque, T_max
        #[unit = "N·m"]
        pub torque: T,
        /// Moment of inertia of motor and pump, J
        #[unit = "kg·m²"]
        pub inertia: T,
        /// Displacement of the pump, D
        #[unit = "m³/rev"]
        pub displacement: T,
        /// Deviation of the motor speed from the envelope above which it counts as not following
        #[unit = "rev/s"]
        pub deviation: T,
        /// Duration of such a deviation until it is a fault
        #[unit = "s"]
        pub deviation_time: T,
        /// Motor speed against or beyond the command above which it counts as uncommanded
        #[unit = "rev/s"]
        pub uncommanded: T,
        /// Overshoot allowed in addition, as a share of the commanded speed, under an overhauling load
        #[unit = "1"]
        pub overshoot: T,
        /// Duration of an uncommanded speed until it is a fault
        #[unit = "s"]
        pub uncommanded_time: T,
    }
}

record! {
    /// State of the drive monitor: envelope of motor speeds, and durations.
    pub struct DriveMonitorState<T> {
        /// Upper end of the envelope: largest speed of the slowest drive
        #[unit = "rev/s"]
        pub high: T,
        /// Lower end of the envelope: smallest speed of the slowest drive
        #[unit = "rev/s"]
        pub low: T,
        /// Duration of the present deviation
        #[unit = "s"]
        pub deviating: T,
        /// Duration of the present uncommanded speed
        #[unit = "s"]
        pub uncommanded: T,
    }
}

/// Result of the drive monitor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriveVerdict<M> {
    /// The motor turns although commanded to stand still, or against its command.
    pub uncommanded: M,
    /// The motor turns slower or faster than its commands explain.
    pub deviates: M,
}

impl<T: Real> DriveMonitorState<T> {
    /// Measured motor speed `read` \[rev/s\], clamped to the envelope of the commands, extended to zero. NaN stays
    /// NaN.
    #[inline(always)]
    pub fn plausible(&self, read: T) -> T {
        read.clamp(self.low.min(T::zero()), self.high.max(T::zero()))
    }
}

impl<T: Real> DriveMonitor<T> {
    /// Compares the measured motor speed `read` \[rev/s\] with the envelope of the commands.
    ///
    /// `commanded` is the speed commanded in the last period \[rev/s\], `pressure` the pump's pressure difference
    /// p_PA − p_PB \[Pa\], and `elapsed` the time since the last call \[s\]. A pressure that is not finite counts as
    /// zero. A NaN `read` is no deviation, and restarts the time for which one has to last.
    #[inline(always)]
    pub fn judge(
        &self,
        state: &mut DriveMonitorState<T>,
        commanded: T,
        read: T,
        pressure: T,
        elapsed: T,
    ) -> DriveVerdict<T::Mask> {
        let zero = T::zero();
        // the envelope opens to a command at once
        let decay = (elapsed / self.response).min(T::one());
        let load = self.displacement * pressure / T::lit(TAU);
        // a pressure that is no number says nothing of the load
        let load = T::select(load.is_finite(), load, zero);
        let by = |torque: T| {
            let slew = (torque / (T::lit(TAU) * self.inertia)).min(self.slew);
            slew.max(zero) * elapsed
        };
        let (falls, rises) = (by(self.torque + load), by(self.torque - load));
        state.high = commanded.max(state.high - ((state.high - commanded) * decay).min(falls));
        state.low = commanded.min(state.low + ((commanded - state.low) * decay).min(rises));
        let beyond = (read - state.high).max(state.low - read);
        let uncommanded = (read - state.high.max(zero)).max(state.low.min(zero) - read);
        let allowed = self.uncommanded + self.overshoot * state.high.max(-state.low).max(zero);
        let lasts = |time: T, is: T::Mask| T::select(is, time + elapsed, zero);
        state.deviating = lasts(state.deviating, self.deviation.lt(beyond));
        state.uncommanded = lasts(state.uncommanded, allowed.lt(uncommanded));
        DriveVerdict {
            uncommanded: self.uncommanded_time.lt(state.uncommanded),
            deviates: self.deviation_time.lt(state.deviating),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MONITOR: DriveMonitor<f64> = DriveMonitor {
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

    /// Periods of 1 ms, after a speed commanded for long, until it does not follow.
    fn found(
        before: f64,
        pressure: f64,
        speeds: impl Fn(f64) -> (f64, f64),
    ) -> Option<(u32, DriveVerdict<bool>)> {
        let mut state = DriveMonitorState { high: before, low: before, ..Default::default() };
        (0..2000).find_map(|k| {
            let (commanded, read) = speeds(f64::from(k) * 1e-3);
            let verdict = MONITOR.judge(&mut state, commanded, read, pressure, 1e-3);
            (verdict.uncommanded || verdict.deviates).then_some((k, verdict))
        })
    }

    #[test]
    fn a_drive_with_the_described_lag_is_not_reported() {
        let lag = |t: f64, from: f64, to: f64| to + (from - to) * (-t / 0.03).exp();
        // a step, and a step back to zero
        assert_eq!(found(0.0, LOAD, |t| (20.0, lag(t, 0.0, 20.0))), None);
        let back = |t: f64| {
            if t < 0.5 { (20.0, lag(t, 0.0, 20.0)) } else { (0.0, lag(t - 0.5, 20.0, 0.0)) }
        };
        assert_eq!(found(0.0, LOAD, back), None);
    }

    #[test]
    fn a_drive_at_its_slew_or_torque_limit_is_not_reported() {
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
    fn uncommanded_or_reversed_rotation_is_detected_within_20_ms() {
        for speeds in [|_: f64| (0.0, 5.0), |_: f64| (10.0, -10.0), |_: f64| (-10.0, 4.0)] {
            let (periods, verdict) = found(0.0, LOAD, speeds).unwrap();
            assert!(periods < 20 && verdict.uncommanded, "{periods} {verdict:?}");
        }
    }

    #[test]
    fn a_drive_that_does_not_reach_its_command_is_detected() {
        let (periods, verdict) = found(0.0, LOAD, |_| (20.0, 4.0)).unwrap();
        assert!(periods < 250 && !verdict.uncommanded, "{periods} {verdict:?}");
    }
}
