//! Model following: the simulated crane is made to follow the reference, and the machine the simulated crane.
//!
//! ```text
//! reference -> state feedback -> simulated crane -> its motor speed, state
//!                                                        |          |
//!                              machine <- motor speed <- (+) <- observer and feedback of what the machine differs
//! ```
//!
//! The simulation's state is known and free of noise, so that its loop may be as fast as the machine is to be steered. What
//! it asks of its motor is the feedforward. Feedback from the machine then sees only by how much it differs from the simulation, and damps what
//! is already damped no second time.

use crate::actuator_limits::ActuatorLimits;
use crate::attainable::{Attainable, ReferenceMemory};
use crate::controller::AxisState;
use crate::deviation::DeviationFeedback;
use crate::feedback::filter::{Notch, NotchMemory};
use crate::oil_spring::{Gains, OilSpring};
use crate::oil_stiffness::OilStiffness;
use crate::reference::profile::SetPoint;
use crate::reserve::Reserve;
use crate::station::Station;
use hydroboom_math::{Real, record};

record! {
    /// What the state feedback remembers.
    pub struct FollowingMemory<T> {
        /// Lag of the position, summed up
        #[unit = "m s"]
        pub lag: T,
        /// By how much the reference runs ahead of what the crane can follow
        #[unit = "m"]
        pub ahead: T,
        /// Of that, what came of a velocity beyond the motor's
        #[unit = "m"]
        pub too_fast: T,
        /// Velocity that what it can follow should have, a period ago
        #[unit = "m/s"]
        pub wanted_velocity: T,
        /// Velocity that it had
        #[unit = "m/s"]
        pub reference_velocity: T,
        /// Its load pressure beyond what holds the crane at rest
        #[unit = "Pa"]
        pub moving_pressure: T,
        /// Motor speed that it takes
        #[unit = "rev/s"]
        pub reference_speed: T,
        /// Share of feedback, smoothed
        #[unit = "rev/s"]
        pub feedback: T,
        /// What the first notch takes from the last share to the next
        #[unit = "rev/s"]
        pub notch_1_next: T,
        /// What it takes to that after it
        #[unit = "rev/s"]
        pub notch_1_after: T,
        /// What the second notch takes from the last share to the next
        #[unit = "rev/s"]
        pub notch_2_next: T,
        /// What it takes to that after it
        #[unit = "rev/s"]
        pub notch_2_after: T,
        /// Speed of the simulated motor
        #[unit = "rev/s"]
        pub motor_speed: T,
    }
}

/// What state feedback asks for.
struct Wanted<T> {
    /// Motor speed that the reference takes \[rev/s\].
    feedforward: T,
    /// What a position that is behind, and has been, adds where the oil is as stiff as it is wanted to be \[rev/s\]; and the most it may.
    back: [T; 2],
    /// What damping adds there \[rev/s\].
    damping: T,
    /// How much more of both it takes in the oil as it is.
    softer: T,
    /// The most that both may ask for together \[rev/s\].
    authority: T,
    /// How far the simulated crane is behind \[m\].
    lag: T,
    /// What the lag summed up is worth \[rev/(s² m)\].
    by_lag: T,
}

/// The simulated motor may turn faster than the machine's by this factor, so that the simulated crane is damped where the machine's motor is at
/// its limit: the reference takes no more than that has.
const BEYOND: f64 = 1.03;
/// State feedback swings the simulated motor no farther than takes this share of its slew at the frequency at which the crane rings. A motor that
/// comes later than it is asked to drives a crane that it should damp, by decimetres where a stop is so short that the pressure dips.
const SLEWS: f64 = 0.5;
/// Nor by more than this share of its speed: on soft oil, which rings slowly, a stop would take all of it.
const AUTHORITY: f64 = 0.35;
/// A position that is behind asks for no more than this share of that, beside what friction takes, so that it leaves some to damping: else it comes
/// back undamped, and too far.
const POSITION: f64 = 0.85;
/// Feedback is raised by no more than this where the pressure dips into soft oil.
const SOFTEST: f64 = 2.0;

/// Modes of bending that notches keep out.
pub const BENDING: usize = 2;
/// Damping ratios of a notch, of its zeros and its poles: deep and wide enough for a mode that is a tenth beside it.
const NOTCH: [f64; 2] = [0.03, 1.2];

/// Piston positions at which the simulated crane is known; in between it is interpolated.
pub const STATIONS: usize = 17;

