//! Reference preview: set points of the next 2.5 s and of the last 0.3 s, with a control period of 1 ms.

use crate::memory::Memory;
use crate::reference::profile::SetPoint;
use hydroboom_math::Real;

/// Number of past control periods in a [`Preview`].
pub const PERIODS_BEHIND: usize = 300;
/// Number of future control periods in a [`Preview`].
pub const PERIODS_AHEAD: usize = 800;
const NEAR: usize = PERIODS_BEHIND + 1 + PERIODS_AHEAD;

/// Time between two distant set points \[s\], from the end of the near ones to 2.5 s after now.
const FAR_SPACING: f64 = 0.05;
/// Distant set points, the first 800 periods after now.
const FAR: usize = 35;

/// Reference around the present: set points of every control period from 300 periods before to 800 periods after now.
///
/// Beyond follow positions every 50 ms for 1.7 s, up to 2.5 s with a control period of 1 ms.
/// [`advance`](Self::advance) shifts it by a period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Preview<T> {
    position: [T; NEAR],
    velocity: [T; NEAR],
    far: [T; FAR],
    period: T,
}

/// Number of positions every 50 ms after the last control period of a [`PreviewAhead`].
pub const DISTANT: usize = FAR - 1;

/// Future set points, as far as they are known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PreviewAhead<T> {
    /// Number of known future control periods; 0 if only the present set point is known. Of more than
    /// [`PERIODS_AHEAD`], the rest is known by `distant`.
    pub length: T,
    /// Position in each future control period \[m\].
    pub position: [T; PERIODS_AHEAD],
    /// Velocity in each future control period \[m/s\].
    pub velocity: [T; PERIODS_AHEAD],
    /// Positions every 50 ms after the last of these control periods \[m\].
    pub distant: [T; DISTANT],
}

impl<T: Real> PreviewAhead<T> {
    /// No known future set points.
    pub fn unknown() -> Self {
        let zero = T::zero();
        Self {
            length: zero,
            position: [zero; PERIODS_AHEAD],
            velocity: [zero; PERIODS_AHEAD],
            distant: [zero; DISTANT],
        }
    }

    /// Future set points of a trajectory for `length` control periods of `period` \[s\]; zero beyond. `at(t)` is the
    /// set point at a time t \[s\] relative to now.
    pub fn new(period: T, length: usize, at: impl Fn(T) -> SetPoint<T>) -> Self {
        let zero = T::zero();
        let near = |k: usize| match k < length {
            true => at(period * T::lit((k + 1) as f64)),
            false => SetPoint { position: zero, velocity: zero },
        };
        let known = T::lit(length as f64);
        let far = |k: usize| {
            let time = far_time(period, k + 1);
            T::select(time.lt((known + T::lit(0.5)) * period), at(time).position, zero)
        };
        Self {
            length: known,
            position: core::array::from_fn(|k| near(k).position),
            velocity: core::array::from_fn(|k| near(k).velocity),
            distant: core::array::from_fn(far),
        }
    }
}

/// Set points of the past control periods, the oldest first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PreviewBehind<T> {
    position: [T; PERIODS_BEHIND],
    velocity: [T; PERIODS_BEHIND],
}

impl<T: Copy> Memory<T> for PreviewBehind<T> {
    fn visited(self, visit: &mut impl FnMut(&'static str, T) -> T) -> Self {
        Self {
            position: self.position.map(|v| visit("reference_position_behind", v)),
            velocity: self.velocity.map(|v| visit("reference_velocity_behind", v)),
        }
    }
}

impl<T: Real> PreviewBehind<T> {
    /// Reference at rest at a position \[m\].
    pub fn at_rest(position: T) -> Self {
        Self { position: [position; PERIODS_BEHIND], velocity: [T::zero(); PERIODS_BEHIND] }
    }

    /// Reference at rest at a position \[m\] where `mask` holds, else unchanged.
    #[must_use]
    pub fn at_rest_where(&self, mask: T::Mask, position: T) -> Self {
        let rows: [[T; 2]; PERIODS_BEHIND] =
            core::array::from_fn(|k| [self.position[k], self.velocity[k]]);
        let (_, rows) = T::repeat(&rows, [], |_, [x, v], []| {
            ([], [T::select(mask, position, *x), T::select(mask, T::zero(), *v)])
        });
        Self { position: rows.map(|[x, _]| x), velocity: rows.map(|[_, v]| v) }
    }

    /// Shifts by a control period; `now` becomes the newest set point.
    pub fn advance(&mut self, now: SetPoint<T>) {
        self.position.copy_within(1.., 0);
        self.velocity.copy_within(1.., 0);
        self.position[PERIODS_BEHIND - 1] = now.position;
        self.velocity[PERIODS_BEHIND - 1] = now.velocity;
    }
}

/// Time of a distant set point after now \[s\].
#[inline(always)]
fn far_time<T: Real>(period: T, number: usize) -> T {
    period * T::lit(PERIODS_AHEAD as f64) + T::lit(number as f64 * FAR_SPACING)
}

impl<T: Real> Preview<T> {
    /// Preview of a known trajectory. `at(t)` is its set point at a time t \[s\] relative to now, also negative.
    ///
    /// `period` is the control period \[s\].
    pub fn new(period: T, at: impl Fn(T) -> SetPoint<T>) -> Self {
        let near = |k: usize| at(period * T::lit(k as f64 - PERIODS_BEHIND as f64));
        Self {
            position: core::array::from_fn(|k| near(k).position),
            velocity: core::array::from_fn(|k| near(k).velocity),
            far: core::array::from_fn(|k| at(far_time(period, k)).position),
            period,
        }
    }

