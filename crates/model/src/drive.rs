//! Servo drive: dead time, and a second-order lag within the limits of its motor.

use hydroboom_math::Real;

/// Servo drive: speed control loop and motor as a second-order lag with limited speed, acceleration and torque.
///
/// ```text
/// n'' = ω² (n_ref(t − d) − n) − 2ζω n',   |n| ≤ n_max,   |n'| ≤ slew,   |2π J n' + T_load| ≤ T_max
/// ```
///
/// The dead time d is a [`DeadTime`] of its own: a command arrives once a control period, steps of the lag are
/// shorter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive<T> {
    /// Undamped natural angular frequency ω of the speed loop \[rad/s\].
    pub frequency: T,
    /// Damping ratio ζ of the speed loop \[1\].
    pub damping: T,
    /// Largest motor torque in either direction, T_max \[N·m\].
    pub torque: T,
    /// Moment of inertia of motor and pump, J \[kg·m²\].
    pub inertia: T,
    /// Largest speed in either direction, n_max \[rev/s\].
    pub largest_speed: T,
    /// Largest acceleration in either direction, slew \[rev/s²\].
    pub slew: T,
}

/// Angle \[rad\] of the lag's own oscillation in one part of a step.
const FINEST: f64 = 0.01;

/// Largest number of substeps that [`parts`] returns for a step.
pub const MOST_PARTS: u32 = 20;

/// State of a [`Drive`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveState<T> {
    /// Motor speed n \[rev/s\].
    pub speed: T,
    /// Motor acceleration n' \[rev/s²\].
    pub acceleration: T,
}

impl<T: Real> DriveState<T> {
    /// State at a constant speed \[rev/s\], with zero acceleration.
    pub fn steady(speed: T) -> Self {
        Self { speed, acceleration: T::zero() }
    }
}

/// Number of substeps, 1 to [`MOST_PARTS`], of a step \[s\] of a lag with an angular frequency \[rad/s\].
///
/// A substep is 0.01 rad of the lag at most, unless that needs more of them; its first-order error is then negligible.
/// A frequency or step that is NaN gives 0, which [`Drive::advance`] does not accept.
pub fn parts(frequency: f64, step: f64) -> u32 {
    Real::clamp(libm::ceil(frequency * step / FINEST), 1.0, f64::from(MOST_PARTS)) as u32
}

impl<T: Real> Drive<T> {
    /// Integrates the drive over `step` \[s\] in `parts` substeps; returns the mean speed \[rev/s\].
    ///
    /// `wanted` is the commanded speed \[rev/s\]. `load` is the load torque \[N·m\], positive where it brakes
    /// positive speed. `after` is called after each substep with the state and the substep's length \[s\]. A load
    /// torque beyond the largest motor torque accelerates the motor against its command. `parts` must be at least 1:
    /// with 0 the mean speed is NaN.
    #[inline(always)]
    pub fn advance(
        &self,
        state: &mut DriveState<T>,
        wanted: T,
        load: T,
        step: T,
        parts: u32,
        mut after: impl FnMut(&DriveState<T>, T),
    ) -> T {
        let count = T::lit(f64::from(parts));
        let part = step / count;
        let mut sum = T::zero();
        for _ in 0..parts {
            let before = state.speed;
            self.part(state, wanted, load, part);
            after(state, part);
            sum = sum + T::lit(0.5) * (before + state.speed);
        }
        sum / count
    }

    #[inline(always)]
    fn part(&self, state: &mut DriveState<T>, wanted: T, load: T, h: T) {
        let wanted = wanted.clamp(-self.largest_speed, self.largest_speed);
        let w = self.frequency;
        // linearly implicit, so that no bandwidth is too high for the step
        let asked = (state.acceleration + h * w * w * (wanted - state.speed))
            / (T::one() + h * w * (T::lit(2.0) * self.damping + h * w));
        let per_torque = T::one() / (T::lit(core::f64::consts::TAU) * self.inertia);
        let low = (-self.slew).max((-self.torque - load) * per_torque);
        let high = self.slew.min((self.torque - load) * per_torque);
        // an overhauling load may leave no choice: then the motor gives way
        state.acceleration = asked.min(high).max(low.min(high));
        let speed = state.speed + h * state.acceleration;
        state.speed = speed.clamp(-self.largest_speed, self.largest_speed);
    }
}

/// Dead time of commands that are constant over a control period: whole periods and a fraction, interpolated linearly
/// between two commands.
///
/// The derivative by the dead time is the slope of that line, exactly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeadTime<T> {
    whole: usize,
    part: T,
}

impl<T: Real> DeadTime<T> {
    /// Dead time `time` \[s\], not negative, that contains `whole` whole periods of `period` \[s\]. For plain numbers
    /// see [`of`](DeadTime::of).
    pub fn over(time: T, period: T, whole: usize) -> Self {
        Self { whole, part: time / period - T::lit(whole as f64) }
    }

    /// Age of the oldest command that [`arrived`](Self::arrived) reads, in control periods.
    pub fn reach(&self) -> usize {
        self.whole + 1
    }

    /// Delayed command, in the unit of the commands. `ago(k)` is the command of `k` control periods ago; `ago(0)` is
    /// the newest.
    #[inline(always)]
    pub fn arrived(&self, ago: impl Fn(usize) -> T) -> T {
        let [after, before] = [ago(self.whole), ago(self.whole + 1)];
        after + self.part * (before - after)
    }
}

