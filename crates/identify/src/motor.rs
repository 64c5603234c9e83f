//! The motor's speed, as the drive makes it of what is asked for: dead time, second-order lag, limits of speed and slew.
//!
//! What the crane does follows from the speed that was read, and not from the one asked for: the drive shares no number with the rest of the model.
//! Its keys are in the same least-squares problem all the same, with exact slopes, and its channel is the motor speed.

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
    /// Whether it is a key of the drive, which the motor speed alone depends on.
    pub fn is_of_drive(self) -> bool {
        KEYS.contains(&self.path().as_str())
    }

    /// Keys of the drive that can be moved; none of a model whose motor follows at once.
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

/// Motor speed that was asked for.
#[derive(Clone, Debug)]
pub(crate) struct Asked {
    /// Of each control period \[rev/s\], after [`before`](Self::before) of them before the experiment begins.
    speeds: Vec<f64>,
    before: usize,
    /// Speed that the motor had at the beginning \[rev/s\].
    beginning: f64,
}

/// The longest dead time that is looked for \[s\].
const LONGEST: f64 = 0.3;

impl Asked {
    /// What a log says; none where it has not both the speed that was asked for and the one that was read, or the model has no drive.
    pub(crate) fn new(model: &Description, signals: &Signals, times: &Times) -> Option<Self> {
        let (asked, read) = (signals.get(Signal::MotorCommand)?, signals.get(Signal::MotorSpeed)?);
        if !has_drive(model) {
            return None;
        }
        let Times { begin, period, count } = *times;
        let before = (LONGEST / period).ceil() as usize + 1;
        let at = |k: usize| begin + (k as f64 - before as f64) * period;
        let first = asked.at(begin).or_else(|| asked.held(begin))?;
        let speed = |k: usize| asked.at(at(k)).or_else(|| asked.held(at(k))).unwrap_or(first);
        let beginning = read.at(begin).or_else(|| read.held(begin)).unwrap_or(first);
        Some(Self { speeds: (0..before + count).map(speed).collect(), before, beginning })
    }

    /// Motor speed \[rev/s\] as it is read once in so many control periods \[s\], from the beginning on.
    ///
    /// Command and reading both pass the fieldbus. Torque does not limit the motor.
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
        let mut state = DriveState::steady(T::lit(self.beginning));
        let mut read = Vec::with_capacity(count);
        for k in 0..self.speeds.len() - self.before {
            if k % every == 0 {
                read.push(state.speed);
            }
            let sent = |ago: usize| T::lit(self.speeds[(self.before + k).saturating_sub(ago)]);
            let wanted = dead_time.arrived(sent);
            match has_lag {
                // always as many parts, so that nothing leaps as the bandwidth is moved
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
