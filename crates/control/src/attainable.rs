//! A reference, as far as the crane can follow it.
//!
//! What accelerates a crane is pressure, and on soft oil a pressure takes many revolutions of the pump: a step of acceleration that is asked for at once
//! is there after a third of a second, a stop comes too late, and feedback that is told of it all as a deviation swings the crane on. So the
//! reference is a motion of the oil spring itself, by a motor that has its limits. What it cannot follow is made good for later. The farther the reference
//! runs ahead, the more of the motor is led into the spring, and the less is left to feedback.

use crate::model_following::ModelFollowing;
use crate::oil_spring::OilSpring;
use crate::reference::profile::SetPoint;
use crate::station::Station;
use hydroboom_math::Real;

/// What the reference is by now.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ReferenceMemory<T> {
    /// By how much the one that is asked for runs ahead of it \[m\].
    pub ahead: T,
    /// Of that, what came of a velocity beyond the motor's \[m\].
    pub too_fast: T,
    /// Velocity that it should have \[m/s\].
    pub wanted_velocity: T,
    /// Velocity that it has \[m/s\].
    pub velocity: T,
    /// Load pressure beyond what holds the crane at rest \[Pa\].
    pub moving_pressure: T,
}

/// A reference that the crane can follow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Attainable<T> {
    /// Position, and velocity.
    pub reference: SetPoint<T>,
    /// Its acceleration \[m/s²\].
    pub acceleration: T,
    /// Rate of the load pressure that it takes beyond what position and velocity do \[Pa/s\].
    pub pressure_rate: T,
    /// Motor speed that it takes \[rev/s\].
    pub motor_speed: T,
}

/// Rate \[1/s\] at which is made good for what the motor could not follow.
const CATCHES_UP: f64 = 6.0;
/// No more than this share of the frequency \[rad/s\] at which the crane rings at rest.
const BY_RING: f64 = 0.5;
/// It is braked, so that the crane comes to rest where it shall, by this share of its largest speed in a second \[1/s\].
const BRAKES: f64 = 3.5;
/// Of what motion leaves of the motor's speed, what may go into the oil spring: where the reference is attained, and feedback has the rest, and where it
/// runs far ahead.
const INTO_THE_SPRING: [f64; 2] = [0.35, 1.0];
/// And what may at least, of all the motor's speed.
const LEAST: f64 = 0.1;
/// A reference that runs ahead by this runs far ahead \[m\], all the more the nearer to that.
const FAR: f64 = 0.03;
/// So does one of which so much comes of a velocity beyond the motor's \[m\]: nothing brings that sooner than the whole motor.
const TOO_FAST: f64 = 0.01;
/// Of the motor's speed, what is counted on when a change of acceleration is begun: what ends it again has to be in time on softer oil too; and where
/// the reference is too fast, and it may end late.
const COUNTED_ON: [f64; 2] = [0.175, 0.6];
/// Of friction's change, what is known when it comes: a crane that was at rest is held by any part of it, to either side.
const FRICTION_KNOWN: f64 = 0.75;

impl<T: Real> ReferenceMemory<T> {
    /// In even motion that is no faster than the motor can.
    pub(crate) fn even(law: &ModelFollowing<T>, reference: &SetPoint<T>) -> Self {
        let (at, _, speed_per_velocity) = evenly(law, reference.position);
        let velocity = reachable(law, &at, speed_per_velocity, reference.velocity);
        let drag = at.stiff.acceleration_by_velocity * velocity;
        let moving_pressure =
            law.friction_pressure_at(velocity) - drag / at.stiff.acceleration_by_pressure;
        Self {
            ahead: T::zero(),
            too_fast: T::zero(),
            wanted_velocity: velocity,
            velocity,
            moving_pressure,
        }
    }