impl DeadTime<f64> {
    /// Dead time `time` \[s\] at a control period of `period` \[s\], which must be positive. A time that is negative
    /// or NaN counts as zero.
    pub fn of(time: f64, period: f64) -> Self {
        let time = time.max(0.0);
        Self::over(time, period, (time / period) as usize)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use hydroboom_math::Dual;
    use std::vec::Vec;

    const DRIVE: Drive<f64> = Drive {
        frequency: 200.0,
        damping: 0.7,
        torque: 30.0,
        inertia: 0.01,
        largest_speed: 50.0,
        slew: 500.0,
    };

    fn advance(drive: &Drive<f64>, state: &mut DriveState<f64>, wanted: f64, load: f64, step: f64) {
        drive.advance(state, wanted, load, step, parts(drive.frequency, step), |_, _| {});
    }

    #[test]
    fn a_small_step_is_answered_as_by_the_linear_lag() {
        let mut state = DriveState::steady(0.0);
        let (step, wanted) = (1e-5, 1e-3);
        let damped = 200.0 * f64::sqrt(1.0 - 0.49);
        for k in 1..=4000 {
            advance(&DRIVE, &mut state, wanted, 0.0, step);
            let t = f64::from(k) * step;
            let ring = (damped * t).cos() + 0.7 * 200.0 / damped * (damped * t).sin();
            let exact = wanted * (1.0 - (-0.7 * 200.0 * t).exp() * ring);
            assert!((state.speed - exact).abs() < 3e-3 * wanted, "{} {exact}", state.speed);
        }
    }

    #[test]
    fn slew_and_speed_are_respected() {
        let mut state = DriveState::steady(0.0);
        for _ in 0..4000 {
            let before = state.speed;
            advance(&DRIVE, &mut state, 80.0, 0.0, 1e-4);
            assert!(state.speed - before <= 500.0 * 1e-4 * (1.0 + 1e-9));
            assert!(state.speed <= 50.0);
        }
        assert!((state.speed - 50.0).abs() < 1e-6);
    }

    #[test]
    fn a_load_beyond_the_torque_stalls_and_overhauls_the_motor() {
        let mut state = DriveState::steady(0.0);
        advance(&DRIVE, &mut state, 10.0, 35.0, 1e-3);
        // 5 N·m too much on 0.01 kg·m²
        let expected = -5.0 / (core::f64::consts::TAU * 0.01);
        assert!((state.acceleration - expected).abs() < 1e-9, "{}", state.acceleration);
    }

    #[test]
    fn a_ramp_arrives_later_by_the_dead_time() {
        for time in [0.0, 0.4e-3, 2.25e-3, 7e-3] {
            let dead = DeadTime::of(time, 1e-3);
            for now in 10..20 {
                let arrived = dead.arrived(|ago| 3.0 * (f64::from(now) - ago as f64) * 1e-3);
                assert!((arrived - 3.0 * (f64::from(now) * 1e-3 - time)).abs() < 1e-12);
            }
        }
    }

    /// Speeds of a drive under commands that leap, some of them beyond the slew.
    fn speeds<T: Real>(frequency: T, damping: T, dead: DeadTime<T>) -> Vec<T> {
        let drive = Drive {
            frequency,
            damping,
            torque: T::lit(f64::INFINITY),
            inertia: T::one(),
            largest_speed: T::lit(50.0),
            slew: T::lit(500.0),
        };
        let command =
            |k: i64| T::lit(if k < 0 { 0.0 } else { 9.0 * (1e-3 * (k * k) as f64).sin() });
        let mut state = DriveState::steady(T::zero());
        let of = |k: i64| {
            let wanted = dead.arrived(|ago| command(k - ago as i64));
            drive.advance(&mut state, wanted, T::zero(), T::lit(1e-3), MOST_PARTS, |_, _| {});
            state.speed
        };
        (0..400).map(of).collect()
    }

    #[test]
    fn slopes_by_dead_time_frequency_and_damping_match_differences() {
        type D = Dual<f64, 3>;
        let (frequency, damping, time) = (110.0, 0.8, 2.3e-3);
        let dead = DeadTime::over(D::variable(time, 2), D::constant(1e-3), 2);
        let found = speeds(D::variable(frequency, 0), D::variable(damping, 1), dead);
        let at = |moved: [f64; 3]| speeds(moved[0], moved[1], DeadTime::of(moved[2], 1e-3));
        for (k, little) in [1e-3, 1e-5, 1e-8].into_iter().enumerate() {
            let [more, less] = [little, -little].map(|by| {
                let mut moved = [frequency, damping, time];
                moved[k] += by;
                at(moved)
            });
            let slopes: Vec<f64> =
                more.iter().zip(&less).map(|(a, b)| (a - b) / (2.0 * little)).collect();
            let largest = slopes.iter().fold(0.0, |most, slope| f64::max(most, slope.abs()));
            for (slope, found) in slopes.iter().zip(&found) {
                let apart = (slope - found.slope[k]).abs();
                assert!(apart < 1e-4 * largest, "{slope} for {} along {k}", found.slope[k]);
            }
        }
    }
}
