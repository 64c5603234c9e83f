//! Reference preview: the set points of the next seconds, and of the last three tenths.

use crate::reference::profile::SetPoint;
use hydroboom_math::Real;

/// Control periods before now of which every set point is kept.
pub const PERIODS_BEHIND: usize = 300;
/// Control periods after now.
pub const PERIODS_AHEAD: usize = 800;
const NEAR: usize = PERIODS_BEHIND + 1 + PERIODS_AHEAD;

/// Time between two distant set points \[s\], from the end of the near ones to 2.5 s after now.
const FAR_SPACING: f64 = 0.05;
/// Distant set points, the first 800 periods after now.
const FAR: usize = 35;

/// Set points at fixed times relative to now: every control period from 300 periods before it to 800 after it, and positions every 50 ms for
/// 1.7 s more: to 2.5 s where the control period is 1 ms. Moved on by [`advance`](Self::advance) once a period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Preview<T> {
    position: [T; NEAR],
    velocity: [T; NEAR],
    far: [T; FAR],
    period: T,
}

/// Time of a distant set point after now \[s\].
#[inline(always)]
fn far_time<T: Real>(period: T, number: usize) -> T {
    period * T::lit(PERIODS_AHEAD as f64) + T::lit(number as f64 * FAR_SPACING)
}

impl<T: Real> Preview<T> {
    /// A trajectory that is known ahead: `at` is its set point so long \[s\] after now, and before now where that is negative.
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

    /// A reference that rests at a position \[m\].
    pub fn at_rest(period: T, position: T) -> Self {
        Self {
            position: [position; NEAR],
            velocity: [T::zero(); NEAR],
            far: [position; FAR],
            period,
        }
    }

    /// Moves on by a control period along a trajectory that is known ahead, `at` being its set point so long \[s\] after the new now.
    pub fn advance(&mut self, at: impl Fn(T) -> SetPoint<T>) {
        self.position.copy_within(1.., 0);
        self.velocity.copy_within(1.., 0);
        let newest = at(self.period * T::lit(PERIODS_AHEAD as f64));
        self.position[NEAR - 1] = newest.position;
        self.velocity[NEAR - 1] = newest.velocity;
        self.far = core::array::from_fn(|k| at(far_time(self.period, k)).position);
    }

    /// Moves on by a control period where only the set point of now is known, as with a joystick: it is taken to keep its velocity.
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

    /// Moves the whole trajectory by a distance \[m\].
    pub fn shift(&mut self, distance: T) {
        for position in self.position.iter_mut().chain(&mut self.far) {
            *position = *position + distance;
        }
    }

    /// The set point of now.
    pub fn now(&self) -> SetPoint<T> {
        SetPoint {
            position: self.position[PERIODS_BEHIND],
            velocity: self.velocity[PERIODS_BEHIND],
        }
    }

    /// The control period \[s\].
    pub fn period(&self) -> T {
        self.period
    }

    /// Position and velocity so long \[s\] after now: between −300 and 800 periods, beyond that those at the ends.
    #[inline(always)]
    pub fn at(&self, after: T) -> SetPoint<T> {
        let place = after / self.period + T::lit(PERIODS_BEHIND as f64);
        SetPoint {
            position: T::interpolate(&self.position, place),
            velocity: T::interpolate(&self.velocity, place),
        }
    }

    /// Position \[m\] so long \[s\] after now, between −0.2 and 2.5 s: beyond 0.8 s, linear between the distant set points.
    #[inline(always)]
    pub fn position(&self, after: T) -> T {
        let near =
            T::interpolate(&self.position, after / self.period + T::lit(PERIODS_BEHIND as f64));
        let beyond = after - far_time(self.period, 0);
        let far = T::interpolate(&self.far, beyond / T::lit(FAR_SPACING));
        T::select(beyond.lt(T::zero()), near, far)
    }

    /// Largest acceleration \[m/s²\] of the reference between −0.2 and 0.8 s, as the mean over 30 ms.
    pub fn largest_acceleration(&self) -> T {
        const SPAN: usize = 30;
        let spans =
            self.velocity.iter().step_by(SPAN).zip(self.velocity.iter().skip(SPAN).step_by(SPAN));
        let span = self.period * T::lit(SPAN as f64);
        spans.fold(T::zero(), |most, (from, to)| most.max((*to - *from).abs() / span))
    }
}
