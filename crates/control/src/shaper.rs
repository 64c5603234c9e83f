//! Input shaping: a path with what would set a mode ringing taken out of it.

use crate::{Path, Reference};
use hydroboom_math::Real;

/// A path, told several times, each a share of it and later: what one of them sets ringing the others bring to rest.
///
/// The shares of a mode of damping ratio ζ fall by `K = exp(−ζ π/√(1 − ζ²))` from one half period to the next.
#[derive(Clone, Debug)]
pub struct Shaped<P> {
    path: P,
    /// Shares, and by how much later \[s\].
    impulses: [(f64, f64); 3],
}

impl<P: Path> Shaped<P> {
    /// Twice, half a period apart: a mode of this frequency \[Hz\] and damping ratio is at rest when the path is.
    pub fn zero_vibration(path: P, frequency: f64, damping: f64) -> Self {
        let (half, k) = mode(frequency, damping);
        let whole = 1.0 + k;
        Self { path, impulses: [(1.0 / whole, 0.0), (k / whole, half), (0.0, 0.0)] }
    }

    /// Three times: a mode that is somewhat beside this frequency \[Hz\] hardly rings either.
    pub fn zero_vibration_and_slope(path: P, frequency: f64, damping: f64) -> Self {
        let (half, k) = mode(frequency, damping);
        let whole = (1.0 + k) * (1.0 + k);
        let impulses = [(1.0 / whole, 0.0), (2.0 * k / whole, half), (k * k / whole, 2.0 * half)];
        Self { path, impulses }
    }

    /// By how much later it ends \[s\].
    pub fn delay(&self) -> f64 {
        self.impulses.iter().fold(0.0, |latest, (_, later)| latest.max(*later))
    }
}

/// Half a period \[s\] of a mode, and what is left of it by then.
fn mode(frequency: f64, damping: f64) -> (f64, f64) {
    let root = Real::sqrt(1.0 - damping * damping);
    (0.5 / (frequency * root), Real::exp(-core::f64::consts::PI * damping / root))
}

impl<P: Path> Path for Shaped<P> {
    fn reference(&self, t: f64) -> Reference<f64> {
        let mut sum = Reference { position: 0.0, velocity: 0.0 };
        for (share, later) in self.impulses {
            let told = self.path.reference(t - later);
            sum.position += share * told.position;
            sum.velocity += share * told.velocity;
        }
        sum
    }

    fn duration(&self) -> f64 {
        self.path.duration() + self.delay()
    }

    fn speed(&self) -> f64 {
        self.path.speed()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Motion, Profile};

    /// Largest swing after the motion of a pendulum of 2.5 Hz whose support follows a path, in millimetres.
    fn left(path: &impl Path, frequency: f64, damping: f64) -> f64 {
        let (w, step) = (core::f64::consts::TAU * frequency, 1e-4);
        let (mut swing, mut rate, mut largest) = (0.0_f64, 0.0_f64, 0.0_f64);
        let mut before = 0.0;
        let end = path.duration();
        for k in 0..(1e4 * (end + 1.0)) as u32 {
            let time = f64::from(k) * step;
            let velocity = path.reference(time).velocity;
            let acceleration = (velocity - before) / step;
            before = velocity;
            rate += step * (-w * w * swing - 2.0 * damping * w * rate - acceleration);
            swing += step * rate;
            if time > end {
                largest = largest.max(swing.abs());
            }
        }
        largest * 1e3
    }

    fn motion() -> Motion<f64> {
        let profile = Profile::Trapezoidal;
        Motion { start: 0.05, end: 0.2, speed: 0.12, ramp: 0.5, dwell: 0.3, rest: 0.0, profile }
    }

    #[test]
    fn a_mode_that_is_known_does_not_ring_and_one_beside_it_hardly() {
        let plain = left(&motion(), 2.5, 0.02);
        assert!(plain > 0.3, "{plain} mm");
        let twice = Shaped::zero_vibration(motion(), 2.5, 0.02);
        assert!(left(&twice, 2.5, 0.02) < 0.01 * plain);
        let thrice = Shaped::zero_vibration_and_slope(motion(), 2.5, 0.02);
        assert!(left(&thrice, 2.5, 0.02) < 0.01 * plain);
        // a tenth beside
        let beside = [left(&twice, 2.75, 0.02), left(&thrice, 2.75, 0.02)];
        assert!(beside[1] < 0.5 * beside[0], "{beside:?}");
    }

    #[test]
    fn it_begins_and_ends_where_the_path_does() {
        let shaped = Shaped::zero_vibration_and_slope(motion(), 2.5, 0.02);
        for time in [0.0, shaped.duration() + 1.0] {
            let (own, told) = (shaped.reference(time), motion().reference(time));
            assert!((own.position - told.position).abs() < 1e-12 && own.velocity.abs() < 1e-12);
        }
    }
}
