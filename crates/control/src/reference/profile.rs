//! Velocity profiles: a move from point to point with trapezoidal or S-shaped ramps, and the motion of section 5.3
//! made of two such moves, out, dwell and back.

use hydroboom_math::{Real, record};

record! {
    /// Set point of the piston: position and velocity.
    pub struct SetPoint<T> {
        /// Position, x_ref
        #[unit = "m"]
        pub position: T,
        /// Velocity, v_ref
        #[unit = "m/s"]
        pub velocity: T,
    }
}

/// Shape of the velocity ramps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RampShape {
    /// Linear ramps, as published: steps in acceleration.
    Trapezoidal,
    /// Ramps `3 s² − 2 s³`, s being the ramp's elapsed share: continuous acceleration, limited
    /// jerk of `6 v/t_a²` and a peak acceleration 1.5 times the trapezoid's.
    SCurve,
}

/// Motion of section 5.3 from `start` to `end` and back, with a dwell between.
///
/// ```
/// use hydroboom_control::reference::profile::{OutAndBack, RampShape};
///
/// let profile = RampShape::Trapezoidal;
/// let motion =
///     OutAndBack::<f64> { start: 0.1, end: 0.3, speed: 0.1, ramp: 0.5, dwell: 1.0, rest: 2.0, profile };
/// // 0.2 m at 0.1 m/s, longer by one ramp
/// assert!((motion.travel_time() - 2.5).abs() < 1e-12);
/// let dwelling = motion.reference(motion.rest + motion.travel_time() + 0.5);
/// assert!((dwelling.position - 0.3).abs() < 1e-12 && dwelling.velocity.abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutAndBack<T> {
    /// Initial position \[m\].
    pub start: T,
    /// Far position \[m\].
    pub end: T,
    /// Speed between the ramps \[m/s\], positive.
    pub speed: T,
    /// Duration of each ramp \[s\], positive.
    pub ramp: T,
    /// Duration of the rest at the far position \[s\], not negative.
    pub dwell: T,
    /// Duration of the rest before and after the motion \[s\], not negative.
    pub rest: T,
    /// Shape of the ramps.
    pub profile: RampShape,
}

impl<T: Real> OutAndBack<T> {
    /// Duration of a single move, |`end` − `start`|/`speed` + `ramp` \[s\].
    pub fn travel_time(&self) -> T {
        (self.end - self.start).abs() / self.speed + self.ramp
    }

    /// Duration of the whole motion \[s\], rests included.
    pub fn duration(&self) -> T {
        let two = T::lit(2.0);
        two * self.rest + two * self.travel_time() + self.dwell
    }

    /// Set point at the time `t` \[s\]; at rest before 0 and after [`duration`](Self::duration).
    #[inline(always)]
    pub fn reference(&self, t: T) -> SetPoint<T> {
        let travel = self.travel_time();
        let out = self.one_way(t - self.rest);
        let back = self.one_way(t - self.rest - travel - self.dwell);
        let way = self.end - self.start;
        let sign = T::select(way.lt(T::zero()), -T::one(), T::one());
        SetPoint {
            position: self.start + sign * (out.position - back.position),
            velocity: sign * (out.velocity - back.velocity),
        }
    }

    /// Distance and speed of one way, begun at t = 0.
    #[inline(always)]
    fn one_way(&self, t: T) -> SetPoint<T> {
        let way = (self.end - self.start).abs();
        PointToPoint { distance: way, speed: self.speed, ramp: self.ramp, profile: self.profile }
            .at(t)
    }
}

/// Point-to-point move from t = 0, with velocity ramps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointToPoint<T> {
    /// Distance \[m\], not negative.
    pub distance: T,
    /// Speed between the ramps \[m/s\], positive; a distance too short to reach it has a lower peak speed.
    pub speed: T,
    /// Duration of each ramp \[s\], positive.
    pub ramp: T,
    /// Shape of the ramps.
    pub profile: RampShape,
}

