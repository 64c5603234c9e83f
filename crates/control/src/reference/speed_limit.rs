//! Feasible reference under the motor's speed limit: a too fast trajectory is started earlier, by half of its delay
//! at the limit.
//!
//! So its lead at the start equals its lag at the end.

use super::preview::{PERIODS_BEHIND, Preview};
use super::profile::SetPoint;
use crate::memory::Memory;
use hydroboom_math::Real;

/// Time between two points of the preview that are compared \[s\], and their number: up to 2.5 s after now.
const SPACING: f64 = 0.05;
const PREVIEW_POINTS: usize = 51;

/// State of the feasible reference: its offsets from the commanded reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedLimit<T> {
    /// Position \[m\] of the trajectory that starts in time and is limited in speed.
    late: T,
    /// Position \[m\] of the one that starts earlier.
    feasible: T,
    /// Its offset \[m\] from the commanded reference, every 50 ms from now on.
    ahead: [T; PREVIEW_POINTS],
    /// The same in the periods before now, the oldest first.
    behind: [T; PERIODS_BEHIND + 1],
}

impl<T: Copy> Memory<T> for SpeedLimit<T> {
    fn visited(self, visit: &mut impl FnMut(&'static str, T) -> T) -> Self {
        Self {
            late: visit("late_reference", self.late),
            feasible: visit("feasible_reference", self.feasible),
            ahead: self.ahead.map(|v| visit("offset_ahead", v)),
            behind: self.behind.map(|v| visit("offset_behind", v)),
        }
    }
}

impl<T: Real> SpeedLimit<T> {
    /// Reference at rest at a position \[m\] where `mask` holds, else unchanged.
    #[must_use]
    pub fn at_rest_where(self, mask: T::Mask, position: T) -> Self {
        let rows = self.behind.map(|offset| [offset]);
        let (_, behind) =
            T::repeat(&rows, [], |_, [offset], []| ([], [T::select(mask, T::zero(), *offset)]));
        Self {
            late: T::select(mask, position, self.late),
            feasible: T::select(mask, position, self.feasible),
            behind: behind.map(|[offset]| offset),
            // worked out anew in each period
            ahead: self.ahead,
        }
    }

    /// Reference at rest at a position \[m\].
    pub fn at_rest(position: T) -> Self {
        let zero = T::zero();
        Self {
            late: position,
            feasible: position,
            ahead: [zero; PREVIEW_POINTS],
            behind: [zero; PERIODS_BEHIND + 1],
        }
    }

    /// One control period. `fastest` are the largest piston speeds outwards and inwards \[m/s\], both positive.
    pub fn update(&mut self, preview: &Preview<T>, fastest: [T; 2]) {
        let period = preview.period();
        let spacing = T::lit(SPACING);
        let [out, inwards] = fastest;
        let moved = |from: T, to: T, time: T| from + (to - from).clamp(-inwards * time, out * time);
        let times: [[T; 1]; PREVIEW_POINTS - 1] =
            core::array::from_fn(|k| [T::lit((k + 1) as f64 * SPACING)]);
        let ([_, longest], commanded) =
            T::repeat(&times, [self.late, T::zero()], |_, [time], [late, longest]| {
                let commanded = preview.position(*time);
                let late = moved(late, commanded, spacing);
                let longest =
                    longest.max((commanded - late) / out).max((late - commanded) / inwards);
                ([late, longest], [commanded])
            });
        let sooner = T::lit(0.5) * longest;
        let points: [[T; 2]; PREVIEW_POINTS - 1] =
            core::array::from_fn(|k| [times[k][0], commanded[k][0]]);
        let (_, ahead) = T::repeat(&points, [self.feasible], |_, [time, commanded], [position]| {
            let position = moved(position, preview.position(*time + sooner), spacing);
            ([position], [position - *commanded])
        });
        self.ahead[0] = self.feasible - preview.now().position;
        for (kept, [offset]) in self.ahead.iter_mut().skip(1).zip(ahead) {
            *kept = offset;
        }
        self.behind.copy_within(1.., 0);
        self.behind[PERIODS_BEHIND] = self.ahead[0];
        self.late = moved(self.late, preview.position(period), period);
        self.feasible = moved(self.feasible, preview.position(period + sooner), period);
    }

    /// Whether any offset exceeds 1 µm.
    pub fn is_active(&self) -> T::Mask {
        let largest = largest(&self.behind, largest(&self.ahead, T::zero()));
        T::lit(1e-6).lt(largest)
    }

    /// Feasible reference at a time `after` \[s\] relative to now. `period` is the control period \[s\]; `is_active`
    /// the result of [`is_active`](Self::is_active).
    #[inline(always)]
    pub fn reference(
        &self,
        preview: &Preview<T>,
        is_active: T::Mask,
        after: T,
        period: T,
    ) -> SetPoint<T> {
        let reference = preview.at(after);
        if T::any(is_active) {
            let [offset, drift] = self.at(after, period);
            let zero = T::zero();
            SetPoint {
                position: reference.position + T::select(is_active, offset, zero),
                velocity: reference.velocity + T::select(is_active, drift, zero),
            }
        } else {
            reference
        }
    }

    /// Offset of the feasible reference \[m\] and its rate \[m/s\] at a time `after` \[s\] relative to now, between
    /// −300 control periods and 2.5 s.
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

/// The largest magnitude of some numbers, and no less than `least`.
fn largest<T: Real, const K: usize>(of: &[T; K], least: T) -> T {
    let rows = of.map(|number| [number]);
    T::repeat(&rows, [least], |_, [number], [most]| ([most.max(number.abs())], [])).0[0]
}
