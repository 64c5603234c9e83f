//! Motor speed as the drive's response to its command: dead time, second-order lag, limits of speed and
//! slew rate.
//!
//! The crane's motion follows from the measured speed and not from the command. The drive therefore shares
//! no parameter with the rest of the model. Its keys are still part of the same least-squares problem, with
//! exact derivatives, and its output is the motor speed.

use crate::experiment::Times;
use crate::free::Free;
use crate::number::Number;
use hydroboom_description::Description;
use hydroboom_description::schema::{CircuitChoice, Numbers};
use hydroboom_measurement::{Signal, Signals};
use hydroboom_model::drive::{DeadTime, Drive, DriveState, MOST_PARTS};

/// Keys of the drive.
const KEYS: [&str; 3] = ["drive.bandwidth_hz", "drive.damping_ratio", "drive.dead_time_ms"];

impl Free {
    /// Whether it is a key of the electric drive (dead time, lag, limits), which affects only the motor speed in a
    /// log.
    pub fn is_of_drive(self) -> bool {
        KEYS.contains(&self.path().as_str())
    }

    /// Keys of the drive that a fit may change; empty for an ideal motor.
    pub fn of_drive(model: &Description) -> Vec<Self> {
        let keys = KEYS.iter().filter_map(|path| Self::from_path(path).ok());
        keys.filter(|key| has_drive(model) && key.value(model) > 0.0).collect()
    }
}

/// Whether the motor of a model lags its command.
fn has_drive(model: &Description) -> bool {
    let n = &model.numbers;
    model.choices.circuit == CircuitChoice::SelfContained
        && n.drive_bandwidth + n.drive_dead_time > 0.0
}

/// Commanded motor speed.
#[derive(Clone, Debug)]
pub(crate) struct MotorCommand {
    /// Command of each control period \[rev/s\]; the first [`before`](Self::before) of them precede the
    /// experiment.
    speeds: Vec<f64>,
    before: usize,
    /// Initial speed of the motor \[rev/s\].
    initial_speed: f64,
}

/// Largest dead time \[s\].
const LONGEST_DEAD_TIME: f64 = 0.3;

impl MotorCommand {
    /// Commands of a log; none if the log lacks the command or the measured speed, or the model has no
    /// drive.
    pub(crate) fn new(model: &Description, signals: &Signals, times: &Times) -> Option<Self> {
        let (command, read) =
            (signals.get(Signal::MotorCommand)?, signals.get(Signal::MotorSpeed)?);
        if !has_drive(model) {
            return None;
        }
        let Times { begin, period, count } = *times;
        let before = (LONGEST_DEAD_TIME / period).ceil() as usize + 1;
        let at = |k: usize| begin + (k as f64 - before as f64) * period;
        let first = command.at(begin).or_else(|| command.held(begin))?;
        let speed = |k: usize| command.at(at(k)).or_else(|| command.held(at(k))).unwrap_or(first);
        let initial_speed = read.at(begin).or_else(|| read.held(begin)).unwrap_or(first);
        Some(Self { speeds: (0..before + count).map(speed).collect(), before, initial_speed })
    }

    /// Measured motor speed \[rev/s\] every `every` control periods, from the start on.
    ///
    /// Command and measurement both pass the fieldbus. Torque does not limit the motor.
    pub(crate) fn read<T: Number>(&self, n: &Numbers<T>, every: usize, count: usize) -> Vec<T> {
        let period = n.control_period;
        let dead_time = n.drive_dead_time + T::lit(2.0) * n.fieldbus_delay * period;
        let whole = (dead_time.plain() / period.plain()) as usize;
        let dead_time = DeadTime::over(dead_time, period, whole.min(self.before - 1));
        let has_lag = n.drive_bandwidth.plain() > 0.0;
        let drive = Drive {
            frequency: T::lit(std::f64::consts::TAU) * n.drive_bandwidth,
            damping: n.drive_damping,
            torque: T::lit(f64::INFINITY),
            inertia: T::one(),
            largest_speed: n.motor_speed,
            slew: n.motor_slew,
        };
        let mut state = DriveState::steady(T::lit(self.initial_speed));
        let mut read = Vec::with_capacity(count);
        for k in 0..self.speeds.len() - self.before {
            if k % every == 0 {
                read.push(state.speed);
            }
            let sent = |ago: usize| T::lit(self.speeds[(self.before + k).saturating_sub(ago)]);
            let wanted = dead_time.arrived(sent);
            match has_lag {
                // a constant number of substeps keeps the result smooth in the bandwidth
                true => {
                    drive.advance(&mut state, wanted, T::zero(), period, MOST_PARTS, |_, _| {});
                }
                false => {
                    let (reach, most) = (n.motor_slew * period, n.motor_speed);
                    let wanted = wanted.clamp(-most, most);
                    state.speed = wanted.clamp(state.speed - reach, state.speed + reach);
                }
            }
        }
        read.resize(count, state.speed);
        read
    }
}
