//! How well a course was followed.

use crate::motion_test::Sample;
use serde::Serialize;

/// A crane still swings if its piston moves by more than this in the last second \[m\]...
const SWINGING: f64 = 2e-3;
/// ... and no less than this share of what it did in the second before; and if it is as far from the reference: what friction has held for a while
/// and is made good for is no swing. What goes from limit to limit is not as much in every second.
const SUSTAINED: f64 = 0.8;

/// What is slower than this in the tip's deflection is no vibration \[s\]: the boom rings at some Hz.
const SLOW: f64 = 0.5;

/// What a course cost and left, beside its tracking error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Effort {
    /// Largest motor speed.
    pub motor_speed_rpm: f64,
    /// Work of the motor, what flows back not counted.
    pub energy_kj: f64,
    /// Largest deflection of the tip.
    pub tip_deflection_mm: f64,
    /// Root mean square of the tip's vibration while the crane should rest, from the first motion on.
    pub residual_vibration_mm: f64,
}

/// Tracking errors gathered along a course.
#[derive(Clone, Copy, Debug)]
pub struct Score {
    duration: f64,
    square: f64,
    peak: f64,
    count: u64,
    /// Lowest and highest distance from the reference in the last second but one, and in the last \[m\].
    extents: [(f64, f64); 2],
    effort: Effort,
    /// Time and slow part of the tip's deflection a period ago; none before the first.
    before: Option<(f64, f64)>,
    has_moved: bool,
    vibration: f64,
    resting: u64,
}

impl Score {
    /// Nothing gathered yet, of a course of the given duration \[s\].
    pub fn new(duration: f64) -> Self {
        let nowhere = (f64::INFINITY, f64::NEG_INFINITY);
        Self {
            duration,
            square: 0.0,
            peak: 0.0,
            count: 0,
            extents: [nowhere; 2],
            effort: Effort::default(),
            before: None,
            has_moved: false,
            vibration: 0.0,
            resting: 0,
        }
    }

    /// Adds a control period.
    pub fn add(&mut self, sample: &Sample) {
        let error = sample.error();
        self.square += error * error;
        self.count += 1;
        if error.abs() > self.peak.abs() {
            self.peak = error;
        }
        self.add_effort(sample);
        let left = self.duration - sample.time;
        if left < 2.0 {
            let (low, high) = &mut self.extents[usize::from(left < 1.0)];
            let off = sample.truth.outputs.stroke - sample.reference.position;
            (*low, *high) = (low.min(off), high.max(off));
        }
    }

    fn add_effort(&mut self, sample: &Sample) {
        let truth = &sample.truth;
        let deflection = truth.outputs.tip_deflection;
        let (then, slow) = self.before.unwrap_or((sample.time, deflection));
        let passed = sample.time - then;
        let slow = slow + (deflection - slow) * (passed / SLOW).min(1.0);
        self.before = Some((sample.time, slow));
        let power = truth.motor_torque * truth.motor_speed * std::f64::consts::TAU;
        let effort = &mut self.effort;
        effort.motor_speed_rpm = effort.motor_speed_rpm.max(60.0 * truth.motor_speed.abs());
        effort.energy_kj += 1e-3 * power.max(0.0) * passed;
        effort.tip_deflection_mm = effort.tip_deflection_mm.max(1e3 * deflection.abs());
        self.has_moved |= sample.reference.velocity != 0.0;
        if self.has_moved && sample.reference.velocity == 0.0 {
            self.vibration += (deflection - slow) * (deflection - slow);
            self.resting += 1;
        }
    }

    /// What the course cost and left.
    pub fn effort(&self) -> Effort {
        let vibration = (self.vibration / self.resting.max(1) as f64).sqrt();
        Effort { residual_vibration_mm: 1e3 * vibration, ..self.effort }
    }

    /// Root mean square of the tracking error \[m\].
    pub fn rms(&self) -> f64 {
        (self.square / self.count.max(1) as f64).sqrt()
    }

    /// The error of largest magnitude, with its sign \[m\].
    pub fn peak(&self) -> f64 {
        self.peak
    }

    /// Whether the course, which ends at rest, ended in an oscillation that did not die out in its last two seconds.
    pub fn still_swings(&self) -> bool {
        let [before, last] = self.extents.map(|(low, high)| [high - low, high.max(-low)]);
        let [extent, farthest] = core::array::from_fn(|k| last[k] > SUSTAINED * before[k]);
        last[0] > SWINGING && extent && farthest
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use hydroboom_control::Reference;
    use hydroboom_description::Description;
    use hydroboom_virtual_crane::{Command, VirtualCrane};

    /// Of a crane that ends a course of three seconds so far \[m\] from where it should be.
    pub(crate) fn score(off: impl Fn(f64) -> f64) -> Score {
        let description = Description::uia_virtual().unwrap();
        let crane = VirtualCrane::new(&description, &description.start(0.25)).unwrap();
        let (reading, mut truth) = (crane.reading(), crane.truth());
        let mut score = Score::new(3.0);
        for k in 0..=3000 {
            let time = 1e-3 * f64::from(k);
            truth.outputs.stroke = 0.25 + off(time);
            let reference = Reference { position: 0.25, velocity: 0.0 };
            let command = Command { motor_speed: 0.0, holding_valve: 1.0 };
            score.add(&Sample { time, reference, reading, truth, command });
        }
        score
    }

    fn swings(off: impl Fn(f64) -> f64) -> bool {
        score(off).still_swings()
    }

    #[test]
    fn what_swings_to_and_fro_is_unstable_and_what_dies_out_or_creeps_back_is_not() {
        let swing = |time: f64| 3e-3 * (8.0 * time).sin();
        assert!(swings(swing) && swings(|time| swing(time) * (0.1 * time).exp()));
        assert!(!swings(|time| swing(time) * (-0.5 * time).exp()));
        assert!(swings(|time| swing(time) * (-0.15 * time).exp()));
        assert!(!swings(|time| 0.1 * swing(time)));
        // friction has held it, and by now it is made good for, at 4 mm/s
        assert!(!swings(|time| -9e-3 + 4e-3 * (time - 1.0).max(0.0)));
        // away from the reference it is no better than a swing
        assert!(swings(|time| 4e-3 * (time - 1.0).max(0.0)));
    }
}