    /// The reference that is attained in the coming period, of one that is asked for: `v' = a_v v + a_p (p − p_fr(v))`, p being the moving pressure,
    /// and `p' = b (n − n_v)`, n_v what position and velocity take of the motor. The pressure is the one that brings v to what is wanted, or as near to
    /// that as the motor can.
    #[inline(always)]
    pub(crate) fn attain(
        &mut self,
        law: &ModelFollowing<T>,
        reference: &SetPoint<T>,
    ) -> Attainable<T> {
        let (zero, period) = (T::zero(), law.period);
        let (at, rest, speed_per_velocity) = evenly(law, reference.position);
        let full = law.fastest();

        let rate = T::lit(CATCHES_UP).min(T::lit(BY_RING) * rest.ring());
        let braking = T::lit(BRAKES) * full / speed_per_velocity;
        let wanted = reference.velocity + made_good(self.ahead, rate, braking);

        let [_, a_v, a_p, ..] = at.stiff.to_array();
        let v = self.velocity;
        let friction = law.friction_pressure_at(v);
        let b = at
            .spring(law.stiffness_at(at.rest.load_pressure + self.moving_pressure))
            .pressure_by_speed;
        let too_fast = (self.too_fast.abs() / T::lit(TOO_FAST)).min(T::one());
        let far = (too_fast + self.ahead.abs() / T::lit(FAR)).min(T::one());
        // a change of acceleration is ended in time, on oil that may be softer than this
        let jerk = between(COUNTED_ON, too_fast) * full * a_p * b.min(rest.pressure_by_speed);
        let behind = self.wanted_velocity - v;
        let most = (T::lit(2.0) * jerk * behind.abs()).sqrt();
        let acceleration =
            (wanted - self.wanted_velocity) / period + (behind / period).clamp(-most, most);
        let pressure = (acceleration - a_v * v) / a_p + friction;

        let turning = at.rest.holding_speed + speed_per_velocity * v;
        let (share, least) = (between(INTO_THE_SPRING, far), T::lit(LEAST) * full);
        let spared = |left: T| (share * left.max(zero) + least).min(left);
        let into_the_spring = ((pressure - self.moving_pressure) / (period * b))
            .clamp(-spared(full + turning), spared(full - turning));
        let moving_pressure = self.moving_pressure + period * b * into_the_spring;
        let acceleration = a_p * (moving_pressure - friction) + a_v * v;
        let velocity = v + period * acceleration;

        let rubbing = (law.friction_pressure_at(velocity) - friction) / period;
        let attained = Attainable {
            reference: SetPoint { position: reference.position - self.ahead, velocity },
            acceleration,
            pressure_rate: b * into_the_spring - T::lit(1.0 - FRICTION_KNOWN) * rubbing,
            motor_speed: turning + into_the_spring,
        };
        let ahead = self.ahead + period * (reference.velocity - velocity);
        let beyond =
            reference.velocity - reachable(law, &at, speed_per_velocity, reference.velocity);
        *self = Self {
            ahead,
            too_fast: (self.too_fast + period * beyond).clamp(ahead.min(zero), ahead.max(zero)),
            wanted_velocity: wanted,
            velocity,
            moving_pressure,
        };
        attained
    }
}

/// The crane at a position \[m\], its oil spring at rest, and what even motion takes there of the motor \[rev/m\].
#[inline(always)]
pub(crate) fn evenly<T: Real>(
    law: &ModelFollowing<T>,
    position: T,
) -> (Station<T>, OilSpring<T>, T) {
    let at = law.station(position);
    let spring = at.spring(law.stiffness_at(at.rest.load_pressure));
    let rate = at.rest.load_pressure_slope - spring.pressure_by_velocity;
    (at, spring, rate / spring.pressure_by_speed)
}

impl<T: Real> ModelFollowing<T> {
    /// Motor speed \[rev/s\] of the simulated crane that even motion takes at a position \[m\] with a velocity \[m/s\], beside what holds it there.
    pub(crate) fn travels(&self, position: T, velocity: T) -> T {
        let (_, _, speed_per_velocity) = evenly(self, position);
        speed_per_velocity * velocity
    }
}

/// A velocity \[m/s\], where it is no faster than the motor can, or what that can.
#[inline(always)]
pub(crate) fn reachable<T: Real>(
    law: &ModelFollowing<T>,
    at: &Station<T>,
    speed_per_velocity: T,
    velocity: T,
) -> T {
    let full = law.fastest();
    let [slowest, fastest] =
        [-full, full].map(|speed| (speed - at.rest.holding_speed) / speed_per_velocity);
    velocity.clamp(slowest, fastest)
}

/// What lies between two values, by the second's share, 0 to 1.
#[inline(always)]
fn between<T: Real>([first, second]: [f64; 2], share: T) -> T {
    share.mul_add(T::lit(second - first), T::lit(first))
}

