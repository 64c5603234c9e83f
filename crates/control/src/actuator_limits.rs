//! Limits of the servo motor: speed and slew rate.

use hydroboom_math::Real;

/// Limits of the servo motor's speed and acceleration, both positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActuatorLimits<T> {
    /// Largest speed in either direction \[rev/s\].
    pub speed: T,
    /// Largest acceleration in either direction \[rev/s²\].
    pub slew: T,
}

impl<T: Real> ActuatorLimits<T> {
    /// Motor speed \[rev/s\] after `period` \[s\] if `wanted` \[rev/s\] is commanded at the speed `now` \[rev/s\].
    ///
    /// `wanted` is clamped to ± `speed`, then to `now` ± `slew · period`: from beyond the speed limit the motor
    /// returns at the slew rate. A NaN `wanted` gives NaN.
    #[inline(always)]
    pub fn follow(&self, now: T, wanted: T, period: T) -> T {
        let reach = self.slew * period;
        let wanted = wanted.clamp(-self.speed, self.speed);
        wanted.clamp(now - reach, now + reach)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_in_speed_is_followed_at_the_slew_up_to_the_limit() {
        let limits = ActuatorLimits { speed: 50.0, slew: 500.0 };
        let (mut speed, mut periods) = (0.0, 0);
        while speed < 50.0 {
            let next: f64 = limits.follow(speed, 80.0, 1e-3);
            assert!((next - speed - 0.5).abs() < 1e-12, "{speed} to {next}");
            (speed, periods) = (next, periods + 1);
        }
        assert_eq!((speed, periods), (50.0, 100));
        assert_eq!(limits.follow(speed, 80.0, 1e-3), 50.0);
        assert_eq!(limits.follow(speed, -80.0, 1e-3), 49.5);
    }
}
