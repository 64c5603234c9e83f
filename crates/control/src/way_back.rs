//! The way back of a piston that was torn far off.
//!
//! A load that is hung on tears the piston off by centimetres, farther than position feedback may answer. If it asked for more the
//! farther off the piston is, it would swing it on: the motor moves oil, and what is asked for in phase with the position damps nothing. So a way
//! back is laid. It begins where position feedback reaches, is dragged along while the piston is torn farther, and leads back the slower the nearer it is.
//! The motor turns as that takes, and feedback sees by how much the piston is off its way: it brakes what comes back faster, not the way itself.
//!
//! Oil that gives stores what the motor delivers, and swings: braked as soon as it is faster than its way, the piston takes several swings home.
//! So nothing is braked that would not come home by the swing it is in. Where that was wrong the piston is torn off to the other side, and
//! there again: then the way back is wary for a while, slow and braked at once. So it is in motion, and while a reference that was out of reach is
//! caught up with: there it is soft oil that swings machine and simulated crane apart, each in its own time. Not so for what only a
//! load can hold: one that was lost or picked up on the way is led back as one at rest is.

use hydroboom_math::Real;

/// How fast a piston is brought back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WayBackDesign<T> {
    /// Velocity over distance \[1/s\], where the crane rings fast enough for it.
    pub rate: T,
    /// As long as the piston was torn off to one side.
    pub eager: Pace<T>,
    /// Once it was torn off to both.
    pub wary: Pace<T>,
}

/// How much of the motor and of the oil spring a way back may take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace<T> {
    /// Velocity over distance is no more than this share of the frequency \[rad/s\] at which the crane rings on its oil: the motor's oil is in the
    /// spring first.
    pub by_ring: T,
    /// The motor turns no faster for it \[rev/s\]. More than its limit leaves it there for longer.
    pub motor_speed: T,
}

/// How long it is remembered to which side a piston was torn off \[s\].
pub(crate) const REMEMBERED: f64 = 0.5;
/// Torn off so far to both sides \[m\], the piston swings for certain.
const SWINGS: f64 = 5e-3;
/// From so much of a way left on \[m\], if position feedback reaches no farther, braking may wait.
const LONG: f64 = 6e-3;

/// A piston that may be torn off.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Torn<T> {
    /// By how much it is off \[m\].
    pub stroke: T,
    /// How fast that grows \[m/s\].
    pub velocity: T,
    /// Frequency at which it rings on its oil \[rad/s\].
    pub ring: T,
    /// Position feedback reaches so far \[m\].
    pub reach: T,
    /// What a velocity takes of the motor \[rev/m\].
    pub speed_per_velocity: T,
    /// From 0, torn off to one side, to 1, swinging.
    pub wary: T,
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
    /// Share of what would brake the piston that is not asked for yet, 0 to 1.
    pub unbraked: T,
}

/// How far ways back led on either side, of late \[m\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sides<T> {
    pub above: T,
    pub below: T,
}

impl<T: Real> Sides<T> {
    /// A period later, `left` of a way being left, and such a share of what is remembered being kept.
    #[inline(always)]
    pub(crate) fn later(&self, left: T, keeps: T) -> Self {
        Self { above: (keeps * self.above).max(left), below: (keeps * self.below).max(-left) }
    }

    /// From 0, torn off to one side, to 1, swinging.
    #[inline(always)]
    pub(crate) fn wary(&self) -> T {
        (self.above.min(self.below) / T::lit(SWINGS)).clamp(T::zero(), T::one())
    }
}

impl<T: Real> WayBackDesign<T> {
    /// The way of a piston, `left` \[m\] being left of it before.
    #[inline(always)]
    pub(crate) fn on(&self, torn: &Torn<T>, left: T) -> WayBack<T> {
        let Torn { stroke, reach, speed_per_velocity, .. } = *torn;
        let left = left.clamp(stroke - reach, stroke + reach);
        let (rate, most) = self.pace(torn);
        let motor_speed = (-rate * left * speed_per_velocity).clamp(-most, most);
        let velocity = motor_speed / speed_per_velocity;
        WayBack { left, velocity, motor_speed, unbraked: torn.unbraked(left) }
    }

    /// Velocity over distance \[1/s\], and the most that the motor turns \[rev/s\].
    #[inline(always)]
    fn pace(&self, torn: &Torn<T>) -> (T, T) {
        let Self { rate, eager, wary } = *self;
        let between = |eager: T, wary: T| eager + torn.wary * (wary - eager);
        let by_ring = between(eager.by_ring, wary.by_ring);
        (rate.min(by_ring * torn.ring), between(eager.motor_speed, wary.motor_speed))
    }
}

