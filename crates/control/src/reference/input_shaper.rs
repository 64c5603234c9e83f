//! Input shaping: a trajectory convolved with two (ZV) or three (ZVD) impulses, so that a lightly damped mode does not
//! ring after it.
//!
//! Source: N. C. Singer and W. P. Seering, "Preshaping Command Inputs to Reduce System Vibration", Journal of Dynamic
//! Systems, Measurement, and Control 112 (1), 1990, 76-82, doi:10.1115/1.2894142.

use crate::reference::profile::SetPoint;
use crate::reference::trajectory::Trajectory;
use hydroboom_math::Real;

/// Impulses of a shaper: amplitudes A_i with `Σ A_i = 1` at times t_i, whose residual vibrations add up to zero.
///
/// The amplitudes for a mode of damping ratio ζ fall by `K = exp(−ζ π/√(1 − ζ²))` from one half period to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputShaper {
    /// Amplitudes A_i, and times t_i \[s\].
    impulses: [(f64, f64); 3],
}

impl InputShaper {
    /// Zero vibration (ZV) shaper: two impulses half a damped period apart, for a mode of natural `frequency` \[Hz\]
    /// and `damping` ratio \[1\].
    ///
    /// The amplitudes are 1 and K, over 1 + K. The frequency is positive, the damping ratio from 0 to below 1; from 1
    /// on the shaper is NaN.
    pub fn zv(frequency: f64, damping: f64) -> Self {
        let (half, k) = mode(frequency, damping);
        let whole = 1.0 + k;
        Self { impulses: [(1.0 / whole, 0.0), (k / whole, half), (0.0, 0.0)] }
    }

    /// Zero vibration and derivative (ZVD) shaper: three impulses. The derivative of the residual vibration by
    /// frequency \[Hz\] is zero as well, for robustness against an error of the frequency.
    ///
    /// The amplitudes are 1, 2 K and K², over (1 + K)². Ranges are those of [`zv`](Self::zv).
    pub fn zvd(frequency: f64, damping: f64) -> Self {
        let (half, k) = mode(frequency, damping);
        let whole = (1.0 + k) * (1.0 + k);
        let impulses = [(1.0 / whole, 0.0), (2.0 * k / whole, half), (k * k / whole, 2.0 * half)];
        Self { impulses }
    }

    /// Time of the last impulse \[s\]: the delay of the end of a shaped trajectory.
    pub fn delay(&self) -> f64 {
        self.impulses.iter().fold(0.0, |latest, (_, later)| latest.max(*later))
    }

    /// Mean time of the impulses, `Σ A_i t_i` \[s\]: the delay of a shaped ramp.
    pub fn mean_delay(&self) -> f64 {
        self.impulses.iter().map(|(share, later)| share * later).sum()
    }

    /// Shaped set point, `Σ A_i x_ref(−t_i)`. `at(t)` is the set point at a time t \[s\] relative to now.
    pub fn shaped(&self, at: impl Fn(f64) -> SetPoint<f64>) -> SetPoint<f64> {
        let mut sum = SetPoint { position: 0.0, velocity: 0.0 };
        for (share, later) in self.impulses {
            let plain = at(-later);
            sum.position += share * plain.position;
            sum.velocity += share * plain.velocity;
        }
        sum
    }
}

/// Trajectory convolved with an input shaper, `Σ A_i x_ref(t − t_i)`.
#[derive(Clone, Debug)]
pub struct ShapedTrajectory<P> {
    trajectory: P,
    shaper: InputShaper,
}

impl<P: Trajectory> ShapedTrajectory<P> {
    /// Trajectory shaped by [`InputShaper::zv`], for a mode of natural `frequency` \[Hz\] and `damping` ratio \[1\].
    pub fn zv(trajectory: P, frequency: f64, damping: f64) -> Self {
        Self { trajectory, shaper: InputShaper::zv(frequency, damping) }
    }