    /// Preview from past, present and known future set points; these future ones are offset by `offset` \[m\]. Beyond
    /// them the velocity is constant.
    pub fn known(
        period: T,
        behind: &PreviewBehind<T>,
        now: SetPoint<T>,
        ahead: &PreviewAhead<T>,
        offset: T,
    ) -> Self {
        let half = T::lit(0.5);
        let rows: [[T; 2]; PERIODS_AHEAD] =
            core::array::from_fn(|k| [ahead.position[k], ahead.velocity[k]]);
        let begin = [now.position, now.velocity];
        let ([last, velocity], near) =
            T::repeat(&rows, begin, |k, [x, v], [position, velocity]| {
                let is_known = (k + half).lt(ahead.length);
                let position = T::select(is_known, *x + offset, velocity.mul_add(period, position));
                let velocity = T::select(is_known, *v, velocity);
                ([position, velocity], [position, velocity])
            });
        let end = (ahead.length + half) * period;
        let rows: [[T; 2]; DISTANT] =
            core::array::from_fn(|k| [ahead.distant[k], far_time(period, k + 1)]);
        let (_, far) = T::repeat(&rows, [last], |_, [x, time], [position]| {
            let kept = velocity.mul_add(T::lit(FAR_SPACING), position);
            let position = T::select(time.lt(end), *x + offset, kept);
            ([position], [position])
        });
        let place = |k: usize| k.checked_sub(PERIODS_BEHIND + 1);
        Self {
            position: core::array::from_fn(|k| match (behind.position.get(k), place(k)) {
                (Some(position), _) => *position,
                (None, Some(k)) => near[k][0],
                (None, None) => now.position,
            }),
            velocity: core::array::from_fn(|k| match (behind.velocity.get(k), place(k)) {
                (Some(velocity), _) => *velocity,
                (None, Some(k)) => near[k][1],
                (None, None) => now.velocity,
            }),
            far: core::array::from_fn(|k| match k.checked_sub(1) {
                Some(k) => far[k][0],
                None => last,
            }),
            period,
        }
    }

    /// Reference at rest at a position \[m\], with a control period \[s\].
    pub fn at_rest(period: T, position: T) -> Self {
        Self {
            position: [position; NEAR],
            velocity: [T::zero(); NEAR],
            far: [position; FAR],
            period,
        }
    }

    /// Shifts by a control period along a known trajectory. `at(t)` is its set point at a time t \[s\] relative to
    /// the new present.
    pub fn advance(&mut self, at: impl Fn(T) -> SetPoint<T>) {
        self.position.copy_within(1.., 0);
        self.velocity.copy_within(1.., 0);
        let newest = at(self.period * T::lit(PERIODS_AHEAD as f64));
        self.position[NEAR - 1] = newest.position;
        self.velocity[NEAR - 1] = newest.velocity;
        self.far = core::array::from_fn(|k| at(far_time(self.period, k)).position);
    }

    /// Shifts by a control period if only the present set point is known, as with a joystick; its velocity is
    /// extrapolated.
    pub fn advance_without_preview(&mut self, now: SetPoint<T>) {
        self.position.copy_within(1..=PERIODS_BEHIND, 0);
        self.velocity.copy_within(1..=PERIODS_BEHIND, 0);
        let at = |time: T| now.velocity.mul_add(time, now.position);
        for k in 0..=PERIODS_AHEAD {
            self.position[PERIODS_BEHIND + k] = at(self.period * T::lit(k as f64));
            self.velocity[PERIODS_BEHIND + k] = now.velocity;
        }
        self.far = core::array::from_fn(|k| at(far_time(self.period, k)));
    }

    /// Offsets all positions by a distance \[m\].
    pub fn shift(&mut self, distance: T) {
        for position in self.position.iter_mut().chain(&mut self.far) {
            *position = *position + distance;
        }
    }

    /// Present set point.
    pub fn now(&self) -> SetPoint<T> {
        SetPoint {
            position: self.position[PERIODS_BEHIND],
            velocity: self.velocity[PERIODS_BEHIND],
        }
    }

    /// Control period \[s\].
    pub fn period(&self) -> T {
        self.period
    }

    /// Set point at a time `after` \[s\] relative to now, by linear interpolation; constant beyond −300 and 800
    /// control periods.
    #[inline(always)]
    pub fn at(&self, after: T) -> SetPoint<T> {
        let place = after / self.period + T::lit(PERIODS_BEHIND as f64);
        SetPoint {
            position: T::interpolate(&self.position, place),
            velocity: T::interpolate(&self.velocity, place),
        }
    }

    /// Position \[m\] at a time `after` \[s\] relative to now, by linear interpolation; constant before −300 control
    /// periods and beyond 2.5 s, if the control period is 1 ms.
    #[inline(always)]
    pub fn position(&self, after: T) -> T {
        let near =
            T::interpolate(&self.position, after / self.period + T::lit(PERIODS_BEHIND as f64));
        let beyond = after - far_time(self.period, 0);
        let far = T::interpolate(&self.far, beyond / T::lit(FAR_SPACING));
        T::select(beyond.lt(T::zero()), near, far)
    }

    /// Largest magnitude of the reference's acceleration \[m/s²\], as a mean over 30 control periods, from 300 periods
    /// before to 780 after now.
    pub fn largest_acceleration(&self) -> T {
        const SPAN: usize = 30;
        let spans =
            self.velocity.iter().step_by(SPAN).zip(self.velocity.iter().skip(SPAN).step_by(SPAN));
        let span = self.period * T::lit(SPAN as f64);
        spans.fold(T::zero(), |most, (from, to)| most.max((*to - *from).abs() / span))
    }
}
