//! How much later than the motor is told its speed it is read: drive, fieldbus and sensors together. Learned while the machine works.
//!
//! ```text
//! Σ (n_told − n) Δt = L (n_k − n_{k−1})           over windows of a tenth of a second
//! ```
//!
//! L is the lag, n the speed that is read, n_k what it was at the end of window k. A lag of first order is so exactly, whatever its motor is told; a delay
//! and lags of higher order are so but for what their windows begin and end with. A drive that lets its speed sag under load is off by
//! as much while it speeds up as while it slows down, and teaches nothing by that.

use crate::belief::Belief;
use crate::measurement::AxisSignals;
use crate::out_of_range::OutOfRange;
use hydroboom_math::{Real, record};

/// What is learned stays within so many standard deviations of what was known before.
const BOUND: f64 = 4.0;
/// What is believed of the lag stays within these \[s\]. No machine is steered that is later; and what a drive sags by
/// while it slows down looks like a lag below zero, until it speeds up again.
const LAGS: [f64; 2] = [-0.5, 0.5];

record! {
    /// What is believed of the lag.
    pub struct BelievedLag<T> {
        /// Lag, L
        #[unit = "s"]
        pub lag: T,
        /// Its variance
        #[unit = "s²"]
        pub variance: T,
    }
}

/// The way from a command to its reading, and what is known of it before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommandLag {
    /// Lag, as the crane file has it \[s\].
    pub before: f64,
    /// How uncertain that is, as a standard deviation \[s\].
    pub uncertainty: f64,
    /// Standard deviation of what the motor turns in a window beyond its lag \[rev\].
    pub scatter: f64,
    /// Periods in a window.
    pub window: u32,
    /// What is left of a window's weight a window later.
    pub memory: f64,
    /// Sample period \[s\].
    pub period: f64,
}

/// What was learned, and the window that is under way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommandLagMemory {
    belief: Belief<1>,
    /// Turns that are missing since the window began \[rev\].
    missing: f64,
    /// Speed at which it began, and at which the last period ended \[rev/s\].
    begun: f64,
    speed: f64,
    count: u32,
    /// Lag that is known now \[s\].
    pub lag: f64,
}

impl CommandLagMemory {
    /// What is believed, to go on with later.
    pub fn believed(&self) -> BelievedLag<f64> {
        BelievedLag { lag: self.belief.estimate[0], variance: self.belief.covariance[0][0] }
    }

    /// No longer than this, most likely \[s\].
    pub fn likely(&self) -> f64 {
        self.lag + Real::sqrt(self.belief.covariance[0][0])
    }

    /// A window begins with a reading, after what tells nothing.
    pub fn begin_window(&mut self, reading: &AxisSignals<f64>) {
        (self.missing, self.count) = (0.0, 0);
        (self.begun, self.speed) = (reading.motor_speed, reading.motor_speed);
    }
}

impl CommandLag {
    /// Nothing learned yet.
    pub fn start(&self, reading: &AxisSignals<f64>) -> CommandLagMemory {
        let belief = Belief::new([self.before], &[self.uncertainty]);
        let speed = reading.motor_speed;
        CommandLagMemory { belief, missing: 0.0, begun: speed, speed, count: 0, lag: self.before }
    }

    /// Goes on with what was believed before.
    ///
    /// # Errors
    ///
    /// The first field that cannot have been learned.
    pub fn resume(&self, believed: &BelievedLag<f64>) -> Result<CommandLagMemory, OutOfRange> {
        let belief = Belief { estimate: [believed.lag], covariance: [[believed.variance]] };
        belief.check(&[LAGS], &[self.uncertainty])?;
        let lag = self.bounded(believed.lag);
        Ok(CommandLagMemory { belief, lag, ..self.start(&AxisSignals::default()) })
    }

    /// Nothing is read before it is told.
    fn bounded(&self, lag: f64) -> f64 {
        Real::clamp(lag, 0.0, self.before + BOUND * self.uncertainty)
    }

