//! A path that is known ahead, as it suits the crane.
//!
//! A step of acceleration, and friction that changes its sign, take a step of the load pressure. On soft oil that is a third of a second late, whoever
//! steers. A path that is planned is known before: what steps is spread evenly over some time around the step, the longer the softer the oil and
//! the slower the path. And where it will be faster than the motor can, it is begun sooner.

use crate::attainable::{evenly, reachable};
use crate::model_following::ModelFollowing;
use crate::reference::profile::SetPoint;
use hydroboom_math::Real;

/// So far is looked ahead for what is faster than the motor \[s\].
const AHEAD: f64 = 2.5;
/// Looks for that.
const LOOKS: usize = 100;
/// Looks to either side of a step.
const SIDE: usize = 10;
/// A step of pressure is spread to either side by what filling so much of it \[Pa\] takes, where the oil is that much below what holds the crane.
const STEP: f64 = 10e5;
/// It is filled by a motor that turns at this share of what the path takes at most: filling shall not make it peak beyond what travel does.
const FILLS: f64 = 0.8;
/// And by so much at least and at most \[s\].
const SPREAD: [f64; 2] = [0.02, 0.15];
/// Of friction's change, what is spread: a crane at rest is held by any part of it, and more of it drives the motors of nearly empty cranes, whose
/// oil is soft, faster than any travel.
const FRICTION_SPREAD: f64 = 1.0 / 6.0;

/// Weights of looks to one side, in steps of 1/SIDE: of a mean, and of one in which a constant acceleration shifts nothing.
const WEIGHTS: [[f64; 2]; SIDE + 1] = weights();

const fn weights() -> [[f64; 2]; SIDE + 1] {
    let mut even = [1.0 / (2 * SIDE) as f64; SIDE + 1];
    (even[0], even[SIDE]) = (0.5 * even[0], 0.5 * even[SIDE]);
    // moments of the mean over both sides
    let mut moments = [0.0; 3];
    let mut k = 0;
    while k <= SIDE {
        let u = k as f64 / SIDE as f64;
        moments[0] += 2.0 * even[k];
        moments[1] += 2.0 * even[k] * u * u;
        moments[2] += 2.0 * even[k] * u * u * u * u;
        k += 1;
    }
    let [m0, m2, m4] = moments;
    let fourth = m2 / (m0 * m4 - m2 * m2);
    let mut all = [[0.0; 2]; SIDE + 1];
    let mut k = 0;
    while k <= SIDE {
        let u = k as f64 / SIDE as f64;
        all[k] = [even[k], even[k] * fourth * (m4 / m2 - u * u)];
        k += 1;
    }
    all
}

impl<T: Real> ModelFollowing<T> {
    /// Reference \[m, m/s\] of a path that is known ahead, and behind: `path` is where it is so many seconds \[s\] from now, `speed` its
    /// largest \[m/s\].
    pub fn foreseen(&self, path: impl Fn(T) -> SetPoint<T>, speed: T) -> SetPoint<T> {
        let (at, rest, speed_per_velocity) = evenly(self, path(T::zero()).position);
        let below = at.spring(self.stiffness_at(at.rest.load_pressure - T::lit(STEP)));
        let turns = (T::lit(FILLS) * speed_per_velocity * speed).min(self.fastest());
        let filled = T::lit(STEP) / (below.pressure_by_speed * turns);
        let spread = filled.clamp(T::lit(SPREAD[0]), T::lit(SPREAD[1]));
        let friction =
            T::lit(FRICTION_SPREAD) * rest.acceleration_by_pressure * self.friction_pressure;
        let beyond = |after: T| {
            let velocity = path(after).velocity;
            velocity - reachable(self, &at, speed_per_velocity, velocity)
        };
        let [sooner, grows] = sooner(beyond, self.fastest() / speed_per_velocity);
        let path = |after: T| path(sooner + after);
        let SetPoint { position, velocity } = self.rounded(&path, spread, friction);
        SetPoint { position, velocity: velocity * (T::one() + grows) }
    }

