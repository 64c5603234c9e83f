//! Stability margins of a loop.

use crate::small_signal_controller::SmallSignalController;
use crate::unstable_poles::unstable_poles;
use crate::{DesignError, LinearisedPlant, Responses};
use hydroboom_control::feedback::benchmark::Benchmark;
use hydroboom_description::Description;
use nalgebra::Complex;
use serde::Serialize;
use std::f64::consts::TAU;

/// Lowest and highest frequency that is looked at \[Hz\], and points between them.
const FREQUENCIES: [f64; 2] = [0.02, 300.0];
const POINTS: u32 = 1200;

/// What is between a commanded motor speed and the readings beside the crane itself: drive, fieldbus, sampling, position sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actuation {
    /// Dead time of fieldbus and sampling \[s\].
    pub delay: f64,
    /// Time constant of the drive \[s\], and the square term of one of second order \[s²\].
    pub drive: [f64; 2],
    /// Time constant of the position sensor \[s\].
    pub sensor_lag: f64,
}

impl Actuation {
    /// That of a machine as its crane file has it; the sampling delays by half a period.
    pub fn of(machine: &Description) -> Self {
        let n = &machine.numbers;
        // a bandwidth of zero stands for none
        let lag = |bandwidth: f64| if bandwidth > 0.0 { 1.0 / (TAU * bandwidth) } else { 0.0 };
        let drive = lag(n.drive_bandwidth);
        Self {
            delay: (2.0 * n.fieldbus_delay.round() + 0.5) * n.control_period + n.drive_dead_time,
            drive: [2.0 * n.drive_damping * drive, drive * drive],
            sensor_lag: lag(n.sensor_bandwidth),
        }
    }

    /// From a command to the motor's speed as it is read.
    fn motor_speed(&self, s: Complex<f64>) -> Complex<f64> {
        let [lag, square] = self.drive;
        (-s * self.delay).exp() / (s * s * square + s * lag + 1.0)
    }
}

/// A loop, broken at the commanded motor speed.
#[derive(Clone, Debug)]
pub enum Loop {
    /// PI and pressure feedback.
    Benchmark {
        /// The controller.
        controller: Benchmark<f64>,
        /// Time constant of its high-pass \[s\].
        high_pass: f64,
        /// What is around it.
        actuation: Actuation,
    },
    /// Scheduled LQR with its state estimator.
    ScheduledLqr {
        /// The controller.
        controller: Box<SmallSignalController>,
        /// What is around it.
        actuation: Actuation,
    },
}

impl Loop {
    /// The same controller, with drive, fieldbus and sensors as a machine has them.
    pub fn on(mut self, machine: &Description) -> Self {
        let (Self::Benchmark { actuation, .. } | Self::ScheduledLqr { actuation, .. }) = &mut self;
        *actuation = Actuation::of(machine);
        self
    }

    /// Loop gain at a frequency \[Hz\], with the sign that makes −1 the critical point.
    pub fn gain(&self, crane: &Responses, frequency: f64) -> Complex<f64> {
        self.gain_at(crane, Complex::new(0.0, TAU * frequency))
    }

    /// The same for a motor speed that grows as e to the s t, s in \[1/s\].
    pub(crate) fn gain_at(&self, crane: &Responses, s: Complex<f64>) -> Complex<f64> {
        match self {
            Self::Benchmark { controller: c, high_pass, actuation } => {
                let position = (c.proportional + c.integral / s) * c.revolutions_per_metre;
                let high = s * *high_pass / (s * *high_pass + 1.0);
                let pressure = high * (c.pressure_feedback / c.displacement);
                let read = crane.position / (s * actuation.sensor_lag + 1.0);
                (position * read + pressure * crane.pressure) * actuation.motor_speed(s)
            }
            Self::ScheduledLqr { controller, actuation } => {
                let position = crane.position / (s * actuation.sensor_lag + 1.0);
                let readings = [position, crane.pressure, Complex::from(1.0)];
                -controller.frequency_response(readings, s) * actuation.motor_speed(s)
            }
        }
    }
}

/// Stability margins of a loop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(into = "Shown")]
pub struct Margins {
    /// Gain margin: factor on the gain, upwards, at which the loop becomes unstable; infinite where none does.
    pub gain: f64,
    /// Phase margin: least phase that is left where the loop's gain is one.
    pub phase_deg: f64,
    /// Modulus margin: least distance of the loop from −1, below which every additive uncertainty of the loop has to stay.
    pub modulus_margin: f64,
    /// Frequency of that.
    pub at_hz: f64,
    /// Highest frequency at which the loop's gain is one.
    pub crossover_hz: f64,
    /// Poles of the closed loop that grow faster than 0.02 1/s (they double within 35 s), less those of the open loop; where there are some, the margins above are none.
    pub unstable_poles: u32,
}

impl Margins {
    /// Whether no pole of the closed loop grows: an unstable loop has no margins.
    pub fn is_stable(&self) -> bool {
        self.unstable_poles == 0
    }
}

/// Margins as they are written: an unstable loop has none, a stable one may have no gain margin.
#[derive(Serialize)]
struct Shown {
    stable: bool,
    unstable_poles: u32,
    gain: Option<f64>,
    phase_deg: Option<f64>,
    modulus_margin: Option<f64>,
    at_hz: Option<f64>,
    crossover_hz: Option<f64>,
}

impl From<Margins> for Shown {
    fn from(m: Margins) -> Self {
        let of = |value: f64| (m.is_stable() && value.is_finite()).then_some(value);
        Self {
            stable: m.is_stable(),
            unstable_poles: m.unstable_poles,
            gain: of(m.gain),
            phase_deg: of(m.phase_deg),
            modulus_margin: of(m.modulus_margin),
            at_hz: of(m.at_hz),
            crossover_hz: of(m.crossover_hz),
        }
    }
}

/// Margins of a loop around a crane.
///
/// # Errors
///
/// [`DesignError`] when the crane's responses are not finite.
pub fn margins(crane: &LinearisedPlant, around: &Loop) -> Result<Margins, DesignError> {
    let [low, high] = FREQUENCIES;
    let mut found = Margins {
        gain: f64::INFINITY,
        phase_deg: 180.0,
        modulus_margin: f64::INFINITY,
        at_hz: low,
        crossover_hz: 0.0,
        unstable_poles: unstable_poles(crane, around)?,
    };
    let mut before: Option<Complex<f64>> = None;
    for k in 0..=POINTS {
        let frequency = low * (high / low).powf(f64::from(k) / f64::from(POINTS));
        let now = around.gain(&crane.responses(frequency)?, frequency);
        let distance = (now + 1.0).norm();
        if !distance.is_finite() {
            return Err(crane.none("the loop's gain is not finite"));
        }
        if distance < found.modulus_margin {
            (found.modulus_margin, found.at_hz) = (distance, frequency);
        }
        if let Some(last) = before {
            if (last.norm() - 1.0) * (now.norm() - 1.0) <= 0.0 {
                let left = 180.0 - now.arg().to_degrees().abs();
                found.phase_deg = found.phase_deg.min(left);
                found.crossover_hz = frequency;
            }
            // across the negative axis, nearer to zero than −1
            if last.im * now.im <= 0.0 && now.re < 0.0 && now.norm() < 1.0 && now.norm() > 0.0 {
                found.gain = found.gain.min(1.0 / now.norm());
            }
        }
        before = Some(now);
    }
    Ok(found)
}