impl<T: Real> PointToPoint<T> {
    /// Duration of the move, `distance`/`speed` + `ramp` \[s\].
    pub fn duration(&self) -> T {
        self.distance / self.speed + self.ramp
    }

    /// Travelled distance \[m\] and speed \[m/s\] at the time `t` \[s\]: zero before 0, at rest at the end of the
    /// distance after [`duration`](Self::duration).
    #[inline(always)]
    pub fn at(&self, t: T) -> SetPoint<T> {
        // the speed is the rise begun at 0 less the one begun at the end of the cruise
        let (rise, risen) = self.ramp_up(t);
        let (fall, fallen) = self.ramp_up(t - self.distance / self.speed);
        SetPoint { position: self.speed * (risen - fallen), velocity: self.speed * (rise - fall) }
    }

    /// A ramp from 0 to 1 begun at t = 0, and its integral.
    #[inline(always)]
    fn ramp_up(&self, t: T) -> (T, T) {
        let s = (t / self.ramp).clamp(T::zero(), T::one());
        let after = (t - self.ramp).max(T::zero());
        let half = T::lit(0.5);
        match self.profile {
            RampShape::Trapezoidal => (s, half * s.square() * self.ramp + after),
            RampShape::SCurve => {
                let rise = s.square() * (T::lit(3.0) - T::lit(2.0) * s);
                (rise, s.square() * s * (T::one() - half * s) * self.ramp + after)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_math::Dual;

    fn published(profile: RampShape) -> OutAndBack<f64> {
        OutAndBack {
            start: 0.05,
            end: 0.45,
            speed: 0.12,
            ramp: 1.0,
            dwell: 5.0,
            rest: 2.0,
            profile,
        }
    }

    #[test]
    fn the_motion_extends_dwells_and_retracts() {
        for profile in [RampShape::Trapezoidal, RampShape::SCurve] {
            let motion = published(profile);
            let travel = 0.4 / 0.12 + 1.0;
            assert!((motion.duration() - (2.0 * travel + 9.0)).abs() < 1e-12);
            for (t, position) in [
                (0.0, 0.05),
                (2.0, 0.05),
                (2.0 + travel, 0.45),
                (7.0 + travel, 0.45),
                (motion.duration(), 0.05),
            ] {
                let reference = motion.reference(t);
                assert!((reference.position - position).abs() < 1e-12, "{t}: {reference:?}");
                assert!(reference.velocity.abs() < 1e-12, "{t}: {reference:?}");
            }
            assert!((motion.reference(4.0).velocity - 0.12).abs() < 1e-12);
        }
    }

    #[test]
    fn a_travel_too_short_for_its_speed_still_ends_at_rest() {
        for profile in [RampShape::Trapezoidal, RampShape::SCurve] {
            let way = PointToPoint { distance: 0.01, speed: 0.12, ramp: 1.0, profile };
            let end = way.at(way.duration());
            assert!((end.position - 0.01).abs() < 1e-12 && end.velocity.abs() < 1e-12, "{end:?}");
            let fastest =
                (0..1100).map(|k| way.at(f64::from(k) * 1e-3).velocity).fold(0.0, f64::max);
            assert!(fastest < 0.02, "{fastest} m/s");
        }
    }

    #[test]
    fn velocity_is_the_derivative_of_the_position() {
        for profile in [RampShape::Trapezoidal, RampShape::SCurve] {
            let m = published(profile);
            let c = Dual::<f64, 1>::constant;
            let motion = OutAndBack {
                start: c(m.start),
                end: c(m.end),
                speed: c(m.speed),
                ramp: c(m.ramp),
                dwell: c(m.dwell),
                rest: c(m.rest),
                profile,
            };
            for i in 0..1000 {
                let reference = motion.reference(Dual::variable(0.0173 * f64::from(i), 0));
                let (slope, velocity) = (reference.position.slope[0], reference.velocity.value);
                assert!((slope - velocity).abs() < 1e-12, "{slope} against {velocity}");
            }
        }
    }
}
