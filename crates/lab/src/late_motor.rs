//! A motor that is late, and does no more than it can.
//!
//! Its slew is a limit of what turns, behind the lag of its drive, not of what it is told. Told leaps by 13 rev/s in every millisecond, with the noise of what is
//! read, a motor whose slew came first would turn otherwise, and pump up to a hundredth more or less through valves that open one way.

use hydroboom_control::actuator_limits::ActuatorLimits;
use hydroboom_description::Numbers;
use hydroboom_virtual_crane::{Drive, DriveState};
use std::f64::consts::TAU;

/// A motor that turns as it is told, within its limits, so much later: in part a dead time, in part the lag of its drive.
#[derive(Clone)]
pub(crate) struct LateMotor {
    limits: ActuatorLimits<f64>,
    /// Control period \[s\].
    period: f64,
    /// Speeds that it was told, without a drive as far as its limits let it follow \[rev/s\]; at rest for as long as it is late before them.
    followed: Vec<f64>,
    /// Its dead time, in whole control periods and a part of one.
    dead: (usize, f64),
    /// None where all of it is dead time.
    drive: Option<Drive>,
    /// Its speed, and what else that remembers.
    state: DriveState,
}

impl LateMotor {
    /// At rest, as late as `estimator.drive_lag_ms`, of which the drive's bandwidth takes what it can, within the limits of the same crane file.
    pub(crate) fn new(numbers: &Numbers<f64>) -> Self {
        let limits = ActuatorLimits { speed: numbers.motor_speed, slew: numbers.motor_slew };
        let period = numbers.control_period;
        let drive = (numbers.drive_bandwidth > 0.0).then_some(Drive {
            frequency: TAU * numbers.drive_bandwidth,
            damping: numbers.drive_damping,
            // nothing but its slew limits it
            torque: f64::INFINITY,
            inertia: numbers.drive_inertia,
            limits,
        });
        let by_drive = drive.map_or(0.0, |drive| 2.0 * drive.damping / drive.frequency);
        let (followed, dead, state) = (Vec::new(), (0, 0.0), DriveState::default());
        let prompt = Self { limits, period, followed, dead, drive, state };
        prompt.with_dead_time((numbers.tuning.estimator_drive_lag - by_drive).max(0.0))
    }

    fn with_dead_time(mut self, time: f64) -> Self {
        let periods = time / self.period;
        self.dead = (periods as usize, periods.fract());
        self.followed = vec![0.0; self.dead.0 + 2];
        self
    }

    /// The same, from now on without dead time.
    pub(crate) fn without_dead_time(self) -> Self {
        Self { dead: (0, 0.0), ..self }
    }

    /// Its dead time \[s\].
    pub(crate) fn dead_time(&self) -> f64 {
        (self.dead.0 as f64 + self.dead.1) * self.period
    }

    /// Its control period \[s\].
    pub(crate) fn period(&self) -> f64 {
        self.period
    }

    /// The fastest it turns \[rev/s\].
    pub(crate) fn fastest(&self) -> f64 {
        self.limits.speed
    }

    /// What has reached its drive by now \[rev/s\].
    fn asked(&self) -> f64 {
        let (whole, part) = self.dead;
        let last = self.followed.len() - 1 - whole;
        let [after, before] = [self.followed[last], self.followed[last - 1]];
        after + part * (before - after)
    }

    /// Its speed by now \[rev/s\].
    pub(crate) fn speed(&self) -> f64 {
        if self.drive.is_some() { self.state.speed } else { self.asked() }
    }

    /// Its mean speed \[rev/s\] in the period for which it is told this one.
    pub(crate) fn told(&mut self, speed: f64) -> f64 {
        let Some(drive) = self.drive else {
            let last = self.followed.last().copied().unwrap_or(0.0);
            self.followed.push(self.limits.follow(last, speed, self.period));
            return self.asked();
        };
        self.followed.push(speed);
        let wanted = self.asked();
        drive.advance(&mut self.state, wanted, 0.0, self.period)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_description::Description;
    use std::f64::consts::PI;

    fn motor(late_periods: f64) -> LateMotor {
        let mut numbers = Description::uia_single_boom().unwrap().numbers;
        numbers.tuning.estimator_drive_lag = late_periods * numbers.control_period;
        LateMotor::new(&numbers)
    }

    #[test]
    fn it_turns_as_late_as_it_is_said_to_be() {
        let mut motor = motor(2.25);
        // as slowly as it can follow
        let speed = |k: u32| 0.1 * f64::from(k);
        for k in 0..10 {
            let (turned, expected) = (motor.told(speed(k)), (f64::from(k) - 2.25).max(0.0));
            assert!((turned - 0.1 * expected).abs() < 1e-12, "period {k}: {turned}");
        }
        // told 9 tenths last: what it turns at without dead time
        assert!((motor.dead_time() / motor.period() - 2.25).abs() < 1e-12);
        assert!((motor.without_dead_time().speed() - 0.9).abs() < 1e-12);
    }

    /// By the area between what it is told and what it turns, where its slew does not count.
    #[test]
    fn a_lag_takes_its_part_of_what_it_is_late() {
        let mut numbers = Description::uia_single_boom().unwrap().numbers;
        let step = 1e-3 * numbers.motor_slew * numbers.control_period;
        for (late, bandwidth) in [(8e-3, 60.0), (20e-3, 15.0)] {
            (numbers.tuning.estimator_drive_lag, numbers.drive_bandwidth) = (late, bandwidth);
            let mut motor = LateMotor::new(&numbers);
            let turned: Vec<f64> = (0..400).map(|_| motor.told(step)).collect();
            let missed: f64 = turned.iter().map(|turned| 1.0 - turned / step).sum();
            let missed = missed * numbers.control_period;
            assert!((missed / late - 1.0).abs() < 1e-2, "{missed} s for {late} s");
            // it swings once beyond what it is told, as a lag of second order does
            let damping = numbers.drive_damping;
            let beyond = (-PI * damping / (1.0 - damping * damping).sqrt()).exp();
            let most = turned.iter().fold(0.0, |most, turned| f64::max(most, turned / step - 1.0));
            assert!((most - beyond).abs() < 2e-3, "{most} for {beyond}");
            assert!((motor.speed() / step - 1.0).abs() < 1e-9);
            // of which nothing shows in the dead time
            let lag = 2.0 * damping / (TAU * bandwidth);
            let dead = ((late - lag) / numbers.control_period) as usize;
            assert!(turned[..dead].iter().all(|t| *t == 0.0) && turned[dead + 1] > 0.0);
        }
    }

    #[test]
    fn it_leaps_no_faster_and_turns_no_faster_than_it_can() {
        let mut motor = motor(0.0);
        let (leap, fastest) = (motor.limits.slew * motor.period, motor.fastest());
        let turned: Vec<f64> = (0..1000).map(|_| motor.told(10.0 * fastest)).collect();
        let fastest_leap = turned.windows(2).map(|w| w[1] - w[0]).fold(turned[0], f64::max);
        assert!((fastest_leap / leap - 1.0).abs() < 1e-9 && turned[999] == fastest);
        assert!((motor.told(0.0) - (fastest - leap)).abs() < 1e-9);
    }
}
