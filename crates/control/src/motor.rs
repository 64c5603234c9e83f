//! What the servo motor can do.

use hydroboom_math::Real;

/// Limits of the motor's speed and acceleration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorLimits<T> {
    /// Largest speed in either direction \[rev/s\].
    pub speed: T,
    /// Largest change of speed \[rev/s²\].
    pub slew: T,
}

impl<T: Real> MotorLimits<T> {
    /// The speed \[rev/s\] the motor reaches after `period` \[s\] when `wanted` is asked of it at
    /// the speed `now`.
    #[inline(always)]
    pub fn follow(&self, now: T, wanted: T, period: T) -> T {
        let reach = self.slew * period;
        let wanted = wanted.clamp(-self.speed, self.speed);
        wanted.clamp(now - reach, now + reach)
    }
}