    /// The path whose pressure is the mean of what it was, over a time \[s\] to either side: of what accelerates, and of what friction takes, which
    /// makes for an acceleration \[m/s²\]. A constant one shifts nothing.
    fn rounded(&self, path: &impl Fn(T) -> SetPoint<T>, spread: T, friction: T) -> SetPoint<T> {
        let (zero, half) = (T::zero(), T::lit(0.5));
        let rubs = |velocity: T| (velocity / self.friction_speed).tanh();
        let now = path(zero);
        let rubs_now = rubs(now.velocity);
        let mut sum = SetPoint { position: zero, velocity: zero };
        for step in [-spread, spread].map(|side| side / T::lit(SIDE as f64)) {
            let (mut before, mut rubbed) = (now.velocity, rubs_now);
            // first and second integral of what rubs, from now on
            let (mut once, mut twice) = (zero, zero);
            for (k, [mean, level]) in WEIGHTS.into_iter().map(|w| w.map(T::lit)).enumerate() {
                let there = path(step * T::lit(k as f64));
                let on = if k == 0 { zero } else { step };
                let rubbing = rubs(there.velocity);
                // Simpson's rule: friction may turn between two looks
                let between = T::lit(4.0) * rubs(half * (before + there.velocity));
                let mean_rubbed = T::lit(1.0 / 6.0) * (rubbed + between + rubbing);
                twice = twice + on * (once + half * on * mean_rubbed);
                once = once + on * mean_rubbed;
                (before, rubbed) = (there.velocity, rubbing);
                let pushed = level * friction;
                sum.position = sum.position + mean * there.position + pushed * twice;
                sum.velocity = sum.velocity + mean * there.velocity + pushed * once;
            }
        }
        sum
    }
}

