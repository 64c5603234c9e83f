//! Stability margins of a loop.

use crate::growth::growing;
use crate::small_signal_controller::SmallSignalController;
use crate::{DesignError, Lifting, Responses};
use hydroboom_control::feedback::benchmark::Benchmark;
use nalgebra::Complex;
use serde::Serialize;
use std::f64::consts::TAU;

/// Lowest and highest frequency that is looked at \[Hz\], and points between them.
const FREQUENCIES: [f64; 2] = [0.02, 300.0];
const POINTS: u32 = 1200;

/// A loop, broken at the commanded motor speed.
#[derive(Clone, Debug)]
pub enum Loop {
    /// PI and pressure feedback.
    Benchmark {
        /// The controller.
        controller: Benchmark<f64>,
        /// Time constant of its high-pass \[s\].
        high_pass: f64,
        /// Time from a command to what is read of it \[s\].
        delay: f64,
    },
    /// Scheduled LQR with its state estimator.
    ScheduledLqr {
        /// The controller.
        controller: Box<SmallSignalController>,
        /// Time from a command to what is read of it beside drive and sensors \[s\].
        delay: f64,
        /// Time constant of the drive \[s\].
        drive_lag: f64,
        /// Time constant of the position sensor \[s\].
        sensor_lag: f64,
    },
}

impl Loop {
    /// Loop gain at a frequency \[Hz\], with the sign that makes −1 the critical point.
    pub fn gain(&self, crane: &Responses, frequency: f64) -> Complex<f64> {
        self.gain_at(crane, Complex::new(0.0, TAU * frequency))
    }

    /// The same for a motor speed that grows as e to the s t, s in \[1/s\].
    pub(crate) fn gain_at(&self, crane: &Responses, s: Complex<f64>) -> Complex<f64> {
        match self {
            Self::Benchmark { controller: c, high_pass, delay } => {
                let position = (c.proportional + c.integral / s) * c.revolutions_per_metre;
                let high = s * *high_pass / (s * *high_pass + 1.0);
                let pressure = high * (c.pressure_feedback / c.displacement);
                (position * crane.position + pressure * crane.pressure) * (-s * *delay).exp()
            }
            Self::ScheduledLqr { controller, delay, drive_lag, sensor_lag } => {
                let position = crane.position / (s * *sensor_lag + 1.0);
                let readings = [position, crane.pressure, Complex::from(1.0)];
                let drive = Complex::from(1.0) / (s * *drive_lag + 1.0);
                -controller.answer(readings, s) * drive * (-s * *delay).exp()
            }
        }
    }
}

/// How far a loop is from ringing on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Margins {
    /// Factor on the gain, upwards, at which it rings on; infinite where none does.
    pub gain: f64,
    /// Least phase that is left where the loop's gain is one.
    pub phase_deg: f64,
    /// Least distance of the loop from −1, which every uncertainty has to stay below.
    pub distance: f64,
    /// Frequency of that.
    pub at_hz: f64,
    /// Highest frequency at which the loop's gain is one.
    pub crossover_hz: f64,
    /// Modes that grow in the closed loop and not without it; where there are some, the others say how far it is from none.
    pub growing: u32,
}

/// Margins of a loop around a crane.
///
/// # Errors
///
/// [`DesignError`] when the crane's responses are not finite.
pub fn margins(crane: &Lifting, around: &Loop) -> Result<Margins, DesignError> {
    let [low, high] = FREQUENCIES;
    let mut found = Margins {
        gain: f64::INFINITY,
        phase_deg: 180.0,
        distance: f64::INFINITY,
        at_hz: low,
        crossover_hz: 0.0,
        growing: growing(crane, around)?,
    };
    let mut before: Option<Complex<f64>> = None;
    for k in 0..=POINTS {
        let frequency = low * (high / low).powf(f64::from(k) / f64::from(POINTS));
        let now = around.gain(&crane.responses(frequency)?, frequency);
        let distance = (now + 1.0).norm();
        if !distance.is_finite() {
            return Err(crane.none("the loop's gain is not finite"));
        }
        if distance < found.distance {
            (found.distance, found.at_hz) = (distance, frequency);
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
