//! How well a course was followed.

use crate::motion_test::Sample;

/// A crane still swings if its piston moves by more than this in the last second \[m\]...
const SWINGING: f64 = 2e-3;
/// ... and no less than this share of what it did in the second before.
const SUSTAINED: f64 = 0.9;

/// Tracking errors gathered along a course.
#[derive(Clone, Copy, Debug)]
pub struct Score {
    duration: f64,
    square: f64,
    peak: f64,
    count: u64,
    /// Lowest and highest position in the last second but one, and in the last \[m\].
    extents: [(f64, f64); 2],
}

impl Score {
    /// Nothing gathered yet, of a course of the given duration \[s\].
    pub fn new(duration: f64) -> Self {
        let nowhere = (f64::INFINITY, f64::NEG_INFINITY);
        Self { duration, square: 0.0, peak: 0.0, count: 0, extents: [nowhere; 2] }
    }

    /// Adds a control period.
    pub fn add(&mut self, sample: &Sample) {
        let error = sample.error();
        self.square += error * error;
        self.count += 1;
        if error.abs() > self.peak.abs() {
            self.peak = error;
        }
        let left = self.duration - sample.time;
        if left < 2.0 {
            let (low, high) = &mut self.extents[usize::from(left < 1.0)];
            let stroke = sample.truth.outputs.stroke;
            (*low, *high) = (low.min(stroke), high.max(stroke));
        }
    }

    /// Root mean square of the tracking error \[m\].
    pub fn rms(&self) -> f64 {
        (self.square / self.count.max(1) as f64).sqrt()
    }

    /// The error of largest magnitude, with its sign \[m\].
    pub fn peak(&self) -> f64 {
        self.peak
    }

    /// Whether the course, which ends at rest, ended in an oscillation that does not die out.
    pub fn is_unstable(&self) -> bool {
        let [before, last] = self.extents.map(|(low, high)| high - low);
        last > SWINGING && last > SUSTAINED * before
    }
}
