//! Motor and shaft of the pump.

use hydroboom_model::drive::{Drive, DriveState, parts};

/// Motor and shaft.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shaft {
    /// The motor.
    pub motor: DriveState<f64>,
    /// Angle of the shaft \[rev\], 0 to 1.
    pub angle: f64,
}

impl Shaft {
    /// A shaft at standstill.
    pub(crate) fn still() -> Self {
        Self { motor: DriveState::steady(0.0), angle: 0.0 }
    }

    /// Turns the shaft for `time` \[s\] at the motor's speed.
    pub(crate) fn turn(&mut self, time: f64) {
        self.angle = turned(self.angle, self.motor.speed, time);
    }

    /// Advances the motor by `step` \[s\] at the commanded speed `wanted` \[rev/s\]. `load` is the load torque \[N·m\],
    /// positive where it brakes positive speed. Returns the mean speed \[rev/s\] over the step.
    pub(crate) fn drive(&mut self, drive: &Drive<f64>, wanted: f64, load: f64, step: f64) -> f64 {
        let Self { motor, angle } = self;
        let parts = parts(drive.frequency, step);
        drive.advance(motor, wanted, load, step, parts, |motor, part| {
            *angle = turned(*angle, motor.speed, part);
        })
    }
}

fn turned(angle: f64, speed: f64, time: f64) -> f64 {
    let angle = angle + time * speed;
    angle - angle.floor()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_shaft_speeds_add_up_to_the_motor_angle() {
        let drive = Drive {
            frequency: 200.0,
            damping: 0.7,
            torque: 30.0,
            inertia: 0.01,
            largest_speed: 50.0,
            slew: 500.0,
        };
        let (mut shaft, step) = (Shaft::still(), 1e-4);
        let way: f64 = (0..5000).map(|_| step * shaft.drive(&drive, 10.3, 0.0, step)).sum();
        // from mean speeds; the tolerance is the error of piecewise first-order integration during acceleration
        assert!((way - way.floor() - shaft.angle).abs() < 1e-3, "{way} rev, {}", shaft.angle);
    }
}