    /// A period at whose beginning the motor was told a speed \[rev/s\], and what was read at its end. A window with a number that is none is
    /// left out.
    pub fn update(&self, memory: &mut CommandLagMemory, told: f64, reading: &AxisSignals<f64>) {
        let speed = reading.motor_speed;
        memory.missing += (told - 0.5 * (memory.speed + speed)) * self.period;
        memory.speed = speed;
        memory.count += 1;
        if memory.count < self.window {
            return;
        }
        let (gained, missing) = (speed - memory.begun, memory.missing);
        memory.begin_window(reading);
        if (gained + missing).is_finite() {
            memory.belief.forget(1.0 - self.memory, &[self.uncertainty]);
            memory.belief.learn(&[gained], missing, self.scatter.square());
            memory.belief.keep_within(&[LAGS]);
            memory.lag = self.bounded(memory.belief.estimate[0]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn command_lag() -> CommandLag {
        CommandLag {
            before: 5e-3,
            uncertainty: 1e-2,
            scatter: 5e-3,
            window: 100,
            memory: 0.999,
            period: 1e-3,
        }
    }

    fn reading(motor_speed: f64) -> AxisSignals<f64> {
        AxisSignals { motor_speed, ..AxisSignals::default() }
    }

    /// A motor that is told speeds over time, and one reading of it in each period.
    fn learned(told: impl Fn(f64) -> f64, mut motor: impl FnMut(f64) -> f64) -> CommandLagMemory {
        let lag = command_lag();
        let mut memory = lag.start(&reading(0.0));
        for k in 0..20_000 {
            let speed = told(1e-3 * f64::from(k));
            lag.update(&mut memory, speed, &reading(motor(speed)));
        }
        memory
    }

    /// Up and down and at rest between, in ramps of a second.
    fn course(time: f64) -> f64 {
        let ramp = |begins: f64| Real::clamp(time - begins, 0.0, 1.0);
        8.0 * (ramp(2.0) - ramp(6.0) - ramp(10.0) + ramp(14.0))
    }

    #[test]
    fn lags_and_delays_are_found_together() {
        for (time_constant, delay) in [(16e-3, 2), (5e-3, 0), (3e-3, 20), (0.0, 0)] {
            let (mut speed, mut under_way) = (0.0, std::collections::VecDeque::new());
            let memory = learned(course, |told| {
                under_way.push_back(told);
                if under_way.len() > delay {
                    let arrived = under_way.pop_front().unwrap_or_default();
                    let share = match time_constant > 0.0 {
                        true => -f64::exp_m1(-1e-3 / time_constant),
                        false => 1.0,
                    };
                    speed += share * (arrived - speed);
                }
                speed
            });
            // a motor that follows at once does so at the beginning of a period, and seems to have taken half of it
            let truth = 1e-3 * delay as f64 + f64::max(time_constant, 0.5e-3);
            let found = memory.lag;
            // a hundredth is left of what was thought before, which was up to 18 ms off, and windows end in the midst of ramps
            assert!((found - truth).abs() < 3e-4, "{found} s for {truth} s");
            assert!(memory.believed().variance.sqrt() < 0.2 * command_lag().uncertainty);
        }
    }

    /// At one speed nothing tells when it was told, though the motor turns slower than that.
    #[test]
    fn a_speed_that_sags_is_no_lag() {
        let lag = command_lag();
        let mut steady = lag.start(&reading(19.8));
        for _ in 0..20_000 {
            lag.update(&mut steady, 20.0, &reading(19.8));
        }
        assert_eq!(steady.lag, lag.before);
        let sagging = learned(course, |told| told - 0.05);
        // it follows at once: half a period, and a hundredth of the 5 ms that were thought before
        assert!((sagging.lag - 0.5e-3).abs() < 1e-4, "{sagging:?}");
    }

    #[test]
    fn before_a_motor_was_told_another_speed_it_may_be_late() {
        let lag = command_lag();
        assert_eq!(lag.start(&reading(0.0)).likely(), lag.before + lag.uncertainty);
        let known = learned(course, |told| told);
        assert!((0.0..0.2 * lag.uncertainty).contains(&(known.likely() - known.lag)), "{known:?}");
    }

    #[test]
    fn what_cannot_be_is_not_learned() {
        let lag = command_lag();
        let broken = learned(course, |_| f64::NAN);
        assert_eq!(broken.lag, lag.before);
        let stuck = learned(course, |_| 0.0);
        assert!((0.0..=lag.before + BOUND * lag.uncertainty).contains(&stuck.lag));
        // one that is ahead of what it is told
        assert!(learned(course, |told| 1.5 * told).lag >= 0.0);
        let believed = stuck.believed();
        assert_eq!(lag.resume(&believed).map(|memory| memory.believed()), Ok(believed));
        let refused = |believed| lag.resume(&believed).err().map(|wrong| wrong.field);
        assert_eq!(refused(BelievedLag { variance: -1e-6, ..believed }), Some(1));
        for other in [-0.6, 0.6, f64::NAN] {
            assert_eq!(refused(BelievedLag { lag: other, ..believed }), Some(0));
        }
    }
}
