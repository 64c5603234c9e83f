//! What the load pressure holds: boom and payload, and friction of the cylinder. Learned while the piston slides.
//!
//! ```text
//! p_L = p_0(x) + m p_m(x) + a/a_p + (κ_C sign(v) F_C + κ_v F_v v)/A_p           over windows of a tenth of a second
//! ```
//!
//! m is the payload, κ_C and κ_v Coulomb and viscous friction over what the crane file has of them. One window tells the sum of all; up and down tell payload and friction apart,
//! and so does speed the two kinds of friction. At one speed what was known before does: cold oil is several times as viscous, seals are less apart.
//! Where the piston sticks friction may be anything within its limits, and nothing is learned; nor where the pressure is farther off than friction
//! can be, for then another load hangs there.

use crate::belief::Belief;
use crate::model_following::STATIONS;
use crate::out_of_range::OutOfRange;
use crate::schedule::Schedule;
use hydroboom_math::{Real, record};

/// The piston slides at this speed \[m/s\].
const SLIDES: f64 = 5e-3;
/// A load differs from the one that is thought of by more than what friction can hold back \[Pa\].
pub(crate) const HELD_BY_FRICTION: f64 = 6e5;
/// Friction of each kind is within these limits, over what the crane file has of it.
const FRICTION: [f64; 2] = [0.1, 6.0];
/// What is believed of it, whatever sign noise and a load that swings give it, is within these.
const BELIEVED_FRICTION: [f64; 2] = [-10.0 * FRICTION[1], 10.0 * FRICTION[1]];

/// The cylinder under its load, and what is known of it before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadBalance {
    /// Load pressure that overcomes Coulomb friction, as the crane file has it \[Pa\].
    pub coulomb: f64,
    /// Load pressure that overcomes viscous friction, by velocity \[Pa s/m\].
    pub viscous: f64,
    /// Standard deviation of the load pressure by which a payload was weighed at rest, for friction held a part of it \[Pa\].
    pub weighed: f64,
    /// Standard deviations of Coulomb and viscous friction, over what the crane file has of them.
    pub friction: [f64; 2],
    /// Standard deviation of the load pressure in a window, for the load swings \[Pa\].
    pub scatter: f64,
    /// Periods in a window.
    pub window: u32,
    /// What is left of a window's weight a window later.
    pub memory: f64,
    /// Sample period \[s\].
    pub period: f64,
}

record! {
    /// What is believed of payload and friction.
    pub struct BelievedLoad<T> {
        /// Payload, m
        #[unit = "kg"]
        pub payload: T,
        /// Coulomb friction over what the crane file has of it, κ_C
        #[unit = "1"]
        pub coulomb: T,
        /// Viscous friction over what the crane file has of it, κ_v
        #[unit = "1"]
        pub viscous: T,
        /// Variance of m
        #[unit = "kg²"]
        pub payload_variance: T,
        /// Covariance of m and κ_C
        #[unit = "kg"]
        pub payload_coulomb: T,
        /// Covariance of m and κ_v
        #[unit = "kg"]
        pub payload_viscous: T,
        /// Variance of κ_C
        #[unit = "1"]
        pub coulomb_variance: T,
        /// Covariance of κ_C and κ_v
        #[unit = "1"]
        pub coulomb_viscous: T,
        /// Variance of κ_v
        #[unit = "1"]
        pub viscous_variance: T,
    }
}

/// What was learned, and the window that is under way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadBalanceMemory {
    belief: Belief<3>,
    pressure: f64,
    count: u32,
    stroke: f64,
    /// Velocity in the window before \[m/s\]; none where there was none.
    velocity: Option<f64>,
}

impl LoadBalanceMemory {
    /// Payload \[kg\].
    pub fn payload(&self) -> f64 {
        self.belief.estimate[0]
    }

    /// Coulomb and viscous friction, over what the crane file has of them.
    pub fn friction(&self) -> [f64; 2] {
        let [least, most] = FRICTION;
        let [_, coulomb, viscous] = self.belief.estimate;
        [coulomb, viscous].map(|share| Real::clamp(share, least, most))
    }

