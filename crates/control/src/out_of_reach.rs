//! A reference that is out of the motor's reach.
//!
//! A simulated crane whose motor is at its limit swings as soft oil lets it, and the machine swings otherwise. Feedback would brake a machine that is
//! ahead of the simulated crane, though both are behind the reference: what it loses by that, nobody makes good for.

use crate::reference::profile::SetPoint;
use hydroboom_math::Real;

/// A reference slower than this rests \[m/s\].
pub(crate) const AT_REST: f64 = 1e-4;
/// The motor counts as at its limit from this share of its speed on, all the more the nearer.
const NEAR: f64 = 0.8;
/// A reference is out of reach once it is this far away \[m\], all the more the nearer to that.
const FAR: f64 = 2e-3;
/// It is within reach for a machine that will have come up with it in that time \[s\]: that has to be braked.
const COMES_UP: f64 = 0.15;

/// What a machine is led by beside the simulated crane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Led<T> {
    /// Where it is to be.
    pub reference: SetPoint<T>,
    /// By how much that runs ahead of what any crane can follow \[m\].
    pub ahead: T,
    /// What a motor turns for what can be followed \[rev/s\].
    pub motor_speed: T,
    /// What it turns at most for travel along all of the course \[rev/s\]; 0 where a course is not known ahead.
    pub travels: T,
}

impl<T: Real> Led<T> {
    /// From 0, at rest where it is to be, to 1: on the way, or far behind a reference that no crane can follow.
    #[inline(always)]
    pub(crate) fn on_the_way(&self) -> T {
        let one = T::one();
        let behind = (self.ahead.abs() / T::lit(FAR)).min(one);
        T::select(T::lit(AT_REST).lt(self.reference.velocity.abs()), one, behind)
    }

    /// Speed \[rev/s\] for a machine at `stroke` \[m\] that moves by `velocity` \[m/s\], of which feedback wants a `speed` \[rev/s\]. What leads it
    /// takes `feedforward` \[rev/s\], or what the reference does, whichever is farther that way, of a motor that has `limit` \[rev/s\].
    #[inline(always)]
    pub(crate) fn not_braked(
        &self,
        speed: T,
        feedforward: T,
        limit: T,
        [stroke, velocity]: [T; 2],
    ) -> T {
        let Self { reference, ahead, motor_speed, .. } = *self;
        let (zero, one) = (T::zero(), T::one());
        let behind = reference.position - stroke;
        let closing = velocity - reference.velocity;
        let direction = T::select(behind.lt(zero), -one, one);
        let still_behind = behind.abs() - T::lit(COMES_UP) * (direction * closing).max(zero);
        let leading = (direction * feedforward).max(direction * motor_speed);
        let far = still_behind.min(direction * ahead).max(zero) / T::lit(FAR);
        let near = (leading / limit - T::lit(NEAR)) / T::lit(1.0 - NEAR);
        let braked = leading.clamp(-limit, limit) - direction * speed;
        speed + direction * near.clamp(zero, one) * far.min(one) * braked.max(zero)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT: f64 = 50.0;

    /// Of a machine that is behind, and comes up with a reference at rest.
    fn told(speed: f64, leading: [f64; 2], behind: f64, closing: f64, ahead: f64) -> f64 {
        let [feedforward, motor_speed] = leading;
        let reference = SetPoint { position: behind, velocity: 0.0 };
        let led = Led { reference, ahead, motor_speed, travels: 0.0 };
        led.not_braked(speed, feedforward, LIMIT, [0.0, closing])
    }

    #[test]
    fn at_the_limit_a_machine_that_is_behind_the_reference_is_not_braked() {
        for side in [1.0, -1.0] {
            let told = |speed: f64, leading: f64, behind: f64, ahead: f64| {
                let [speed, leading, behind, ahead] =
                    [speed, leading, behind, ahead].map(|value| side * value);
                side * told(speed, [0.0, leading], behind, -side * 0.1, ahead)
            };
            assert_eq!(told(30.0, 51.0, 5e-3, 8e-3), LIMIT);
            // what drives it on is feedback's
            assert_eq!(told(49.0, 45.0, 5e-3, 8e-3), 49.0);
            // a motor that has speed left brings it back in time
            assert_eq!(told(20.0, 39.0, 5e-3, 8e-3), 20.0);
            // it is past the reference, or the reference within reach
            for (behind, ahead) in [(-5e-3, 8e-3), (5e-3, 0.0), (5e-3, -8e-3), (0.0, 8e-3)] {
                assert_eq!(told(30.0, 51.0, behind, ahead), 30.0);
            }
        }
    }

    #[test]
    fn a_machine_that_comes_up_with_the_reference_is_braked_in_time() {
        let (behind, fast) = (20e-3, 20e-3 / COMES_UP);
        let told = |closing| told(30.0, [LIMIT, LIMIT], behind, closing, 1.0);
        assert_eq!((told(fast), told(0.5 * fast), told(-fast)), (30.0, LIMIT, LIMIT));
    }

    #[test]
    fn it_is_let_go_of_without_a_jump() {
        let told = |leading, behind| told(30.0, [leading, 0.0], behind, 0.0, 1.0);
        for k in 0..1000 {
            let share = f64::from(k) * 1e-3;
            let (leading, behind) = (LIMIT * share, FAR * share);
            assert!((told(leading + 0.05, FAR) - told(leading, FAR)).abs() < 0.2);
            assert!((told(LIMIT, behind + 1e-3 * FAR) - told(LIMIT, behind)).abs() < 0.03);
        }
    }

    #[test]
    fn it_is_on_the_way_while_it_moves_or_is_far_behind() {
        let on_the_way = |velocity, ahead| {
            let reference = SetPoint { position: 0.2, velocity };
            Led { reference, ahead, motor_speed: 0.0, travels: 0.0 }.on_the_way()
        };
        assert_eq!(
            [on_the_way(0.0, 0.0), on_the_way(0.0, -FAR), on_the_way(0.01, 0.0)],
            [0.0, 1.0, 1.0]
        );
        assert!((on_the_way(0.0, 0.25 * FAR) - 0.25).abs() < 1e-12);
    }
}
