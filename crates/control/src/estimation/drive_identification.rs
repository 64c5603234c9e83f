//! The servo drive as a first-order lag, identified by recursive least squares.
//!
//! ```text
//! n(k+1) = n(k) + g (u(k) − n(k))
//! ```
//!
//! Source: L. Ljung, *System Identification*, 2nd edition, 1999, section 11.2 (forgetting factor).

use hydroboom_math::{Real, record};

record! {
    /// Settings of the identification.
    pub struct DriveIdentification<T> {
        /// Time constant of forgetting
        #[unit = "s"]
        pub memory: T,
        /// Noise of the motor speed that is read
        #[unit = "rev/s"]
        pub speed_noise: T,
        /// Largest standard deviation of the coefficient, and that at the start
        #[unit = "1"]
        pub largest_deviation: T,
        /// Smallest coefficient
        #[unit = "1"]
        pub smallest: T,
        /// Largest coefficient
        #[unit = "1"]
        pub largest: T,
    }
}

record! {
    /// The identified lag.
    pub struct DriveLag<T> {
        /// Share of the way to its command that the motor's speed goes in a control period, g
        #[unit = "1"]
        pub coefficient: T,
        /// Its variance
        #[unit = "1"]
        pub variance: T,
    }
}

impl<T: Real> DriveLag<T> {
    /// Motor speed \[rev/s\] a period later, commanded `command` \[rev/s\], within a slew rate of `slew` \[rev/s\] a period.
    #[inline(always)]
    pub fn next(&self, speed: T, command: T, slew: T) -> T {
        let next = self.coefficient.mul_add(command - speed, speed);
        next.clamp(speed - slew, speed + slew)
    }

    /// Time constant \[s\] of the lag, τ = −T/ln(1 − g).
    #[inline(always)]
    pub fn time_constant(&self, period: T) -> T {
        -period / (T::one() - self.coefficient).ln()
    }

    /// Time \[s\] by which the motor's speed follows a ramp of its command late, T/g.
    #[inline(always)]
    pub fn ramp_delay(&self, period: T) -> T {
        period / self.coefficient
    }
}

impl<T: Real> DriveIdentification<T> {
    /// A lag that is known to be about `coefficient` \[1\].
    pub fn start(&self, coefficient: T) -> DriveLag<T> {
        let coefficient = coefficient.clamp(self.smallest, self.largest);
        DriveLag { coefficient, variance: self.largest_deviation.square() }
    }

    /// What a motor speed \[rev/s\] tells that is read a period after another, commanded `command` \[rev/s\] between. `is_informative` is false where the motor was at
    /// its torque or slew limit.
    #[inline(always)]
    pub fn update(
        &self,
        lag: &mut DriveLag<T>,
        command: T,
        before: T,
        now: T,
        period: T,
        is_informative: T::Mask,
    ) {
        let one = T::one();
        let input = command - before;
        let forgotten = lag.variance * (one + period / self.memory);
        let gain = forgotten * input / (self.speed_noise.square() + forgotten * input.square());
        let coefficient = gain.mul_add(now - before - lag.coefficient * input, lag.coefficient);
        let variance = (forgotten * (one - gain * input)).min(self.largest_deviation.square());
        lag.coefficient = T::select(
            is_informative,
            coefficient.clamp(self.smallest, self.largest),
            lag.coefficient,
        );
        lag.variance = T::select(is_informative, variance, lag.variance);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_coefficient_of_a_drive_lag_is_identified() {
        let settings = DriveIdentification::<f64> {
            memory: 2.0,
            speed_noise: 0.2,
            largest_deviation: 0.1,
            smallest: 0.005,
            largest: 0.9,
        };
        for coefficient in [0.01, 0.1, 0.5] {
            let mut lag = settings.start(0.15);
            let mut speed = 0.0;
            for k in 0..4000 {
                let command = if (k / 200) % 2 == 0 { 10.0 } else { -5.0 };
                let next = speed + coefficient * (command - speed);
                settings.update(&mut lag, command, speed, next, 1e-3, true);
                speed = next;
            }
            assert!(
                (lag.coefficient / coefficient - 1.0).abs() < 1e-3,
                "{lag:?} for {coefficient}"
            );
            let lag_s = lag.time_constant(1e-3);
            assert!(((-1e-3 / lag_s).exp() - (1.0 - lag.coefficient)).abs() < 1e-12, "{lag_s}");
        }
    }
}
