//! Zero-phase smoothing of a reference: a moving average over a window that reaches as far ahead as behind.
//!
//! Along a trapezoidal velocity profile its acceleration is continuous and its jerk limited, as inverse dynamics need
//! it.

use crate::reference::profile::SetPoint;
use hydroboom_math::{Real, record};

/// Positions by which the reference is averaged over the window.
const POINTS: usize = 6;

record! {
    /// Smoothed set point: position and its first three derivatives.
    pub struct SmoothSetPoint<T> {
        /// Smoothed position
        #[unit = "m"]
        pub position: T,
        /// Velocity of the smoothed position
        #[unit = "m/s"]
        pub velocity: T,
        /// Acceleration of the smoothed position
        #[unit = "m/s²"]
        pub acceleration: T,
        /// Jerk of the smoothed position
        #[unit = "m/s³"]
        pub jerk: T,
    }
}

/// Reference averaged over a window of length `window` \[s\], positive, centred at the time `after` \[s\]. `at(t)` is
/// the set point at a time t \[s\] relative to now.
///
/// The position is the mean of six positions in the window. Each derivative is the difference of the next lower one
/// between the ends of the window, over its length.
#[inline(always)]
pub fn smoothed<T: Real>(at: impl Fn(T) -> SetPoint<T>, window: T, after: T) -> SmoothSetPoint<T> {
    let half = T::lit(0.5) * window;
    let shares: [[T; 1]; POINTS] =
        core::array::from_fn(|k| [T::lit((k as f64 + 0.5) / POINTS as f64 - 0.5)]);
    let ([sum], _) = T::repeat(&shares, [T::zero()], |_, [share], [sum]| {
        ([sum + at(window.mul_add(*share, after)).position], [])
    });
    let position = sum / T::lit(POINTS as f64);
    let (ahead, behind) = (at(after + half), at(after - half));
    let near = T::lit(0.4) * half;
    let acceleration =
        |time: T| (at(time + near).velocity - at(time - near).velocity) / (near + near);
    SmoothSetPoint {
        position,
        velocity: (ahead.position - behind.position) / window,
        acceleration: (ahead.velocity - behind.velocity) / window,
        jerk: (acceleration(after + half) - acceleration(after - half)) / window,
    }
}
