//! Feasible reference under the motor's speed limit: a trajectory that is faster is begun sooner, by half of the time that it would be late.
//!
//! So it is as far ahead at first as it is behind in the end.

use super::preview::{PERIODS_BEHIND, Preview};
use hydroboom_math::Real;

/// Time between two points of the preview that are compared \[s\], and their number: up to 2.5 s after now.
const SPACING: f64 = 0.05;
const PREVIEW_POINTS: usize = 51;

/// Offsets of the feasible reference from the asked one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedLimit<T> {
    /// Position \[m\] of the trajectory that is begun in time and limited in speed.
    late: T,
    /// Position \[m\] of the one that is begun sooner.
    feasible: T,
    /// Its offset \[m\] from what is asked, every 50 ms from now on.
    ahead: [T; PREVIEW_POINTS],
    /// The same in the periods before now, the oldest first.
    behind: [T; PERIODS_BEHIND + 1],
}

impl<T: Real> SpeedLimit<T> {
    /// At rest at a position \[m\].
    pub fn at_rest(position: T) -> Self {
        let zero = T::zero();
        Self {
            late: position,
            feasible: position,
            ahead: [zero; PREVIEW_POINTS],
            behind: [zero; PERIODS_BEHIND + 1],
        }
    }

    /// A period on; `fastest` \[m/s\] are the speeds that the motor reaches outwards and inwards.
    pub fn update(&mut self, preview: &Preview<T>, fastest: [T; 2]) {
        let period = preview.period();
        let spacing = T::lit(SPACING);
        let [out, inwards] = fastest;
        let moved = |from: T, to: T, time: T| from + (to - from).clamp(-inwards * time, out * time);
        let mut late = self.late;
        let mut longest = T::zero();
        for k in 1..PREVIEW_POINTS {
            let asked = preview.position(T::lit(k as f64 * SPACING));
            late = moved(late, asked, spacing);
            longest = longest.max((asked - late) / out).max((late - asked) / inwards);
        }
        let sooner = T::lit(0.5) * longest;
        let mut position = self.feasible;
        self.ahead[0] = position - preview.now().position;
        for k in 1..PREVIEW_POINTS {
            let time = T::lit(k as f64 * SPACING);
            position = moved(position, preview.position(time + sooner), spacing);
            self.ahead[k] = position - preview.position(time);
        }
        self.behind.copy_within(1.., 0);
        self.behind[PERIODS_BEHIND] = self.ahead[0];
        self.late = moved(self.late, preview.position(period), period);
        self.feasible = moved(self.feasible, preview.position(period + sooner), period);
    }

    /// Whether any offset is more than a micrometre.
    pub fn is_active(&self) -> T::Mask {
        let all = self.ahead.iter().chain(&self.behind);
        let largest = all.fold(T::zero(), |most, offset| most.max(offset.abs()));
        T::lit(1e-6).lt(largest)
    }

    /// Offset \[m\] of the feasible reference so long \[s\] after now, between −300 periods and 2.5 s, and its rate \[m/s\].
    #[inline(always)]
    pub fn at(&self, after: T, period: T) -> [T; 2] {
        let spacing = T::lit(SPACING);
        let offset = |time: T| {
            let back = T::interpolate(&self.behind, time / period + T::lit(PERIODS_BEHIND as f64));
            T::select(time.lt(T::zero()), back, T::interpolate(&self.ahead, time / spacing))
        };
        let half = T::lit(0.5) * spacing;
        [offset(after), (offset(after + half) - offset(after - half)) / spacing]
    }
}