    /// What is believed, to go on with later.
    pub fn believed(&self) -> BelievedLoad<f64> {
        let Belief { estimate: [payload, coulomb, viscous], covariance: [m, c, v] } = self.belief;
        BelievedLoad {
            payload,
            coulomb,
            viscous,
            payload_variance: m[0],
            payload_coulomb: m[1],
            payload_viscous: m[2],
            coulomb_variance: c[1],
            coulomb_viscous: c[2],
            viscous_variance: v[2],
        }
    }

    /// A window begins at a position \[m\], after what tells nothing.
    pub fn begin_window(&mut self, stroke: f64) {
        (self.pressure, self.count, self.velocity) = (0.0, 0, None);
        self.stroke = stroke;
    }
}

impl LoadBalance {
    /// A payload \[kg\] that was weighed at a piston position \[m\], and friction as the crane file has it.
    pub fn start(&self, schedule: &Schedule, stroke: f64, payload: f64) -> LoadBalanceMemory {
        let deviations = self.before(schedule, stroke);
        LoadBalanceMemory {
            belief: Belief::new([payload, 1.0, 1.0], &deviations),
            pressure: 0.0,
            count: 0,
            stroke,
            velocity: None,
        }
    }

    /// Goes on with what was believed before.
    ///
    /// # Errors
    ///
    /// The first field that cannot have been learned.
    pub fn resume(
        &self,
        schedule: &Schedule,
        believed: &BelievedLoad<f64>,
    ) -> Result<LoadBalanceMemory, OutOfRange> {
        let b = believed;
        let covariance = [
            [b.payload_variance, b.payload_coulomb, b.payload_viscous],
            [b.payload_coulomb, b.coulomb_variance, b.coulomb_viscous],
            [b.payload_viscous, b.coulomb_viscous, b.viscous_variance],
        ];
        let belief = Belief { estimate: [b.payload, b.coulomb, b.viscous], covariance };
        // a payload is known the worse, the less of the load pressure is its
        let [_, coulomb, viscous] = self.before(schedule, 0.0);
        let weighed = (0..STATIONS).map(|k| self.before(schedule, schedule.position(k))[0].abs());
        let before = [weighed.fold(0.0, f64::max), coulomb, viscous];
        belief.check(&Self::possible(schedule), &before)?;
        Ok(LoadBalanceMemory { belief, ..self.start(schedule, 0.0, b.payload) })
    }

    /// Ranges of what is believed: payload \[kg\], Coulomb and viscous friction.
    fn possible(schedule: &Schedule) -> [[f64; 2]; 3] {
        [[0.0, schedule.heaviest()], BELIEVED_FRICTION, BELIEVED_FRICTION]
    }

    /// Another payload \[kg\], weighed at a piston position \[m\].
    pub fn weighed(
        &self,
        schedule: &Schedule,
        memory: &mut LoadBalanceMemory,
        stroke: f64,
        payload: f64,
    ) {
        let [deviation, ..] = self.before(schedule, stroke);
        memory.belief.replace(0, payload, deviation);
    }

    /// A period that ended at a position \[m\] and a load pressure \[Pa\]. A window with a reading that is no number is left out.
    pub fn update(
        &self,
        schedule: &Schedule,
        memory: &mut LoadBalanceMemory,
        stroke: f64,
        load_pressure: f64,
    ) {
        memory.pressure += load_pressure;
        memory.count += 1;
        if memory.count < self.window {
            return;
        }
        let periods = f64::from(memory.count);
        let time = self.period * periods;
        let pressure = memory.pressure / periods;
        let (velocity, middle) = ((stroke - memory.stroke) / time, 0.5 * (stroke + memory.stroke));
        let before = memory.velocity;
        memory.begin_window(stroke);
        if !(pressure + velocity).is_finite() {
            return;
        }
        memory.velocity = Some(velocity);
        let slides = |velocity: f64| velocity.abs() > SLIDES;
        if let Some(before) = before.filter(|before| before * velocity > 0.0)
            && slides(before)
            && slides(velocity)
        {
            let acceleration = (velocity - before) / time;
            self.weigh(schedule, memory, middle, velocity, acceleration, pressure);
        }
    }