/// State feedback, with integral action, that makes the simulated crane follow the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelFollowing<T> {
    /// The crane at positions evenly spread over the stroke.
    pub stations: [Station<T>; STATIONS],
    /// Position of the first \[m\].
    pub first: T,
    /// Distance between two \[m\].
    pub spacing: T,
    /// Load pressure that overcomes Coulomb friction \[Pa\].
    pub friction_pressure: T,
    /// Piston speed at which friction has changed its sign by three quarters \[m/s\].
    pub friction_speed: T,
    /// The oil's stiffness.
    pub stiffness: OilStiffness<T>,
    /// How far the pressure at which it stiffens may be from where it is thought to be, by standard deviation \[Pa\].
    pub doubt: T,
    /// What the piston side has beyond the load pressure, for the rod side \[Pa\].
    pub beyond_load: T,
    /// Frequencies of the boom's first modes of bending \[rad/s\], which are not to be fed back.
    pub bending: [T; BENDING],
    /// Keep them out.
    pub notches: [Notch<T>; BENDING],
    /// What of a change of the feedback's share is followed in a period: higher bending is not to be fed back either.
    pub smoothing: T,
    /// Time from a command to what is read of it \[s\]: so far the simulated crane is ahead of the reference.
    pub lead: T,
    /// Feedback of what the machine differs.
    pub deviation: DeviationFeedback<T>,
    /// What of the motor that does not get while the piston is near.
    pub reserve: Reserve<T>,
    /// Damping ratio that the simulated crane's ringing is to have.
    pub damping: T,
    /// Bandwidth of its position \[rad/s\], where the oil is stiff enough for it.
    pub bandwidth: T,
    /// The motor's limits.
    pub limits: ActuatorLimits<T>,
    /// What the machine's motor has to turn for each revolution of the simulated one.
    pub turns: T,
    /// Sample period \[s\].
    pub period: T,
}

impl<T: Real> FollowingMemory<T> {
    fn passed(&self) -> [NotchMemory<T>; BENDING] {
        let of = |next, after| NotchMemory { next, after };
        [of(self.notch_1_next, self.notch_1_after), of(self.notch_2_next, self.notch_2_after)]
    }

    fn pass(&mut self, [first, second]: [NotchMemory<T>; BENDING]) {
        (self.notch_1_next, self.notch_1_after) = (first.next, first.after);
        (self.notch_2_next, self.notch_2_after) = (second.next, second.after);
    }

    fn reference(&self) -> ReferenceMemory<T> {
        ReferenceMemory {
            ahead: self.ahead,
            too_fast: self.too_fast,
            wanted_velocity: self.wanted_velocity,
            velocity: self.reference_velocity,
            moving_pressure: self.moving_pressure,
        }
    }

    fn refer(&mut self, to: ReferenceMemory<T>) {
        (self.ahead, self.too_fast) = (to.ahead, to.too_fast);
        (self.wanted_velocity, self.reference_velocity) = (to.wanted_velocity, to.velocity);
        self.moving_pressure = to.moving_pressure;
    }
}

impl<T: Real> ModelFollowing<T> {
    /// Notches at frequencies \[rad/s\], called every period \[s\].
    pub fn notches(bending: [T; BENDING], period: T) -> [Notch<T>; BENDING] {
        bending.map(|frequency| Notch::new(frequency, NOTCH.map(T::lit), period))
    }

    /// Memory to start with, at rest.
    pub fn start(&self) -> FollowingMemory<T> {
        let zero = T::zero();
        FollowingMemory::from_array([zero; FollowingMemory::NAMES.len()])
    }

    /// What lies between this one and another, by the other's share, 0 to 1: for payloads in between.
    pub fn between(&self, other: &Self, share: T) -> Self {
        let bending = core::array::from_fn(|k| {
            share.mul_add(other.bending[k] - self.bending[k], self.bending[k])
        });
        let between = |a: T, b: T| share.mul_add(b - a, a);
        let (own, others) = (self.reserve, other.reserve);
        let mut new = Self {
            bending,
            notches: Self::notches(bending, self.period),
            reserve: Reserve {
                share: between(own.share, others.share),
                beyond: between(own.beyond, others.beyond),
                ..own
            },
            ..*self
        };
        for (station, other) in new.stations.iter_mut().zip(&other.stations) {
            *station = station.with(other, between);
        }
        new
    }

