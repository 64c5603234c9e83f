//! The servo drive as a first-order lag, identified by recursive least squares.
//!
//! ```text
//! n(k+1) = n(k) + g (u(k) − n(k))
//! ```
//!
//! Source: L. Ljung, *System Identification*, 2nd edition, 1999, section 11.2 (forgetting factor).

use hydroboom_math::{Real, record};

record! {
    /// Settings of the recursive least-squares identification of the drive.
    pub struct DriveIdentification<T> {
        /// Time constant of exponential forgetting
        #[unit = "s"]
        pub memory: T,
        /// Standard deviation of the noise of the measured motor speed
        #[unit = "rev/s"]
        pub speed_noise: T,
        /// Largest standard deviation of the lag's coefficient g, and its standard deviation at the start
        #[unit = "1"]
        pub largest_deviation: T,
        /// Smallest lag coefficient g
        #[unit = "1"]
        pub smallest: T,
        /// Largest lag coefficient g
        #[unit = "1"]
        pub largest: T,
    }
}

record! {
    /// Identified first-order lag of the drive.
    pub struct DriveLag<T> {
        /// Lag coefficient g: share of the difference between command and motor speed that is made up in a control
        /// period
        #[unit = "1"]
        pub coefficient: T,
        /// Variance of the lag coefficient g
        #[unit = "1"]
        pub variance: T,
    }
}

impl<T: Real> DriveLag<T> {
    /// Motor speed n + g (u − n) \[rev/s\] one control period later, from the `speed` n and the `command` u
    /// \[rev/s\]. It changes by at most `slew` \[rev/s\] in the period.
    #[inline(always)]
    pub fn next(&self, speed: T, command: T, slew: T) -> T {
        let next = self.coefficient.mul_add(command - speed, speed);
        next.clamp(speed - slew, speed + slew)
    }

    /// Time constant of the lag, τ = −T/ln(1 − g) \[s\], for a control period T \[s\] and 0 < g < 1; NaN from g = 1
    /// on.
    #[inline(always)]
    pub fn time_constant(&self, period: T) -> T {
        -period / (T::one() - self.coefficient).ln()
    }

    /// Delay of the motor speed behind a ramp of its command, T/g \[s\], for a control period T \[s\] and g > 0.
    #[inline(always)]
    pub fn ramp_delay(&self, period: T) -> T {
        period / self.coefficient
    }
}

impl<T: Real> DriveIdentification<T> {
    /// Lag with the prior coefficient g \[1\], clamped to the allowed range, with the largest standard deviation.
    pub fn start(&self, coefficient: T) -> DriveLag<T> {
        let coefficient = coefficient.clamp(self.smallest, self.largest);
        DriveLag { coefficient, variance: self.largest_deviation.square() }
    }

    /// Updates the lag from two consecutive measured motor speeds `before` and `now` \[rev/s\], with `command`
    /// \[rev/s\] in effect between them.
    ///
    /// ```text
    /// φ = u − n(k),   P ← (1 + T/τ) P,   K = P φ/(σ² + P φ²)
    /// g ← g + K (n(k+1) − n(k) − g φ),   P ← P (1 − K φ)
    /// ```
    ///
    /// T is the control `period` \[s\], τ the memory and σ the speed noise. Coefficient g and variance P are limited
    /// as set. The lag stays unchanged where `is_informative` is false, as at the motor's torque or slew limit;
    /// elsewhere a NaN speed or command gives a NaN lag.
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
