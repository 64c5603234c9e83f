//! How far a loop is from ringing on.

use crate::growth::growing;
use crate::linear_feedback::LinearFeedback;
use crate::{DesignError, Lifting, Responses};
use hydroboom_control::feedback::benchmark::Benchmark;
use hydroboom_control::model_following::{BENDING, ModelFollowing};
use hydroboom_control::oil_spring::Gains;
use nalgebra::Complex;
use serde::Serialize;
use std::f64::consts::TAU;

/// Lowest and highest frequency that is looked at \[Hz\], and points between them.
const FREQUENCIES: [f64; 2] = [0.02, 300.0];
const POINTS: u32 = 1200;

/// A loop, broken at the motor.
#[derive(Clone, Debug)]
pub enum Loop {
    /// State feedback on the simulated crane.
    State {
        /// Its gains.
        gains: Gains<f64>,
        /// Coefficients of z⁰, z⁻¹, z⁻² of its notches: of the input, of the output.
        notches: [[[f64; 3]; 2]; BENDING],
        /// What of a change is followed in a period.
        smoothing: f64,
        /// Sample period \[s\]: a command is held for so long.
        period: f64,
    },
    /// Feedback from the machine in model following.
    Machine {
        /// What it makes of readings.
        feedback: Box<LinearFeedback>,
        /// Time from a command to what is read of it \[s\].
        delay: f64,
    },
    /// PI and pressure feedback.
    Benchmark {
        /// The controller.
        controller: Benchmark<f64>,
        /// Time constant of its high-pass \[s\].
        high_pass: f64,
        /// Time from a command to what is read of it \[s\].
        delay: f64,
    },
}

impl Loop {
    /// The loop of state feedback at a piston position \[m\], with the crane at rest.
    pub fn of_state(law: &ModelFollowing<f64>, stroke: f64) -> Self {
        Self::State {
            gains: law.gains_at_rest(stroke),
            notches: law.notches.map(|notch| notch.coefficients()),
            smoothing: law.smoothing,
            period: law.period,
        }
    }

    /// Highest frequency \[Hz\] that means anything: a sampled law answers those above half its rate as it answers others.
    pub(crate) fn highest(&self) -> f64 {
        match self {
            Self::State { period, .. } => 0.5 / period,
            Self::Machine { feedback, .. } => 0.5 / feedback.period(),
            Self::Benchmark { .. } => f64::INFINITY,
        }
    }

    /// What comes back for a motor speed at a frequency \[Hz\], with the sign that makes −1 the point to keep away from.
    pub fn gain(&self, crane: &Responses, frequency: f64) -> Complex<f64> {
        self.gain_at(crane, Complex::new(0.0, TAU * frequency))
    }

    /// The same for a motor speed that rings and grows as e to the s t, s in \[1/s\].
    pub(crate) fn gain_at(&self, crane: &Responses, s: Complex<f64>) -> Complex<f64> {
        let (fed_back, delay) = match self {
            Self::State { gains, notches, smoothing, period } => {
                let position = gains.position + gains.integral / s;
                let fed_back = position * crane.position
                    + crane.velocity * gains.velocity
                    + crane.pressure * gains.pressure;
                let back = (-s * *period).exp();
                let sum = |[now, last, before]: [f64; 3]| (back * before + last) * back + now;
                let passed = notches.iter().map(|[left, right]| sum(*left) / sum(*right));
                let passed: Complex<f64> = passed.product();
                let followed = Complex::from(*smoothing) / (1.0 - back * (1.0 - smoothing));
                (fed_back * passed * followed, 1.5 * period)
            }
            Self::Machine { feedback, delay } => {
                let read = [crane.position, crane.pressure, Complex::from(1.0)];
                (-feedback.answer(read, s), *delay)
            }
            Self::Benchmark { controller: c, high_pass, delay } => {
                let position = (c.proportional + c.integral / s) * c.revolutions_per_metre;
                let high = s * *high_pass / (s * *high_pass + 1.0);
                let pressure = high * (c.pressure_feedback / c.displacement);
                (position * crane.position + pressure * crane.pressure, *delay)
            }
        };
        fed_back * (-s * delay).exp()
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
    let low = FREQUENCIES[0];
    let high = FREQUENCIES[1].min(around.highest());
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