    /// The crane at a position \[m\].
    #[inline(always)]
    pub fn station(&self, stroke: T) -> Station<T> {
        let last = T::lit((STATIONS - 1) as f64);
        let place = ((stroke - self.first) / self.spacing).clamp(T::zero(), last);
        // every station weighs by how near it is: none is chosen by a condition on the position
        let mut sum = self.stations[0].map(|_| T::zero());
        for (k, station) in self.stations.iter().enumerate() {
            let away = (place - T::lit(k as f64)).abs();
            let weight = (T::one() - away).max(T::zero());
            sum = sum.with(station, |sum, value| weight.mul_add(value, sum));
        }
        sum
    }

    /// Bulk modulus at a load pressure \[Pa\], as a share of stiff oil's.
    #[inline(always)]
    pub fn stiffness_at(&self, load_pressure: T) -> T {
        self.stiffness.share(load_pressure + self.beyond_load)
    }

    /// Load pressure \[Pa\] that friction takes at a piston velocity \[m/s\].
    #[inline(always)]
    pub(crate) fn friction_pressure_at(&self, velocity: T) -> T {
        self.friction_pressure * (velocity / self.friction_speed).tanh()
    }

    /// Motor speed \[rev/s\] of the simulated crane for the coming period.
    ///
    /// The reference, as far as the crane can follow it and as it will be a lead later, has its load pressure and motor speed by the oil spring's
    /// equations: `p* = p_0 + (a − a_v v)/a_p + p_fr`, `n* = n_0 + (p_0' v/s − c_v v + (1 − s*) p_m')/b`, p_m' being the rate of what p* has beyond
    /// p_0. On stiff oil feedback brings that sooner than a motor that has to turn up for it first. Then
    /// `n = n* + (s*/s) (k_x (x* − x) + k_i ∫(x* − x) + k_v (v* − v) + k_p (p* − p))`, s being the stiffness of the oil at the pressure that is,
    /// and s* at the one that is wanted. Feedback asks for no more than the motor's slew can follow, and position for less of it, so that what
    /// damps is heard. The integral holds while the motor cannot follow, or position may not ask for more, and the lag would drive it further.
    #[inline(always)]
    pub fn update(
        &self,
        memory: &mut FollowingMemory<T>,
        reference: &SetPoint<T>,
        seen: &AxisState<T>,
    ) -> T {
        let mut refers = memory.reference();
        let attained = refers.attain(self, reference);
        memory.refer(refers);
        memory.reference_speed = attained.motor_speed;
        let Wanted { feedforward, back: [back, most], damping, softer, authority, lag, .. } =
            self.wanted(memory.lag, &attained, seen);
        let mut passed = memory.passed();
        let mut kept = back.clamp(-most, most) + damping;
        for (notch, passed) in self.notches.iter().zip(&mut passed) {
            kept = notch.update(passed, kept);
        }
        memory.pass(passed);
        memory.feedback = memory.feedback + self.smoothing * (kept - memory.feedback);
        let asked = feedforward + (memory.feedback * softer).clamp(-authority, authority);
        let limits = ActuatorLimits { speed: T::lit(BEYOND) * self.fastest(), ..self.limits };
        let reached = limits.follow(memory.motor_speed, asked, self.period);
        let zero = T::zero();
        let cannot = [reached.lt(asked) | most.lt(back), asked.lt(reached) | back.lt(-most)];
        let winding = (cannot[0] & zero.lt(lag)) | (cannot[1] & lag.lt(zero));
        memory.lag = T::select(winding, memory.lag, memory.lag + self.period * lag);
        memory.motor_speed = reached;
        reached
    }

    /// Speed of the simulated motor \[rev/s\] at which the machine's is at its limit.
    #[inline(always)]
    pub(crate) fn fastest(&self) -> T {
        self.limits.speed / self.turns
    }

    /// Memory with which the next [`update`](Self::update) asks for `speed` \[rev/s\], so that state feedback takes over from
    /// whatever moved the simulated crane until now without a bump; where that is farther from the reference's speed than feedback may ask for, it
    /// goes there as fast as the motor can.
    pub fn take_over(
        &self,
        reference: &SetPoint<T>,
        seen: &AxisState<T>,
        speed: T,
    ) -> FollowingMemory<T> {
        let begun = ReferenceMemory::even(self, reference);
        let mut memory = FollowingMemory { motor_speed: speed, ..self.start() };
        memory.refer(begun);
        // as the next update has it
        let attained = { begun }.attain(self, reference);
        let Wanted { feedforward, back: [back, most], damping, softer, by_lag, .. } =
            self.wanted(memory.lag, &attained, seen);
        memory.feedback = (speed - feedforward) / softer;
        memory.pass(self.notches.map(|notch| notch.steady(memory.feedback)));
        memory.lag = ((memory.feedback - damping).clamp(-most, most) - back) / by_lag;
        memory
    }