/// How much sooner a path is begun \[s\], and by how much that grows in a second, of which a velocity `beyond` \[m/s\] what the motor can comes so many seconds
/// later: by half of what a motor that moves the piston at `fastest` \[m/s\] will be late by at most. So it is ahead by as much, at first, as it is behind in the end;
/// nothing that is no faster is nearer to it on the whole.
fn sooner<T: Real>(beyond: impl Fn(T) -> T, fastest: T) -> [T; 2] {
    let (zero, half) = (T::zero(), T::lit(0.5));
    let step = T::lit(AHEAD / LOOKS as f64);
    let now = beyond(zero);
    // what will be lacking by each look, and the most of it; a way back makes good for a way there
    let (mut lacking, mut before) = (zero, now);
    let [mut most, mut grows] = [zero; 2];
    for k in 1..=LOOKS {
        let then = beyond(step * T::lit(k as f64));
        lacking = lacking + half * step * (before + then);
        let more = most.lt(lacking.abs());
        let outwards = T::select(lacking.lt(zero), -T::one(), T::one());
        most = T::select(more, lacking.abs(), most);
        grows = T::select(more, outwards * (then - now), grows);
        before = then;
    }
    [most, grows].map(|late| half * late / fastest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attainable::tests::soft;
    use crate::model_following::tests::law;
    use crate::reference::profile::{OutAndBack, RampShape};

    fn motion(speed: f64, ramp: f64) -> OutAndBack<f64> {
        let profile = RampShape::Trapezoidal;
        OutAndBack { start: 0.1, end: 0.3, speed, ramp, dwell: 0.0, rest: 0.5, profile }
    }

    /// What a motion becomes, every half a millisecond.
    fn foreseen(law: &ModelFollowing<f64>, motion: &OutAndBack<f64>) -> Vec<[SetPoint<f64>; 2]> {
        let each = |k: u32| {
            let time = f64::from(k) * 5e-4;
            let suits = law.foreseen(|after| motion.reference(time + after), motion.speed);
            [motion.reference(time), suits]
        };
        (0..(motion.duration() * 2e3) as u32).map(each).collect()
    }

    #[test]
    fn weights_leave_even_motion_and_one_of_them_constant_acceleration_as_it_is() {
        let moment = |of: usize, power: i32| -> f64 {
            let at = |k: usize| (k as f64 / SIDE as f64).powi(power);
            2.0 * WEIGHTS.iter().enumerate().map(|(k, w)| w[of] * at(k)).sum::<f64>()
        };
        assert!((moment(0, 0) - 1.0).abs() < 1e-12 && (moment(1, 0) - 1.0).abs() < 1e-12);
        let even = 1.0 / 3.0 + 1.0 / (6.0 * (SIDE * SIDE) as f64);
        assert!(moment(1, 2).abs() < 1e-12 && (moment(0, 2) - even).abs() < 1e-12);
    }

    /// But for what looks in steps may miss, at either end, of a velocity that passes what the motor can.
    #[test]
    fn position_and_velocity_belong_together() {
        for law in [law::<f64>(), soft()] {
            // the second is faster than the motor
            for (speed, ramp) in [(0.1, 0.3), (0.25, 0.3)] {
                let all = foreseen(&law, &motion(speed, ramp));
                let mut reached = all[0][1].position;
                let missed = (AHEAD / LOOKS as f64).powi(2) / 4.0 * speed / ramp;
                for pair in all.windows(2) {
                    let [[_, before], [_, now]] = [pair[0], pair[1]];
                    reached += 2.5e-4 * (now.velocity + before.velocity);
                    let apart = now.position - reached;
                    assert!(apart.abs() < missed, "{apart} {before:?} {now:?}");
                }
            }
        }
    }

    #[test]
    fn it_is_the_path_itself_in_even_motion_at_rest_and_closely_on_stiff_oil() {
        for law in [law::<f64>(), soft()] {
            let motion = motion(0.1, 0.3);
            let time = motion.rest + 0.5 * motion.travel_time();
            for (time, near) in [(0.0, 1e-9), (time, 1e-9), (motion.duration() + 1.0, 1e-9)] {
                let [own, suits] = [
                    motion.reference(time),
                    law.foreseen(|after| motion.reference(time + after), motion.speed),
                ];
                let apart = [suits.position - own.position, suits.velocity - own.velocity];
                assert!(apart.iter().all(|d| d.abs() < near), "{time} {apart:?}");
            }
        }
        for [own, suits] in foreseen(&law(), &motion(0.1, 0.3)) {
            assert!((own.position - suits.position).abs() < 1e-4, "{own:?} {suits:?}");
        }
    }

    /// What accelerates the crane and overcomes friction, from one period to the next: on soft oil it no longer steps.
    #[test]
    fn the_pressure_that_it_takes_does_not_step_on_soft_oil() {
        let law = soft();
        let station = law.station(0.2);
        let a_p = station.stiff.acceleration_by_pressure;
        let motion = motion(0.1, 0.3);
        let both = foreseen(&law, &motion);
        let steepest = |which: usize| {
            let pressure = |k: usize| {
                let [before, now] = [both[k][which], both[k + 1][which]];
                let acceleration = (now.velocity - before.velocity) / 5e-4;
                acceleration / a_p + law.friction_pressure_at(both[k][0].velocity)
            };
            let steps = (0..both.len() - 21).map(|k| (pressure(k + 20) - pressure(k)).abs());
            steps.fold(0.0, f64::max)
        };
        let [own, suits] = [0, 1].map(steepest);
        // in 10 ms, a thirtieth of what it is spread over
        assert!(suits < 0.2 * own, "{suits} Pa for {own} Pa");
    }

    /// Of the same acceleration: what fills the oil shall be little beside what travels.
    #[test]
    fn a_slower_path_is_spread_longer() {
        let law = law::<f64>();
        let furthest = |speed: f64| {
            let all = foreseen(&law, &motion(speed, 3.0 * speed));
            let shifts = all.iter().map(|[own, suits]| (own.position - suits.position).abs());
            shifts.fold(0.0, f64::max)
        };
        let [slow, fast] = [0.025, 0.1].map(furthest);
        assert!(slow > 2.0 * fast, "{slow} m for {fast} m");
    }

    /// How far a piston without mass, which moves as the motor can, is ahead and behind at most \[m\] on the way out where it follows what becomes of a motion,
    /// or the motion itself; and the root of the mean square of that.
    fn off(law: &ModelFollowing<f64>, motion: &OutAndBack<f64>, which: usize) -> [f64; 3] {
        let all = foreseen(law, motion);
        let (at, _, per) = evenly(law, motion.start);
        let mut piston = motion.start;
        let [mut ahead, mut behind, mut square] = [0.0_f64; 3];
        let out = motion.rest + motion.travel_time() + motion.dwell;
        let all = &all[..(out / 5e-4) as usize];
        for pair in all {
            let wanted = (pair[which].position - piston) / 5e-4;
            piston += 5e-4 * reachable(law, &at, per, wanted);
            let off = piston - pair[0].position;
            ahead = ahead.max(off);
            behind = behind.max(-off);
            square += off * off;
        }
        [ahead, behind, (square / all.len() as f64).sqrt()]
    }

    /// Half of what would be lacking in the end is made good for at the beginning, however long the way: that leaves half of the error, and nothing could leave
    /// less. A way back that follows at once takes nothing from it.
    #[test]
    fn what_the_motor_cannot_do_is_begun_sooner() {
        let law = soft();
        for (end, dwell) in [(0.2, 1.5), (0.3, 1.5), (0.35, 1.5), (0.3, 0.3)] {
            let fast = OutAndBack { end, dwell, rest: 1.0, ..motion(0.25, 0.3) };
            let [[ahead, behind, left], [_, untold_behind, untold]] =
                [1, 0].map(|which| off(&law, &fast, which));
            // what it is ahead at first it is not behind in the end
            let whole = (ahead + behind) / untold_behind;
            assert!((whole - 1.0).abs() < 0.01, "{ahead} m and {behind} m for {untold_behind} m");
            assert!(behind < 0.5 * untold_behind, "{behind} m for {untold_behind} m");
            assert!(left < 0.65 * untold, "{left} m for {untold} m");
        }
        assert_eq!(sooner(|_| 0.0, 1.0), [0.0; 2]);
    }
}