    /// Trajectory shaped by [`InputShaper::zvd`], for a mode of natural `frequency` \[Hz\] and `damping` ratio \[1\].
    pub fn zvd(trajectory: P, frequency: f64, damping: f64) -> Self {
        Self { trajectory, shaper: InputShaper::zvd(frequency, damping) }
    }

    /// Delay of the end of the trajectory by shaping \[s\].
    pub fn delay(&self) -> f64 {
        self.shaper.delay()
    }
}

/// Half a period \[s\] of a mode, and its relative amplitude after it.
fn mode(frequency: f64, damping: f64) -> (f64, f64) {
    let root = Real::sqrt(1.0 - damping * damping);
    (0.5 / (frequency * root), Real::exp(-core::f64::consts::PI * damping / root))
}

impl<P: Trajectory> Trajectory for ShapedTrajectory<P> {
    fn reference(&self, t: f64) -> SetPoint<f64> {
        self.shaper.shaped(|after| self.trajectory.reference(t + after))
    }

    fn duration(&self) -> f64 {
        self.trajectory.duration() + self.delay()
    }

    fn speed(&self) -> f64 {
        self.trajectory.speed()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::profile::{OutAndBack, RampShape};

    /// Residual vibration after the motion of a pendulum of 2.5 Hz whose support follows a trajectory, in millimetres.
    fn residual_vibration(trajectory: &impl Trajectory, frequency: f64, damping: f64) -> f64 {
        let (w, step) = (core::f64::consts::TAU * frequency, 1e-4);
        let (mut swing, mut rate, mut largest) = (0.0_f64, 0.0_f64, 0.0_f64);
        let mut before = 0.0;
        let end = trajectory.duration();
        for k in 0..(1e4 * (end + 1.0)) as u32 {
            let time = f64::from(k) * step;
            let velocity = trajectory.reference(time).velocity;
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

    fn motion() -> OutAndBack<f64> {
        let profile = RampShape::Trapezoidal;
        OutAndBack { start: 0.05, end: 0.2, speed: 0.12, ramp: 0.5, dwell: 0.3, rest: 0.0, profile }
    }

    #[test]
    fn shaping_suppresses_the_mode_and_zvd_tolerates_a_detuned_one() {
        let plain = residual_vibration(&motion(), 2.5, 0.02);
        assert!(plain > 0.3, "{plain} mm");
        let twice = ShapedTrajectory::zv(motion(), 2.5, 0.02);
        assert!(residual_vibration(&twice, 2.5, 0.02) < 0.01 * plain);
        let thrice = ShapedTrajectory::zvd(motion(), 2.5, 0.02);
        assert!(residual_vibration(&thrice, 2.5, 0.02) < 0.01 * plain);
        // natural frequency 10 % higher than assumed
        let beside =
            [residual_vibration(&twice, 2.75, 0.02), residual_vibration(&thrice, 2.75, 0.02)];
        assert!(beside[1] < 0.5 * beside[0], "{beside:?}");
    }

    #[test]
    fn a_shaped_ramp_lags_by_the_mean_delay() {
        for shaper in [InputShaper::zv(2.5, 0.1), InputShaper::zvd(2.5, 0.1)] {
            let ramp = |after: f64| SetPoint { position: 0.12 * after, velocity: 0.12 };
            let shaped = shaper.shaped(|after| ramp(after + shaper.mean_delay()));
            assert!(shaped.position.abs() < 1e-15, "{shaped:?}");
            assert!(0.0 < shaper.mean_delay() && shaper.mean_delay() < shaper.delay());
        }
    }

    #[test]
    fn a_shaped_trajectory_starts_and_ends_as_the_unshaped_one() {
        let shaped = ShapedTrajectory::zvd(motion(), 2.5, 0.02);
        for time in [0.0, shaped.duration() + 1.0] {
            let (own, plain) = (shaped.reference(time), motion().reference(time));
            assert!((own.position - plain.position).abs() < 1e-12 && own.velocity.abs() < 1e-12);
        }
    }
}