    #[inline(always)]
    fn wanted(&self, summed: T, attained: &Attainable<T>, seen: &AxisState<T>) -> Wanted<T> {
        let half = T::lit(0.5);
        let Attainable { reference, acceleration, pressure_rate, .. } = *attained;
        let gained = self.lead * acceleration;
        let v = reference.velocity + gained;
        let position = reference.position + self.lead * (reference.velocity + half * gained);

        let at = self.station(position);
        let moving = (acceleration - at.stiff.acceleration_by_velocity * v)
            / at.stiff.acceleration_by_pressure;
        let pressure = at.rest.load_pressure + moving + self.friction_pressure_at(v);
        let [wanted_stiffness, stiffness] =
            [pressure, seen.load_pressure].map(|load| self.stiffness_at(load));
        let spring = at.spring(wanted_stiffness);
        let evenly = (at.rest.load_pressure_slope - spring.pressure_by_velocity) * v;
        let rate = evenly + (T::one() - wanted_stiffness) * pressure_rate;
        let feedforward = at.rest.holding_speed + rate / spring.pressure_by_speed;

        let gains = self.gains(&spring);
        let lag = position - seen.stroke;
        let by_lag = gains.integral;
        // a dip into soft oil is over before much more of the pump would help
        let softer = (wanted_stiffness / stiffness).min(T::lit(SOFTEST));
        let authority = self.authority(&at);
        let held = gains.pressure * self.friction_pressure;
        let most = T::lit(POSITION) * authority / softer + held;
        let back = [gains.position * lag + by_lag * summed, most];
        let damping =
            gains.velocity * (v - seen.velocity) + gains.pressure * (pressure - seen.load_pressure);
        Wanted { feedforward, back, damping, softer, authority, lag, by_lag }
    }

    /// The most that feedback may ask for \[rev/s\]: what the motor's slew allows for as fast as the crane at rest rings, or a share of its speed.
    #[inline(always)]
    fn authority(&self, at: &Station<T>) -> T {
        let ring = at.spring(self.stiffness_at(at.rest.load_pressure)).ring();
        (T::lit(SLEWS) * self.limits.slew / ring).min(T::lit(AUTHORITY) * self.limits.speed)
    }

    /// Gains at a position \[m\] with the crane at rest.
    pub fn gains_at_rest(&self, stroke: T) -> Gains<T> {
        let at = self.station(stroke);
        self.gains(&at.spring(self.stiffness_at(at.rest.load_pressure)))
    }

