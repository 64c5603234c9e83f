//! Course of the control task: an approach from the piston's position to the start of a trajectory, then
//! the trajectory.

use hydroboom_control::reference::profile::{PointToPoint, RampShape, SetPoint};
use hydroboom_control::reference::trajectory::Trajectory;
use std::sync::Arc;

/// Distance to the trajectory's start below which there is no approach \[m\].
const NEAR: f64 = 1e-3;
/// Largest speed of an approach \[m/s\].
const APPROACH_SPEED: f64 = 0.05;
/// Duration of its ramps, and of the dwell after it \[s\].
const APPROACH_RAMP: f64 = 0.5;
const APPROACH_REST: f64 = 0.5;

/// Reference of a course: a trajectory, and the approach from the piston's position to its start.
#[derive(Clone)]
pub struct Course {
    path: Arc<dyn Trajectory>,
    approach: Approach,
}

/// Approach to the start of a trajectory.
#[derive(Clone, Copy)]
enum Approach {
    /// The piston is at the start.
    None,
    /// Start position \[m\], motion profile, and direction of motion (1 outwards, -1 inwards).
    Way(f64, PointToPoint<f64>, f64),
    /// Duration of the approach that is part of the trajectory \[s\].
    Path(f64),
}

impl Course {
    /// Course without an approach, for a piston at the start of the trajectory.
    pub fn new(path: Arc<dyn Trajectory>) -> Self {
        Self { path, approach: Approach::None }
    }

    /// Course of a trajectory that contains its own approach: it starts at time `-duration` \[s\], with `duration` at
    /// least 0.
    pub fn with_approach(path: Arc<dyn Trajectory>, duration: f64) -> Self {
        Self { path, approach: Approach::Path(duration) }
    }

    /// Course for a piston at position `stroke` \[m\], with an S-shaped approach if the trajectory starts elsewhere.
    pub fn from_stroke(path: Arc<dyn Trajectory>, stroke: f64) -> Self {
        let begin = path.reference(0.0).position;
        let distance = begin - stroke;
        if distance.abs() <= NEAR {
            return Self::new(path);
        }
        let way = PointToPoint {
            distance: distance.abs(),
            speed: APPROACH_SPEED.min(path.speed()),
            ramp: APPROACH_RAMP,
            profile: RampShape::SCurve,
        };
        Self { path, approach: Approach::Way(stroke, way, distance.signum()) }
    }

    /// Duration of the approach \[s\]; zero if there is none.
    pub fn approach(&self) -> f64 {
        match self.approach {
            Approach::None => 0.0,
            Approach::Way(_, way, _) => way.duration() + APPROACH_REST,
            Approach::Path(duration) => duration,
        }
    }

    /// Reference position \[m\] and velocity \[m/s\] at a time of the course \[s\]. The time is zero at the start of
    /// the trajectory, and negative during the approach.
    pub fn reference(&self, t: f64) -> SetPoint<f64> {
        match self.approach {
            Approach::Way(from, way, sign) if t < 0.0 => {
                let done = way.at(t + self.approach());
                SetPoint { position: from + sign * done.position, velocity: sign * done.velocity }
            }
            _ => self.path.reference(t),
        }
    }

    /// Duration of the trajectory \[s\], without the approach.
    pub fn duration(&self) -> f64 {
        self.path.duration()
    }

    /// Largest reference speed of the trajectory \[m/s\].
    pub fn speed(&self) -> f64 {
        self.path.speed()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_control::reference::profile::OutAndBack;

    #[test]
    fn an_approach_moves_from_the_piston_to_the_start_of_the_course() {
        let motion = OutAndBack {
            start: 0.05,
            end: 0.45,
            speed: 0.12,
            ramp: 1.0,
            dwell: 5.0,
            rest: 2.0,
            profile: RampShape::Trapezoidal,
        };
        for stroke in [0.3, 0.0, 0.052] {
            let course = Course::from_stroke(Arc::new(motion), stroke);
            let begin = -course.approach();
            assert!(begin < 0.0);
            assert!((course.reference(begin).position - stroke).abs() < 1e-12);
            let (mut last, step) = (course.reference(begin), 1e-3);
            let mut t = begin + step;
            while t < 1.0 {
                let now = course.reference(t);
                let mean = 0.5 * (now.velocity + last.velocity);
                assert!((now.position - last.position - mean * step).abs() < 1e-6, "at {t}");
                assert!(now.velocity.abs() <= APPROACH_SPEED + 1e-12);
                (last, t) = (now, t + step);
            }
            assert!((last.position - 0.05).abs() < 1e-9 && last.velocity == 0.0);
        }
        let near = Course::from_stroke(Arc::new(motion), 0.0505);
        assert_eq!(near.approach(), 0.0);
    }
}
