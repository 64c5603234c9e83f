//! A motor that is late, and does no more than it can.

use hydroboom_control::{Command, MotorLimits, Reading};
use hydroboom_description::Numbers;
use std::f64::consts::TAU;

/// In so many parts the lateness of a motor is shared between lag and dead time.
const PARTS: u32 = 20;

/// A motor that turns as it is told, within its limits, so much later: in part a dead time, in part the lag of its drive.
#[derive(Clone)]
pub(crate) struct LateMotor {
    limits: MotorLimits<f64>,
    /// Control period \[s\].
    period: f64,
    /// Speeds that it was told, as far as its limits let it follow \[rev/s\]; at rest for as long as it is late before them.
    followed: Vec<f64>,
    /// Its dead time, in whole control periods and a part of one.
    dead: (usize, f64),
    /// Time constant \[s\] of each of two lags in a row, a drive without overshoot; 0 for none. Told with the noise of what is read, a motor without a lag would
    /// swing more, and pump more through valves that open one way.
    lag: f64,
    /// Speeds behind each of them \[rev/s\].
    lagging: [f64; 2],
}

impl LateMotor {
    /// At rest, as late as `following.lead_ms`, of which the drive's bandwidth takes what it can, within the limits of the same crane file.
    pub(crate) fn new(numbers: &Numbers<f64>) -> Self {
        let limits = MotorLimits { speed: numbers.motor_speed, slew: numbers.motor_slew };
        let period = numbers.control_period;
        let by_drive = match numbers.drive_bandwidth > 0.0 {
            true => 2.0 * numbers.drive_damping / (TAU * numbers.drive_bandwidth),
            false => 0.0,
        };
        let (followed, dead, lagging) = (Vec::new(), (0, 0.0), [0.0; 2]);
        let prompt = Self { limits, period, followed, dead, lag: 0.0, lagging };
        let dead = prompt.late_by((numbers.following_lead - by_drive).max(0.0));
        Self { lag: 0.5 * by_drive, ..dead }
    }

    /// Bandwidth of the drive \[Hz\] with which one as late as `following.lead_ms` comes nearest to the speeds that were read; 0 for a dead time alone.
    pub(crate) fn bandwidth(
        numbers: &Numbers<f64>,
        told: &[Command<f64>],
        read: &[Reading<f64>],
    ) -> f64 {
        let of = |part: u32| {
            let lag = f64::from(part) / f64::from(PARTS) * numbers.following_lead;
            let bandwidth = if lag > 0.0 { 2.0 * numbers.drive_damping / (TAU * lag) } else { 0.0 };
            let mut motor = Self::new(&Numbers { drive_bandwidth: bandwidth, ..*numbers });
            let off = |(told, read): (&Command<f64>, &Reading<f64>)| {
                let off = motor.speed() - read.motor_speed;
                motor.told(told.motor_speed);
                off * off
            };
            (told.iter().zip(read).map(off).sum::<f64>(), bandwidth)
        };
        let nearest = (0..=PARTS).map(of).min_by(|one, other| one.0.total_cmp(&other.0));
        nearest.map_or(0.0, |(_, bandwidth)| bandwidth)
    }

    /// The same, from now on late by a dead time of so much \[s\], and no lag.
    pub(crate) fn late_by(mut self, late: f64) -> Self {
        let late = late / self.period;
        self.dead = (late as usize, late.fract());
        self.lag = 0.0;
        let missing = (self.dead.0 + 2).saturating_sub(self.followed.len());
        self.followed.splice(0..0, std::iter::repeat_n(0.0, missing));
        self
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
        if self.lag > 0.0 { self.lagging[1] } else { self.asked() }
    }

    /// Its mean speed \[rev/s\] in the period for which it is told this one.
    pub(crate) fn told(&mut self, speed: f64) -> f64 {
        let last = self.followed.last().copied().unwrap_or(0.0);
        self.followed.push(self.limits.follow(last, speed, self.period));
        if self.lag == 0.0 {
            return self.asked();
        }
        let share = -(-self.period / self.lag).exp_m1();
        let [first, second] = self.lagging;
        let next = first + share * (self.asked() - first);
        let after = second + share * (0.5 * (first + next) - second);
        self.lagging = [next, after];
        0.5 * (second + after)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_description::Description;

    fn motor(late_periods: f64) -> LateMotor {
        let mut numbers = Description::uia_single_boom().unwrap().numbers;
        numbers.following_lead = late_periods * numbers.control_period;
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
        // told 9 tenths last: what it turns at is what it was told then, whether that was by a later motor or not
        let period = motor.period();
        let later = motor.late_by(4.0 * period);
        assert!((later.speed() - 0.5).abs() < 1e-12);
        let prompt = later.late_by(0.5 * period);
        assert!((prompt.speed() - 0.85).abs() < 1e-12);
    }

    /// By the area between what it is told and what it turns.
    #[test]
    fn a_lag_takes_its_part_of_what_it_is_late() {
        let mut numbers = Description::uia_single_boom().unwrap().numbers;
        let step = numbers.motor_slew * numbers.control_period;
        for (late, bandwidth) in [(8e-3, 60.0), (20e-3, 15.0)] {
            (numbers.following_lead, numbers.drive_bandwidth) = (late, bandwidth);
            let mut motor = LateMotor::new(&numbers);
            let turned: Vec<f64> = (0..400).map(|_| motor.told(step)).collect();
            let missed: f64 = turned.iter().map(|turned| 1.0 - turned / step).sum();
            let missed = missed * numbers.control_period;
            assert!((missed / late - 1.0).abs() < 1e-2, "{missed} s for {late} s");
            assert!((motor.speed() - step).abs() < 1e-9 && turned.iter().all(|t| *t <= step));
            // of which nothing shows in the dead time
            let lag = 2.0 * numbers.drive_damping / (TAU * bandwidth);
            let dead = ((late - lag) / numbers.control_period) as usize;
            assert!(turned[..dead].iter().all(|t| *t == 0.0) && turned[dead + 1] > 0.0);
        }
    }

    #[test]
    fn what_is_read_of_a_motor_tells_its_bandwidth() {
        let mut numbers = Description::uia_single_boom().unwrap().numbers;
        let told: Vec<_> = (0..2000)
            .map(|k| {
                let motor_speed = 10.0 * f64::sin(1e-4 * f64::from(k * k % 9001));
                Command { motor_speed, holding_valve: 1.0 }
            })
            .collect();
        // all lag, half of it, and none
        for share in [1.0, 0.5, 0.0] {
            numbers.following_lead = 9e-3;
            let lag = share * numbers.following_lead;
            let bandwidth =
                if share > 0.0 { 2.0 * numbers.drive_damping / (TAU * lag) } else { 0.0 };
            let mut motor = LateMotor::new(&Numbers { drive_bandwidth: bandwidth, ..numbers });
            let reading = |told: &Command<f64>| {
                let motor_speed = motor.speed();
                motor.told(told.motor_speed);
                Reading { motor_speed, ..Reading::default() }
            };
            let read: Vec<_> = told.iter().map(reading).collect();
            let found = LateMotor::bandwidth(&numbers, &told, &read);
            assert!((found - bandwidth).abs() <= 1e-9 * bandwidth, "{found} Hz for {bandwidth} Hz");
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