    fn weigh(
        &self,
        schedule: &Schedule,
        memory: &mut LoadBalanceMemory,
        stroke: f64,
        velocity: f64,
        acceleration: f64,
        pressure: f64,
    ) {
        let spring = schedule.at(memory.payload()).station(stroke).stiff;
        let moving = acceleration / spring.acceleration_by_pressure;
        let payload = 1.0 / schedule.per_pressure(stroke);
        let weights = [payload, velocity.signum() * self.coulomb, self.viscous * velocity];
        let held = pressure - schedule.empty(stroke) - moving;
        // the window before ended half a window earlier: an acceleration that changes is known to its size
        let own = self.scatter.square() + moving.square();
        if memory.belief.off(&weights, held, own).off.abs() > HELD_BY_FRICTION {
            return;
        }
        let before = self.before(schedule, stroke);
        memory.belief.forget(1.0 - self.memory, &before);
        memory.belief.learn(&weights, held, own);
        memory.belief.keep_within(&Self::possible(schedule));
    }

    /// Standard deviations of payload \[kg\], weighed at a piston position \[m\], and friction.
    fn before(&self, schedule: &Schedule, stroke: f64) -> [f64; 3] {
        let [coulomb, viscous] = self.friction;
        [self.weighed * schedule.per_pressure(stroke), coulomb, viscous]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model_following::tests::law;
    use crate::schedule::PAYLOADS;

    const HEAVIEST: f64 = 400.0;
    /// Speed of the motion \[m/s\].
    const FASTEST: f64 = 0.05;

    /// A crane whose load pressure rises along the stroke, by 15 bar without payload and 60 bar more with the heaviest.
    fn schedule() -> Schedule {
        let shares: [f64; PAYLOADS] = core::array::from_fn(|k| k as f64 / (PAYLOADS - 1) as f64);
        let laws = shares.map(|share| {
            let mut law = law::<f64>();
            for (k, station) in law.stations.iter_mut().enumerate() {
                station.rest.load_pressure = (15e5 + 60e5 * share) * (1.0 + 0.01 * k as f64);
            }
            law
        });
        Schedule { payloads: shares.map(|share| share * HEAVIEST), laws }
    }

    fn balance() -> LoadBalance {
        LoadBalance {
            coulomb: 1.7e5,
            viscous: 1e6,
            weighed: 3e5,
            friction: [0.5, 1.5],
            scatter: 1e5,
            window: 100,
            memory: 0.999,
            period: 1e-3,
        }
    }

    /// What is believed after a motion: velocities \[m/s\] over time, with a payload \[kg\] and friction, and a pressure \[Pa\] beyond them.
    fn learned(
        seconds: u32,
        payload: f64,
        [coulomb, viscous]: [f64; 2],
        velocity: impl Fn(f64) -> f64,
        beyond: impl Fn(f64) -> f64,
    ) -> LoadBalanceMemory {
        let (schedule, load) = (schedule(), balance());
        let law = schedule.at(payload);
        let (mut stroke, mut memory) = (0.1, load.start(&schedule, 0.1, 200.0));
        for k in 0..1000 * seconds {
            let time = 1e-3 * f64::from(k);
            let [v, next] = [velocity(time), velocity(time + 1e-3)];
            stroke += 1e-3 * v;
            let at = law.station(stroke);
            let moving = (next - v) / 1e-3 / at.stiff.acceleration_by_pressure;
            // at rest it sticks where it came to rest
            let sign = if v == 0.0 { 0.8 } else { v.signum() };
            let held = coulomb * sign * load.coulomb + viscous * load.viscous * v;
            let pressure = at.rest.load_pressure + moving + held + beyond(time);
            load.update(&schedule, &mut memory, stroke, pressure);
        }
        memory
    }

    /// Up for five seconds, rest for two, down for five, with ramps of half a second.
    fn cycle(time: f64) -> f64 {
        let ramp = |t: f64| Real::clamp(2.0 * t, 0.0, 1.0);
        let up = |t: f64| ramp(t) * ramp(5.0 - t);
        FASTEST * (up(time) - up(time - 7.0))
    }

    #[test]
    fn up_and_down_tell_payload_and_friction_apart() {
        let swings = |t: f64| 2e5 * (20.0 * t).sin();
        let truth = [1.4, 3.0];
        let memory = learned(13, 210.0, truth, cycle, swings);
        // within twice what is thought to be left in doubt, which of the payload and of both frictions together is an eighth of what was in doubt before
        let sum = |[coulomb, viscous]: [f64; 2]| {
            coulomb * balance().coulomb + viscous * FASTEST * balance().viscous
        };
        let doubt = |b: &BelievedLoad<f64>| {
            let [c, v] = [balance().coulomb, FASTEST * balance().viscous];
            let squares = c * c * b.coulomb_variance
                + v * v * b.viscous_variance
                + 2.0 * c * v * b.coulomb_viscous;
            [b.payload_variance, squares].map(Real::sqrt)
        };
        let believed = memory.believed();
        let nothing = balance().start(&schedule(), 0.1, 200.0).believed();
        let [deviation, before] = [doubt(&believed), doubt(&nothing)];
        let off = [memory.payload() - 210.0, sum(memory.friction()) - sum(truth)];
        for k in 0..2 {
            assert!(off[k].abs() < 2.0 * deviation[k], "{off:?}, {deviation:?}");
            assert!(deviation[k] < 0.125 * before[k], "{deviation:?} of {before:?}");
        }
        // the way up alone leaves both in doubt
        let up = doubt(&learned(5, 210.0, truth, cycle, swings).believed());
        assert!(up[1] > 2.0 * deviation[1], "{up:?}, {deviation:?}");
    }

    /// Fast and slow tell them apart, where one speed has only what was known before.
    #[test]
    fn two_speeds_tell_seals_from_cold_oil() {
        let truth = [0.8, 3.5];
        let both = |time: f64| if time < 13.0 { cycle(time) } else { 3.0 * cycle(time - 13.0) };
        let off = |memory: &LoadBalanceMemory| {
            let [coulomb, viscous] = memory.friction();
            [(coulomb - truth[0]).abs(), (viscous - truth[1]).abs()]
        };
        let [one, two] = [
            off(&learned(13, 200.0, truth, cycle, |_| 0.0)),
            off(&learned(20, 200.0, truth, both, |_| 0.0)),
        ];
        // what was known before, 0.2 and 2.5 off, keeps some hundredths of a say
        assert!(two[0] < 0.1 && two[1] < 0.2, "{two:?}");
        assert!(two[0] < 0.5 * one[0], "{two:?}, at one speed {one:?}");
    }

    #[test]
    fn where_the_piston_sticks_nothing_is_learned() {
        // at rest, and where it creeps while its oil leaks
        for velocity in [0.0, -2e-3] {
            let memory = learned(20, 230.0, [3.0; 2], |_| velocity, |_| 0.0);
            assert_eq!((memory.payload(), memory.friction()), (200.0, [1.0; 2]));
        }
    }

    /// It is to be weighed, and not to be taken for friction.
    #[test]
    fn another_load_is_no_friction() {
        let hung_on = |t: f64| if t > 2.0 { 10e5 } else { 0.0 };
        let friction =
            |beyond: &dyn Fn(f64) -> f64| learned(5, 200.0, [1.0; 2], cycle, beyond).friction();
        let [with, without] = [friction(&hung_on), friction(&|_| 0.0)];
        for k in 0..2 {
            assert!((with[k] - without[k]).abs() < 0.2, "{with:?} for {without:?}");
        }
    }

    #[test]
    fn what_was_learned_is_gone_on_with_unless_it_cannot_have_been() {
        let (schedule, load) = (schedule(), balance());
        let believed = learned(13, 210.0, [2.2; 2], cycle, |_| 0.0).believed();
        assert_eq!(load.resume(&schedule, &believed).unwrap().believed(), believed);
        let refused = |change: fn(&mut BelievedLoad<f64>)| {
            let mut other = believed;
            change(&mut other);
            load.resume(&schedule, &other).err().map(|wrong| BelievedLoad::NAMES[wrong.field])
        };
        assert_eq!(refused(|b| b.payload = 2.0 * HEAVIEST), Some("payload"));
        assert_eq!(refused(|b| b.viscous = f64::NAN), Some("viscous"));
        assert_eq!(refused(|b| b.coulomb_variance = -1.0), Some("coulomb_variance"));
        assert_eq!(refused(|b| b.payload_viscous = 1e4), Some("payload_viscous"));
    }
}
