//! Servo drive with dead time: second-order lag behind a delay, within the motor's limits of speed and slew.
//!
//! The slew rate limits the shaft, behind the lag, and not the command: a command with the noise of a measured signal may leap by 13 rev/s from period to
//! period, which the lag smooths before the slew is reached.

use hydroboom_control::actuator_limits::ActuatorLimits;
use hydroboom_description::schema::KEYS;
use hydroboom_description::{Description, Numbers};
use hydroboom_design::scheduled_lqr::known_delay;
use hydroboom_virtual_crane::{Drive, DriveState};
use std::f64::consts::TAU;

/// Motor speed behind a dead time and a second-order lag, within its limits.
#[derive(Clone)]
pub(crate) struct DelayedDrive {
    limits: ActuatorLimits<f64>,
    /// Control period \[s\].
    period: f64,
    /// Commanded speeds \[rev/s\], within the limits where there is no lag; zeros for the dead time before them.
    followed: Vec<f64>,
    /// Its dead time, in whole control periods and a part of one.
    dead: (usize, f64),
    /// The lag; none where all of the delay is dead time.
    drive: Option<Drive>,
    /// State of the lag.
    state: DriveState,
}

impl DelayedDrive {
    /// At rest. The total delay is `estimator.drive_lag_ms` (here with the fieldbus, see [`with_fieldbus`]): the lag's share is 2ζ/ω of the drive's bandwidth and damping, the rest is dead time.
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

    /// The same without dead time from now on.
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

    /// The command after the dead time \[rev/s\].
    fn delayed_command(&self) -> f64 {
        let (whole, part) = self.dead;
        let last = self.followed.len() - 1 - whole;
        let [after, before] = [self.followed[last], self.followed[last - 1]];
        after + part * (before - after)
    }

    /// Its speed now \[rev/s\].
    pub(crate) fn speed(&self) -> f64 {
        if self.drive.is_some() { self.state.speed } else { self.delayed_command() }
    }

    /// Mean speed \[rev/s\] in a control period with this command.
    pub(crate) fn advance(&mut self, speed: f64) -> f64 {
        let Some(drive) = self.drive else {
            let last = self.followed.last().copied().unwrap_or(0.0);
            self.followed.push(self.limits.follow(last, speed, self.period));
            return self.delayed_command();
        };
        self.followed.push(speed);
        let wanted = self.delayed_command();
        drive.advance(&mut self.state, wanted, 0.0, self.period)
    }
}

/// Known delay of the fieldbus, commands and readings together \[s\].
fn fieldbus_delay(model: &Description) -> f64 {
    2.0 * f64::from(known_delay(model)) * model.numbers.control_period
}

/// A model whose drive lag is the total delay from command to reading, the fieldbus included, as all in this folder has it.
pub(crate) fn with_fieldbus(model: &Description) -> Description {
    let mut total = model.clone();
    total.numbers.tuning.estimator_drive_lag += fieldbus_delay(model);
    total
}

/// The model with the lag of the drive alone, within what a crane file may state.
pub(crate) fn without_fieldbus(total: &Description) -> Description {
    let mut model = total.clone();
    let lag = &mut model.numbers.tuning.estimator_drive_lag;
    let key = KEYS.iter().find(|key| key.path() == DRIVE_LAG);
    let (low, high) =
        key.map_or((0.0, f64::INFINITY), |key| (key.to_si(key.low), key.to_si(key.high)));
    *lag = (*lag - fieldbus_delay(total)).max(low).min(high);
    model
}

/// Key of the drive's lag.
const DRIVE_LAG: &str = "estimator.drive_lag_ms";

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn motor(late_periods: f64) -> DelayedDrive {
        let mut numbers = Description::uia_single_boom().unwrap().numbers;
        numbers.tuning.estimator_drive_lag = late_periods * numbers.control_period;
        DelayedDrive::new(&numbers)
    }

    #[test]
    fn the_dead_time_is_the_stated_one() {
        let mut motor = motor(2.25);
        // as slowly as it can follow
        let speed = |k: u32| 0.1 * f64::from(k);
        for k in 0..10 {
            let (turned, expected) = (motor.advance(speed(k)), (f64::from(k) - 2.25).max(0.0));
            assert!((turned - 0.1 * expected).abs() < 1e-12, "period {k}: {turned}");
        }
        // told 9 tenths last: what it turns at without dead time
        assert!((motor.dead_time() / motor.period() - 2.25).abs() < 1e-12);
        assert!((motor.without_dead_time().speed() - 0.9).abs() < 1e-12);
    }

    /// By the area between what it is told and what it turns, where its slew does not count.
    #[test]
    fn the_lag_takes_its_share_of_the_delay() {
        let mut numbers = Description::uia_single_boom().unwrap().numbers;
        let step = 1e-3 * numbers.motor_slew * numbers.control_period;
        for (late, bandwidth) in [(8e-3, 60.0), (20e-3, 15.0)] {
            (numbers.tuning.estimator_drive_lag, numbers.drive_bandwidth) = (late, bandwidth);
            let mut motor = DelayedDrive::new(&numbers);
            let turned: Vec<f64> = (0..400).map(|_| motor.advance(step)).collect();
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
    fn speed_and_slew_stay_within_their_limits() {
        let mut motor = motor(0.0);
        let (leap, fastest) = (motor.limits.slew * motor.period, motor.limits.speed);
        let turned: Vec<f64> = (0..1000).map(|_| motor.advance(10.0 * fastest)).collect();
        let fastest_leap = turned.windows(2).map(|w| w[1] - w[0]).fold(turned[0], f64::max);
        assert!((fastest_leap / leap - 1.0).abs() < 1e-9 && turned[999] == fastest);
        assert!((motor.advance(0.0) - (fastest - leap)).abs() < 1e-9);
    }
}
