//! The way back of a piston that was torn far off.
//!
//! A load that is hung on tears the piston off by centimetres, farther than position feedback may answer. If it asked for more the
//! farther off the piston is, it would swing it on: the motor moves oil, and what is asked for in phase with the position damps nothing. So a way
//! back is laid. It begins where position feedback reaches, is dragged along while the piston is torn farther, and leads back the slower the nearer it is.
//! The motor turns as that takes, and feedback sees by how much the piston is off its way: it brakes what comes back faster, not the way itself.

use hydroboom_math::Real;

/// How fast a piston is brought back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WayBackDesign<T> {
    /// Velocity over distance \[1/s\], where the crane rings fast enough for it.
    pub rate: T,
    /// No more than this share of the frequency \[rad/s\] at which it rings on its oil: the motor's oil is in the spring first.
    pub by_ring: T,
    /// The motor turns no faster for it \[rev/s\].
    pub motor_speed: T,
}

/// Where a piston that was torn off should be by now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct WayBack<T> {
    /// What is left of the way, with its sign \[m\].
    pub left: T,
    /// How fast it leads back \[m/s\].
    pub velocity: T,
    /// What the motor turns for that \[rev/s\].
    pub motor_speed: T,
}

impl<T: Real> WayBackDesign<T> {
    /// Velocity over distance \[1/s\] of a crane that rings at a frequency \[rad/s\].
    #[inline(always)]
    pub(crate) fn rate(&self, ring: T) -> T {
        self.rate.min(self.by_ring * ring)
    }

    /// The way of a piston that is off by `stroke` \[m\], `left` \[m\] being left of it before. Position feedback reaches so far \[m\]; a velocity
    /// takes so much of the motor \[rev/m\].
    #[inline(always)]
    pub(crate) fn on(
        &self,
        rate: T,
        left: T,
        stroke: T,
        reach: T,
        speed_per_velocity: T,
    ) -> WayBack<T> {
        let left = left.clamp(stroke - reach, stroke + reach);
        let motor_speed =
            (-rate * left * speed_per_velocity).clamp(-self.motor_speed, self.motor_speed);
        WayBack { left, velocity: motor_speed / speed_per_velocity, motor_speed }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DESIGN: WayBackDesign<f64> = WayBackDesign { rate: 4.0, by_ring: 0.4, motor_speed: 35.0 };
    const PERIOD: f64 = 1e-3;
    const REACH: f64 = 5e-3;
    const SPEED_PER_VELOCITY: f64 = 300.0;

    /// What is left of the way after so long \[s\], of a piston that goes as it is led.
    fn left_after(seconds: f64, begins: f64, rate: f64) -> f64 {
        let mut stroke = begins;
        let mut left = 0.0;
        for _ in 0..(seconds / PERIOD).round() as u32 {
            let way = DESIGN.on(rate, left, stroke, REACH, SPEED_PER_VELOCITY);
            stroke += PERIOD * way.velocity;
            left = way.left + PERIOD * way.velocity;
        }
        left
    }

    #[test]
    fn what_is_near_needs_no_way_back() {
        for stroke in [0.0, 0.9 * REACH, -REACH] {
            let way = DESIGN.on(4.0, 0.0, stroke, REACH, SPEED_PER_VELOCITY);
            assert_eq!((way.left, way.velocity, way.motor_speed), (0.0, 0.0, 0.0));
        }
    }

    /// Near its end it falls as exp(−rate t), on either side.
    #[test]
    fn it_leads_back_the_slower_the_nearer_it_is() {
        for begins in [0.015, -0.015] {
            let rate = 4.0;
            let [once, later] = [0.5, 0.75].map(|time| left_after(time, begins, rate));
            assert!((later / once / (-0.25 * rate).exp() - 1.0).abs() < 1e-2, "{once} {later}");
            assert!(once.abs() < (begins.abs() - REACH) * (-0.49 * rate).exp());
        }
    }

    #[test]
    fn the_motor_turns_no_faster_for_it_than_it_may() {
        let way = DESIGN.on(4.0, 0.0, -0.3, REACH, SPEED_PER_VELOCITY);
        assert_eq!(way.motor_speed, DESIGN.motor_speed);
        assert!((way.velocity * SPEED_PER_VELOCITY - DESIGN.motor_speed).abs() < 1e-12);
    }

    /// A piston that is torn farther drags it along, one that comes back by itself shortens it.
    #[test]
    fn it_is_never_farther_from_the_piston_than_feedback_reaches() {
        let mut left = 0.0;
        for k in 0..3000 {
            let stroke = 0.1 * (7.0 * PERIOD * f64::from(k)).sin();
            let way = DESIGN.on(4.0, left, stroke, REACH, SPEED_PER_VELOCITY);
            assert!((way.left - stroke).abs() <= REACH + 1e-12);
            left = way.left + PERIOD * way.velocity;
        }
    }

    #[test]
    fn on_soft_oil_it_takes_longer() {
        assert_eq!(DESIGN.rate(15.0), 4.0);
        assert_eq!(DESIGN.rate(5.0), 2.0);
    }
}