impl<T: Real> Torn<T> {
    /// Share of what would brake the piston that is not asked for yet.
    ///
    /// A velocity v carries it by v/ω on its oil: no braking where that is half of what it is off by, all of it where it is the whole. Less of it may
    /// wait by the end of a way, `left` \[m\], for there position feedback brings the piston home.
    #[inline(always)]
    fn unbraked(&self, left: T) -> T {
        let (zero, one) = (T::zero(), T::one());
        let off = T::select(left.lt(zero), -self.stroke, self.stroke);
        let home = T::select(left.lt(zero), self.velocity, -self.velocity);
        let carried = home / self.ring;
        let waits = (T::lit(2.0) * (off - carried) / off.max(T::lit(1e-6))).clamp(zero, one);
        let long = (left.abs() / self.reach.max(T::lit(LONG))).min(one);
        T::select(zero.lt(off), waits * long * (one - self.wary), zero)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DESIGN: WayBackDesign<f64> = WayBackDesign {
        rate: 4.0,
        eager: Pace { by_ring: 0.8, motor_speed: 35.0 },
        wary: Pace { by_ring: 0.4, motor_speed: 10.0 },
    };
    const PERIOD: f64 = 1e-3;
    const REACH: f64 = 5e-3;
    const TORN: Torn<f64> = Torn {
        stroke: 0.0,
        velocity: 0.0,
        ring: 15.0,
        reach: REACH,
        speed_per_velocity: 300.0,
        wary: 0.0,
    };

    /// What is left of the way after so long \[s\], of a piston that goes as it is led.
    fn left_after(seconds: f64, begins: f64) -> f64 {
        let mut stroke = begins;
        let mut left = 0.0;
        for _ in 0..(seconds / PERIOD).round() as u32 {
            let way = DESIGN.on(&Torn { stroke, ..TORN }, left);
            stroke += PERIOD * way.velocity;
            left = way.left + PERIOD * way.velocity;
        }
        left
    }

    #[test]
    fn what_is_near_needs_no_way_back() {
        for stroke in [0.0, 0.9 * REACH, -REACH] {
            let way = DESIGN.on(&Torn { stroke, velocity: 0.1, ..TORN }, 0.0);
            let nothing = WayBack { left: 0.0, velocity: 0.0, motor_speed: 0.0, unbraked: 0.0 };
            assert_eq!(way, nothing);
        }
    }

    /// Near its end it falls as exp(−rate t), on either side.
    #[test]
    fn it_leads_back_the_slower_the_nearer_it_is() {
        for begins in [0.015, -0.015] {
            let [once, later] = [0.5, 0.75].map(|time| left_after(time, begins));
            assert!((later / once / (-0.25 * DESIGN.rate).exp() - 1.0).abs() < 1e-2);
            assert!(once.abs() < (begins.abs() - REACH) * (-0.49 * DESIGN.rate).exp());
        }
    }

    #[test]
    fn the_motor_turns_no_faster_for_it_than_it_may() {
        for (wary, pace) in [(0.0, DESIGN.eager), (1.0, DESIGN.wary)] {
            let way = DESIGN.on(&Torn { stroke: -0.3, wary, ..TORN }, 0.0);
            assert_eq!(way.motor_speed, pace.motor_speed);
            assert!((way.velocity * TORN.speed_per_velocity - pace.motor_speed).abs() < 1e-12);
        }
    }

    /// A piston that is torn farther drags it along, one that comes back by itself shortens it.
    #[test]
    fn it_is_never_farther_from_the_piston_than_feedback_reaches() {
        let mut left = 0.0;
        for k in 0..3000 {
            let stroke = 0.1 * (7.0 * PERIOD * f64::from(k)).sin();
            let way = DESIGN.on(&Torn { stroke, ..TORN }, left);
            assert!((way.left - stroke).abs() <= REACH + 1e-12);
            left = way.left + PERIOD * way.velocity;
        }
    }

    #[test]
    fn on_soft_oil_it_takes_longer_and_longest_for_what_swings() {
        let rate = |ring, wary| DESIGN.pace(&Torn { ring, wary, ..TORN }).0;
        assert_eq!(rate(15.0, 0.0), 4.0);
        assert_eq!(rate(4.0, 0.0), 3.2);
        assert_eq!(rate(4.0, 1.0), 1.6);
    }

    /// An oil spring that is at rest at home passes it where it has v/ω to go, half of its energy being in the spring: nothing is braked until it is
    /// halfway there, all of it once it would pass.
    #[test]
    fn it_is_not_braked_before_it_would_come_home() {
        let off = 0.05;
        for side in [1.0, -1.0] {
            let unbraked = |carried: f64| {
                let velocity = -side * carried * TORN.ring;
                let torn = Torn { stroke: side * off, velocity, ..TORN };
                DESIGN.on(&torn, side * (off - REACH)).unbraked
            };
            assert_eq!(unbraked(-off), 1.0, "it is torn farther");
            assert_eq!([0.0, 0.5 * off].map(unbraked), [1.0; 2]);
            assert!((unbraked(0.75 * off) - 0.5).abs() < 1e-12);
            assert_eq!([off, 2.0 * off].map(unbraked), [0.0; 2]);
        }
    }

    /// What is left of a way when the piston is home, or past it, is not to keep position feedback from holding it there.
    #[test]
    fn by_the_end_of_its_way_it_is_braked() {
        let unbraked = |stroke, left| DESIGN.on(&Torn { stroke, ..TORN }, left).unbraked;
        assert_eq!(unbraked(-1e-3, 3e-3), 0.0);
        assert_eq!(unbraked(0.0, 3e-3), 0.0);
        let short = unbraked(3e-3, 6e-4);
        assert!((short - 0.1).abs() < 1e-12, "{short}");
    }

    #[test]
    fn what_was_torn_off_to_both_sides_is_led_warily_for_a_while() {
        let keeps = (-PERIOD / REMEMBERED).exp();
        let mut sides = Sides { above: 0.0, below: 0.0 };
        for _ in 0..1000 {
            sides = sides.later(0.05, keeps);
        }
        assert_eq!(sides.wary(), 0.0, "one side is no swing");
        sides = sides.later(-0.05, keeps);
        assert_eq!(sides.wary(), 1.0);
        let torn = Torn { stroke: -0.05, wary: sides.wary(), ..TORN };
        assert_eq!(DESIGN.on(&torn, -0.05).unbraked, 0.0);
        for _ in 0..(3.0 * REMEMBERED / PERIOD) as u32 {
            sides = sides.later(0.0, keeps);
        }
        assert!((sides.wary() - (0.05 * (-3.0_f64).exp() / SWINGS)).abs() < 1e-2, "{sides:?}");
    }
}