    #[inline(always)]
    fn gains(&self, spring: &OilSpring<T>) -> Gains<T> {
        let ring = spring.ring();
        spring.gains(ring, self.damping, ring.min(self.bandwidth))
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::boom::Boom;
    use crate::deviation::tests::feedback;
    use crate::station::Rest;
    use hydroboom_math::Lanes;

    fn oil<T: Real>() -> OilStiffness<T> {
        OilStiffness {
            highest: T::lit(1.6e9),
            lowest: T::lit(2e7),
            transition: T::lit(35e5),
            width: T::lit(5e5),
        }
    }

    /// The paper's crane in round numbers, alike over its whole stroke.
    pub(crate) fn law<T: Real>() -> ModelFollowing<T> {
        let lit = T::lit;
        let station = Station {
            rest: Rest::from_array([65e5, -1e6, 0.11].map(T::lit)),
            stiff: OilSpring::from_array([-0.3, -0.2, 2e-7, 0.0, -1.1e9, 0.0, 3.2e6].map(T::lit)),
            boom: Boom::from_array([2.4e-7, 2e-10].map(T::lit)),
        };
        ModelFollowing {
            stations: [station; STATIONS],
            first: lit(0.005),
            spacing: lit(0.49 / 16.0),
            friction_pressure: lit(1.7e5),
            friction_speed: lit(4e-3),
            stiffness: oil(),
            doubt: lit(8e5),
            beyond_load: lit(2e5),
            bending: [lit(314.0), lit(1100.0)],
            notches: ModelFollowing::notches([lit(314.0), lit(1100.0)], lit(1e-3)),
            smoothing: lit(0.15),
            lead: lit(5e-3),
            deviation: feedback(),
            reserve: Reserve { share: lit(0.1), beyond: lit(0.2), near: lit(4e-3), far: lit(6e-3) },
            damping: lit(0.7),
            bandwidth: lit(12.6),
            limits: ActuatorLimits { speed: lit(50.0), slew: lit(500.0) },
            turns: lit(1.0),
            period: lit(1e-3),
        }
    }

    #[test]
    fn it_takes_over_at_the_speed_that_it_finds() {
        let law = law::<f64>();
        // the second is faster than the motor
        for (velocity, seen, speed) in [(0.05, 0.045, 12.5), (0.3, 0.14, 45.0)] {
            let reference = SetPoint { position: 0.21, velocity };
            let seen = AxisState { stroke: 0.2095, velocity: seen, load_pressure: 66e5 };
            let mut memory = law.take_over(&reference, &seen, speed);
            let next = law.update(&mut memory, &reference, &seen);
            assert!((next - speed).abs() < 1e-9, "{next}");
        }
        // farther from the reference's speed than feedback may ask for
        let reference = SetPoint { position: 0.21, velocity: 0.3 };
        let seen = AxisState { stroke: 0.2095, velocity: 0.045, load_pressure: 66e5 };
        let mut memory = law.take_over(&reference, &seen, 12.5);
        let next = law.update(&mut memory, &reference, &seen);
        assert!((next - 12.5 - law.limits.slew * law.period).abs() < 1e-9, "{next}");
    }

    #[test]
    fn state_feedback_asks_for_no_more_than_it_may_and_position_leaves_some_to_damping() {
        let law = law::<f64>();
        let reference = SetPoint { position: 0.25, velocity: 0.0 };
        let at = law.station(0.25);
        let holding = at.rest.holding_speed;
        let authority = law.authority(&at);
        // beside what friction takes, which is held by no position that is far off
        let held = law.gains_at_rest(0.25).pressure * law.friction_pressure;
        let most = POSITION * authority + held;
        let after = |seen: AxisState<f64>| {
            let mut memory = law.start();
            for _ in 0..1000 {
                law.update(&mut memory, &reference, &seen);
            }
            memory
        };
        let far = AxisState { stroke: 0.45, velocity: 0.0, load_pressure: 65e5 };
        let (behind, falling) = (after(far), after(AxisState { velocity: -0.3, ..far }));
        assert!((behind.motor_speed - holding + most).abs() < 1e-9);
        assert_eq!(behind.lag, 0.0);
        // what damps is heard beside it
        assert!(falling.motor_speed > behind.motor_speed + 1.0, "{falling:?}");
        let pressed = after(AxisState { load_pressure: 165e5, ..far });
        assert!((pressed.motor_speed - holding + authority).abs() < 1e-9);
    }

    #[test]
    fn a_motor_that_cannot_follow_does_not_wind_the_integral_up() {
        let law = law::<f64>();
        // as fast as the machine's motor can, behind by what position may still ask for, and feedback on top of it
        let reference = SetPoint { position: 0.4, velocity: 0.15 };
        let seen = AxisState { stroke: 0.37, velocity: 0.0, load_pressure: 65e5 };
        let mut memory = law.start();
        memory.refer(ReferenceMemory::even(&law, &reference));
        for _ in 0..5000 {
            law.update(&mut memory, &reference, &seen);
        }
        assert_eq!((memory.motor_speed, memory.lag), (BEYOND * 50.0, 0.0));
    }

    #[test]
    fn state_feedback_in_lanes_equals_that_in_f64() {
        let strokes = [0.003, 0.2, 0.31, 0.499];
        let (plain, lanes) = (law::<f64>(), law::<Lanes<4>>());
        let reference = SetPoint { position: 0.25, velocity: 0.1 };
        let mut together = lanes.start();
        let seen = AxisState {
            stroke: Lanes(strokes),
            velocity: Lanes([0.09; 4]),
            load_pressure: Lanes([40e5; 4]),
        };
        let speeds = lanes.update(&mut together, &reference.map(|v| Lanes([v; 4])), &seen);
        for (lane, stroke) in strokes.into_iter().enumerate() {
            let mut memory = plain.start();
            let seen = AxisState { stroke, velocity: 0.09, load_pressure: 40e5 };
            assert_eq!(plain.update(&mut memory, &reference, &seen), speeds.0[lane]);
            assert_eq!(memory.lag, together.lag.0[lane]);
        }
    }
}
