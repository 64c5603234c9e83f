//! The servo drive: a second-order lag within the limits of its motor.

use hydroboom_control::actuator_limits::ActuatorLimits;

/// Speed control and motor.
///
/// ```text
/// n'' = ω² (n_ref − n) − 2ζω n',   |n| ≤ n_max,   |n'| ≤ slew,   |2π J n' + T_load| ≤ T_max
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Drive {
    /// Undamped angular frequency ω \[rad/s\].
    pub frequency: f64,
    /// Damping ratio ζ.
    pub damping: f64,
    /// Largest torque \[N·m\].
    pub torque: f64,
    /// Moment of inertia of motor and pump \[kg·m²\].
    pub inertia: f64,
    /// Largest speed \[rev/s\] and slew \[rev/s²\].
    pub limits: ActuatorLimits<f64>,
}

/// Angle \[rad\] of the lag's own oscillation in one part of a step.
const FINEST: f64 = 0.01;

/// What a drive remembers.
#[derive(Clone, Copy, Debug, Default)]
pub struct DriveState {
    /// Speed n \[rev/s\].
    pub speed: f64,
    /// n' \[rev/s²\].
    pub acceleration: f64,
    /// Turns of the shaft \[rev\], within one.
    pub angle: f64,
}

impl DriveState {
    /// Turns the shaft for `time` \[s\].
    pub(crate) fn turn(&mut self, time: f64) {
        let angle = self.angle + time * self.speed;
        self.angle = angle - angle.floor();
    }
}

impl Drive {
    /// Moves the motor on by `step` \[s\], asked for `wanted` \[rev/s\] against a load torque
    /// \[N·m\] that is positive where it brakes positive speed. Returns its mean speed \[rev/s\]
    /// over the step.
    pub fn advance(&self, state: &mut DriveState, wanted: f64, load: f64, step: f64) -> f64 {
        // first order, but in parts so short that it does not show
        let parts = (self.frequency * step / FINEST).ceil().clamp(1.0, 20.0);
        let mut sum = 0.0;
        for _ in 0..parts as u32 {
            let before = state.speed;
            self.part(state, wanted, load, step / parts);
            sum += 0.5 * (before + state.speed);
        }
        sum / parts
    }

    fn part(&self, state: &mut DriveState, wanted: f64, load: f64, step: f64) {
        let wanted = wanted.clamp(-self.limits.speed, self.limits.speed);
        let (w, h) = (self.frequency, step);
        // linearly implicit, so that no bandwidth is too high for the step
        let asked = (state.acceleration + h * w * w * (wanted - state.speed))
            / (1.0 + h * w * (2.0 * self.damping + h * w));
        let per_torque = 1.0 / (std::f64::consts::TAU * self.inertia);
        let low = (-self.limits.slew).max((-self.torque - load) * per_torque);
        let high = self.limits.slew.min((self.torque - load) * per_torque);
        // an overhauling load may leave no choice: then the motor gives way
        state.acceleration = asked.min(high).max(low.min(high));
        let speed = state.speed + h * state.acceleration;
        state.speed = speed.clamp(-self.limits.speed, self.limits.speed);
        state.turn(h);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRIVE: Drive = Drive {
        frequency: 200.0,
        damping: 0.7,
        torque: 30.0,
        inertia: 0.01,
        limits: ActuatorLimits { speed: 50.0, slew: 500.0 },
    };

    #[test]
    fn a_small_step_is_answered_as_by_the_linear_lag() {
        let mut state = DriveState::default();
        let (step, wanted) = (1e-5, 1e-3);
        let damped = 200.0 * f64::sqrt(1.0 - 0.49);
        for k in 1..=4000 {
            DRIVE.advance(&mut state, wanted, 0.0, step);
            let t = f64::from(k) * step;
            let ring = (damped * t).cos() + 0.7 * 200.0 / damped * (damped * t).sin();
            let exact = wanted * (1.0 - (-0.7 * 200.0 * t).exp() * ring);
            assert!((state.speed - exact).abs() < 3e-3 * wanted, "{} {exact}", state.speed);
        }
    }

    #[test]
    fn slew_and_speed_are_respected() {
        let mut state = DriveState::default();
        for _ in 0..4000 {
            let before = state.speed;
            DRIVE.advance(&mut state, 80.0, 0.0, 1e-4);
            assert!(state.speed - before <= 500.0 * 1e-4 * (1.0 + 1e-9));
            assert!(state.speed <= 50.0);
        }
        assert!((state.speed - 50.0).abs() < 1e-6);
    }

    #[test]
    fn a_load_beyond_the_torque_stalls_and_overhauls_the_motor() {
        let mut state = DriveState::default();
        DRIVE.advance(&mut state, 10.0, 35.0, 1e-3);
        // 5 N·m too much on 0.01 kg·m²
        let expected = -5.0 / (std::f64::consts::TAU * 0.01);
        assert!((state.acceleration - expected).abs() < 1e-9, "{}", state.acceleration);
    }
}