/// Velocity \[m/s\] at which a distance \[m\] is made good for at a rate \[1/s\], if that may be braked at \[m/s²\].
#[inline(always)]
fn made_good<T: Real>(distance: T, rate: T, braking: T) -> T {
    let near = braking / rate.square();
    let within = distance.clamp(-near, near);
    let beyond = (distance - within).abs();
    // braked evenly until it is near
    let square = rate.square() * within.square() + T::lit(2.0) * braking * beyond;
    let speed = square.sqrt();
    T::select(distance.lt(T::zero()), -speed, speed)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::model_following::STATIONS;
    use crate::model_following::tests::law;
    use crate::station::Rest;

    const BEGINS: f64 = 0.1;

    /// The paper's crane on the verge of soft oil, and nothing beside it that changes along its stroke.
    pub(crate) fn soft() -> ModelFollowing<f64> {
        let law = law::<f64>();
        let rest = Rest { load_pressure: 30e5, load_pressure_slope: 0.0, ..law.stations[0].rest };
        ModelFollowing { stations: [Station { rest, ..law.stations[0] }; STATIONS], ..law }
    }

    /// What is asked for and attained in every period, at velocities \[m/s\] that are asked for one after the other.
    fn attained(
        law: &ModelFollowing<f64>,
        velocities: impl IntoIterator<Item = f64>,
    ) -> Vec<(SetPoint<f64>, Attainable<f64>)> {
        let (mut memory, mut position) = (ReferenceMemory::default(), BEGINS);
        let each = |velocity: f64| {
            let reference = SetPoint { position, velocity };
            position += law.period * velocity;
            (reference, memory.attain(law, &reference))
        };
        velocities.into_iter().map(each).collect()
    }

    /// To a velocity \[m/s\] and back to rest within so many periods each, with as many in between.
    fn trapezoid(fastest: f64, periods: u32) -> impl Iterator<Item = f64> {
        let ramp = (0..periods).map(move |k| fastest * f64::from(k) / f64::from(periods));
        let rest = core::iter::repeat_n(0.0, 9000);
        let even = core::iter::repeat_n(fastest, periods as usize);
        ramp.clone().chain(even).chain(ramp.rev()).chain(rest)
    }

    #[test]
    fn on_stiff_oil_a_reference_within_limits_stays_as_it_is() {
        let law = law::<f64>();
        for (asked, given) in attained(&law, trapezoid(0.1, 1000)) {
            // steps of its acceleration are rounded off
            assert!((asked.position - given.reference.position).abs() < 5e-5, "{given:?}");
        }
    }

    #[test]
    fn position_and_velocity_belong_together_and_end_where_the_reference_does() {
        for law in [law::<f64>(), soft()] {
            for (fastest, periods) in [(0.1, 1000), (0.1, 100), (0.25, 700)] {
                let all = attained(&law, trapezoid(fastest, periods));
                for pair in all.windows(2) {
                    let [before, now] = [pair[0].1.reference, pair[1].1.reference];
                    let gap = now.position - before.position - law.period * before.velocity;
                    assert!(gap.abs() < 1e-12, "{gap}");
                }
                let (asked, given) = all[all.len() - 1];
                let left = asked.position - given.reference.position;
                assert!(left.abs() < 1e-4 && given.reference.velocity.abs() < 1e-4, "{left}");
            }
        }
    }

    /// A pump that has to turn faster than the simulated one leaves less of the motor.
    #[test]
    fn it_takes_no_more_than_the_motor_of_the_machine_has() {
        for turns in [1.0, 1.08, 0.95] {
            for law in [law::<f64>(), soft()] {
                let law = ModelFollowing { turns, ..law };
                let all = attained(&law, trapezoid(0.3, 500));
                let most = all.iter().map(|(_, a)| turns * a.motor_speed.abs()).fold(0.0, f64::max);
                assert!((most - law.limits.speed).abs() < 0.01 * law.limits.speed, "{most}");
            }
        }
    }

    #[test]
    fn a_reference_that_runs_far_ahead_takes_the_whole_motor() {
        let law = soft();
        let ramp = (0..500).map(|k| 6e-4 * f64::from(k));
        let asked = ramp.chain(core::iter::repeat_n(0.3, 1000));
        let far: Vec<_> = attained(&law, asked)
            .into_iter()
            .filter(|(asked, given)| asked.position - given.reference.position > FAR)
            .collect();
        assert!(far.len() > 500, "{}", far.len());
        for (asked, given) in far {
            assert!((given.motor_speed - law.limits.speed).abs() < 1e-9, "{asked:?} {given:?}");
        }
    }

    /// What the motor turns beyond what motion takes is in the oil, however stiff that is on the way: compression is the integral of dp/β.
    #[test]
    fn what_the_pump_delivers_beyond_motion_is_in_the_oil() {
        // in short periods: the oil stiffens within some
        let law = ModelFollowing { period: 1e-5, ..soft() };
        let station = law.stations[0];
        let by_velocity = station.stiff.pressure_by_velocity / station.stiff.pressure_by_speed;
        let a_v = station.stiff.acceleration_by_velocity;
        let a_p = station.stiff.acceleration_by_pressure;
        let (mut memory, mut position, mut revolutions) = (ReferenceMemory::default(), BEGINS, 0.0);
        for velocity in trapezoid(0.12, 30_000).take(45_000) {
            let before = memory;
            let given = memory.attain(&law, &SetPoint { position, velocity });
            position += law.period * velocity;
            let motion = station.rest.holding_speed - by_velocity * before.velocity;
            revolutions += law.period * (given.motor_speed - motion);
            let moving = given.acceleration - a_v * before.velocity;
            let pressure = moving / a_p + law.friction_pressure_at(before.velocity);
            assert!((pressure - memory.moving_pressure).abs() < 1.0, "{pressure}");
        }
        let [begun, now] = [0.0, memory.moving_pressure]
            .map(|p| law.stiffness.compression(30e5 + law.beyond_load + p));
        let stored = law.stiffness.highest * (now - begun) / station.stiff.pressure_by_speed;
        assert!((revolutions / stored - 1.0).abs() < 0.01, "{revolutions} for {stored}");
    }

    #[test]
    fn what_is_far_off_is_braked_evenly_and_what_is_near_approached_ever_slower() {
        let (rate, braking) = (6.0, 0.5);
        for distance in [0.3, 0.02, -0.1] {
            let (mut left, mut last) = (distance, made_good(distance, rate, braking));
            for _ in 0..4000 {
                left -= 1e-3 * last;
                let next = made_good(left, rate, braking);
                assert!((next - last).abs() < 1.01e-3 * braking);
                last = next;
            }
            assert!(left.abs() < 1e-6, "{left}");
        }
    }
}
