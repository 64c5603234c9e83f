//! What the machine differs from the simulated crane by: watched, and made good for.
//!
//! Friction, leakage and a pump that are other than the simulation's push the machine away from it. An observer of the oil spring's equations
//! tells what pushes, from position, load pressure and motor speed. State feedback brings the machine back, and meets what pushes before it has
//! moved anything far. What was torn far off all the same is led back.

use crate::deviation_memory::DeviationMemory;
use crate::feedback::benchmark::BenchmarkInput;
use crate::reckoned::Reckoned;
use crate::sooner::{Heard, SoonerDesign};
use crate::stroke_by_pressure::StrokeByPressure;
use crate::way_back::{REMEMBERED, Sides, Torn, WayBack, WayBackDesign};
use hydroboom_math::{Real, record};

record! {
    /// What is watched of the machine; or by how much that differs from the simulated crane.
    pub struct Watched<T> {
        /// Piston position, x_cyl
        #[unit = "m"]
        pub stroke: T,
        /// Load pressure, p_L = p_A − (A_r/A_p) p_B
        #[unit = "Pa"]
        pub load_pressure: T,
        /// Motor speed
        #[unit = "rev/s"]
        pub motor_speed: T,
    }
}

impl<T: Copy> Watched<T> {
    /// What is measured, with the motor's speed \[rev/s\].
    pub fn of(measured: &BenchmarkInput<T>, motor_speed: T) -> Self {
        let BenchmarkInput { stroke, load_pressure } = *measured;
        Self { stroke, load_pressure, motor_speed }
    }
}

/// Of what feedback may ask for at once, what a position may: the rest is left to damping.
const POSITION: f64 = 0.8;

/// What feedback may ask for at once is no less than this share of what it may where nothing is fed forward: a motor at its limit can still brake.
const AT_LEAST: f64 = 0.5;

/// On oil that gives entirely it may ask for so many times as much, if travel takes that: such oil has to be filled before a piston moves. With twice as much
/// crane 134 of seed 1 is 1.2 mm off at 120 mm/s, for 1.0 with three times and 2.0 with no more than elsewhere; with five times nothing else comes of it.
const ON_SOFT_OIL: f64 = 3.0;

/// On the way oil swings machine and simulated crane apart by some bar. What takes more load pressure to hold is a load \[Pa\], for sure from so many times
/// as much on: with 14 bar for 8 load in motion leaves 0.266 of the benchmark's error in the median, for 0.260, and 5 bar no less.
const LOAD: f64 = 8e5;
const LOAD_FOR_SURE: f64 = 1.5;

/// A piston of whose way back so much is left is far off \[m\].
const FAR: f64 = 5e-3;

/// How a deviation is watched and made good for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviationDesign<T> {
    /// How fast an unknown push is believed, with position and velocity, where the crane rings as fast \[rad/s\]; with the root of how fast it
    /// rings, for lighter cranes show it through less noise.
    pub push: T,
    /// What is believed sooner than that, and heard where it is more than noise.
    pub sooner: SoonerDesign<T>,
    /// How fast an unknown rate of the pressure is believed, as a share of the position's bandwidth.
    pub rate: T,
    /// How fast the pressure itself is believed \[rad/s\]: what is faster is noise.
    pub pressure: T,
    /// Time in which the drive follows, and is read \[s\].
    pub drive: T,
    /// How much later than the motor is told its speed it is read to have it \[s\].
    pub lag: T,
    /// How a position is read from the load pressure, too.
    pub by_pressure: StrokeByPressure<T>,
    /// Of what the boom gives, feedback reckons with such a share.
    pub bends: T,
    /// How much faster than on its oil and its boom alone the crane is to ring.
    pub quicker: T,
    /// Damping ratio that its ringing is to have.
    pub damping: T,
    /// Bandwidth of the position, as a share of the frequency at which the crane rings; less where it is not known how stiff the oil is.
    pub share: T,
    /// Feedback asks for no more than this \[rev/s\] beside what a way back takes, so that it does not drive the machine from one limit to the other.
    pub authority: T,
    /// The motor's limit \[rev/s\].
    pub motor_speed: T,
    /// How a piston that was torn far off is brought back.
    pub way_back: WayBackDesign<T>,
    /// By how much the pressure may dip in motion \[Pa\]: the oil is taken to be as soft as there.
    pub dip: T,
    /// The crane is to ring no slower, and to be brought back no slower, than on oil of this share of stiff oil's bulk modulus: on softer oil
    /// the pump makes it stiffer.
    pub softest: T,
}

/// Observer of a deviation, and feedback of it.
///
/// The load is at y = x − γ p, for the boom gives by γ: `y' = v`, `v' = a_v v + a_p p + d`, `p' = c_v v + b n + r`, c_v and b of oil and boom in series, d and r
/// constant where nobody knows better. Three poles of position, velocity and d, and one each of pressure and r, are where they are wished, of the
/// integrators alone. What holds d is p = −d/a_p, and the piston is home with the load at γ d/a_p. Feedback
/// `n = −r/b − k_x (y − γ d/a_p − z) − k_v (v − z') − k_p (p + d/a_p) − (c_v/b) z'`, z being the way back of a piston that was torn far off, else 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviationFeedback<T> {
    pub(crate) design: DeviationDesign<T>,
    /// What of each is kept in a period, exp(−ω T): of a pressure, an expected speed, of where a piston was torn off to.
    keeps: [T; 3],
    /// Sample period \[s\].
    pub(crate) period: T,
}

impl<T: Real> DeviationFeedback<T> {
    /// Feedback as designed, called every `period` \[s\].
    pub fn new(design: DeviationDesign<T>, period: T) -> Self {
        let drive = T::one() / design.drive.max(period);
        let frequencies = [design.pressure, drive, T::one() / T::lit(REMEMBERED)];
        Self { design, keeps: frequencies.map(|f| (-f * period).exp()), period }
    }

    /// The same where the motor is read to have its speed so much later than it is told \[s\].
    #[must_use]
    pub fn led_late(self, lag: T) -> Self {
        let design = DeviationDesign { lag, ..self.design };
        Self { design, ..self }
    }

    /// By how much the pressure may dip in motion \[Pa\].
    pub fn dip(&self) -> T {
        self.design.dip
    }

    /// Memory to start with at rest: friction holds what the load pressures differ by. The motor speed is the machine's own.
    pub fn start(&self, with: &Reckoned<T>, off: &Watched<T>) -> DeviationMemory<T> {
        DeviationMemory {
            stroke: off.stroke - with.give * off.load_pressure,
            load_pressure: off.load_pressure,
            push: -with.spring.acceleration_by_pressure * off.load_pressure,
            pumped: off.load_pressure - with.pressure_by_travel * off.stroke,
            expected_speed: off.motor_speed,
            ..DeviationMemory::from_array([T::zero(); DeviationMemory::NAMES.len()])
        }
    }

    /// Motor speed \[rev/s\] with a feedforward \[rev/s\], and what differs: position, pressure; the machine's motor speed. Travel on its course takes so
    /// much of the motor at most \[rev/s\], 0 where nothing is known of that.
    #[inline(always)]
    pub fn update(
        &self,
        memory: &mut DeviationMemory<T>,
        with: &Reckoned<T>,
        off: &Watched<T>,
        feedforward: T,
        travels: T,
    ) -> T {
        let [_, a_v, a_p, _, c_v, _, b] = with.spring.to_array();
        let now = self.believed(memory, with, off);
        let period = self.period;
        let most = self.most_on(with, travels);
        let way = self.way_back(with, &now, most);
        let heard = self.sooner(with, &now, &way);
        let most = self.authority(most, feedforward);
        let speed = feedforward + self.answer(with, &now, &way, heard.asks, most);
        let [pushed, sooner] = now.pushed();
        let later = [
            pushed.later(a_v, a_p * now.load_pressure, period),
            sooner.later(a_v, T::zero(), period),
        ];
        let beyond = off.motor_speed - now.expected_speed;
        // a piston that stands still has all of what is pumped in its oil, none of it in the boom
        let by_oil = with.pressure_by_travel / c_v;
        let Sides { above, below } =
            Sides { above: now.above, below: now.below }.later(way.left, self.keeps[2]);
        *memory = DeviationMemory {
            load_pressure: now.load_pressure
                + period * (c_v * now.velocity + b * beyond + now.rate),
            pumped: now.pumped + period * by_oil * (b * beyond + now.rate),
            expected_speed: feedforward + self.keeps[1] * (now.expected_speed - feedforward),
            way_back: way.left + period * way.velocity,
            above,
            below,
            on_the_way: self.keeps[2] * now.on_the_way,
            of_late: self.design.sooner.of_late(now.of_late, heard.beyond_doubt, period),
            ..now.with_pushed(later)
        };
        speed
    }

    /// What is believed once the sample was seen.
    #[inline(always)]
    fn believed(
        &self,
        memory: &DeviationMemory<T>,
        with: &Reckoned<T>,
        off: &Watched<T>,
    ) -> DeviationMemory<T> {
        let Reckoned { keeps: [push, soon, rate], by_pressure, scatter, give, .. } = *with;
        let (one, period) = (T::one(), self.period);
        let [pressure, ..] = self.keeps;
        let [stroke, pumped] = self.design.by_pressure.read(
            [off.stroke, off.load_pressure],
            memory.pumped,
            by_pressure,
            with.pressure_by_travel,
        );
        let error = stroke - give * off.load_pressure - memory.stroke;
        let risen = off.load_pressure - memory.load_pressure;
        let [before, more] = memory.pushed();
        let now = before.seen(error, push, period);
        let beyond = error - more.stroke;
        let sooner = before.plus(&more).seen(beyond, soon, period);
        DeviationMemory {
            load_pressure: memory.load_pressure + (one - rate * pressure) * risen,
            rate: memory.rate + (one - rate) * (one - pressure) / period * risen,
            scatter: self.design.sooner.scatter(memory.scatter.max(scatter), beyond, period),
            pumped,
            ..memory.with_pushed([now, sooner.less(&now)])
        }
    }

    /// Where a piston that was torn off farther than position feedback may answer should be by now, feedback asking for so much at most \[rev/s\]: of what it may
    /// on soft oil alone, position has the less the warier the way back is.
    #[inline(always)]
    fn way_back(&self, with: &Reckoned<T>, now: &DeviationMemory<T>, most: T) -> WayBack<T> {
        let Reckoned { spring, gains, ring, .. } = with;
        let wary = self.wary(with, now);
        let answers = most + wary * (self.design.authority - most);
        let torn = Torn {
            stroke: with.piston(now),
            velocity: now.velocity,
            ring: *ring,
            reach: T::lit(POSITION) * answers / gains.position,
            speed_per_velocity: -spring.pressure_by_velocity / spring.pressure_by_speed,
            wary,
        };
        self.design.way_back.on(&torn, now.way_back)
    }

    /// From 0 to 1, how wary a way back is: as it swings; and on the way, where it is oil that swings machine and simulated crane apart, but for what only a
    /// load that was lost or picked up can hold.
    #[inline(always)]
    fn wary(&self, with: &Reckoned<T>, now: &DeviationMemory<T>) -> T {
        let (zero, one) = (T::zero(), T::one());
        let held = (now.push / with.spring.acceleration_by_pressure).abs();
        let load = ((held / T::lit(LOAD) - one) / T::lit(LOAD_FOR_SURE - 1.0)).clamp(zero, one);
        let swings = Sides { above: now.above, below: now.below }.wary();
        swings.max(now.on_the_way * (one - load))
    }

    /// What is asked for by what is believed sooner beyond that \[rev/s\]. A piston that was torn far off is led back: what is sooner there only
    /// pushes where its swing is going anyway.
    #[inline(always)]
    fn sooner(&self, with: &Reckoned<T>, now: &DeviationMemory<T>, way: &WayBack<T>) -> Heard<T> {
        let Reckoned { spring, gains, speed_by_scatter, .. } = with;
        let [_, more] = now.pushed();
        let held = more.push / spring.acceleration_by_pressure;
        let asks = gains.position * with.settles(&more)
            + gains.velocity * more.velocity
            + gains.pressure * held;
        let near = T::one() - (way.left.abs() / T::lit(FAR)).min(T::one());
        let scatter = now.scatter.max(with.scatter);
        let heard = self.design.sooner.heard(asks, *speed_by_scatter, scatter, now.of_late);
        Heard { asks: near * heard.asks, ..heard }
    }

    /// What feedback may ask for \[rev/s\] where the motor has it: as much as travel takes anyway, on oil that is certainly softer than the softest, the more the
    /// softer it is.
    #[inline(always)]
    fn most_on(&self, with: &Reckoned<T>, travels: T) -> T {
        let DeviationDesign { authority, motor_speed, softest, .. } = self.design;
        let one = T::one();
        let soft = (one - with.stiff / softest).max(T::zero());
        let more = authority * (one + T::lit(ON_SOFT_OIL - 1.0) * soft);
        authority.max(travels.min(more).min(motor_speed))
    }

    /// The most of that which it asks for beside what a way back takes \[rev/s\], where so much is fed forward \[rev/s\]: no more than the motor has left, to
    /// the other side either. What swings, and is braked harder than it can be driven, swings on from one limit to the other.
    #[inline(always)]
    fn authority(&self, most: T, feedforward: T) -> T {
        let DeviationDesign { authority, motor_speed, .. } = self.design;
        let left = motor_speed - feedforward.abs();
        most.min(left.max(T::lit(AT_LEAST) * authority))
    }

    /// What feedback asks for \[rev/s\], so much of it for what is believed sooner, and at `most`. It may take back all that the way back takes, for what
    /// comes back faster has to be braked in time.
    #[inline(always)]
    fn answer(
        &self,
        with: &Reckoned<T>,
        now: &DeviationMemory<T>,
        way: &WayBack<T>,
        sooner: T,
        most: T,
    ) -> T {
        let Reckoned { spring, gains, .. } = with;
        let unheld = now.load_pressure + now.push / spring.acceleration_by_pressure;
        let [pushed, _] = now.pushed();
        let position = gains.position * (with.settles(&pushed) - way.left);
        let damping = gains.velocity * (now.velocity - way.velocity) + gains.pressure * unheld;
        let settled = way.motor_speed - position - now.rate / spring.pressure_by_speed - damping;
        let whole = settled - sooner;
        let zero = T::zero();
        let braked = way.motor_speed - whole;
        let braked = T::select(way.left.lt(zero), braked.max(zero), braked.min(zero));
        let whole = whole + way.unbraked * braked;
        whole.clamp(way.motor_speed.min(zero) - most, way.motor_speed.max(zero) + most)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::boom::Boom;
    use crate::oil_spring::OilSpring;
    use crate::reckoned::MayBe;
    use crate::station::{Rest, Station};
    use crate::way_back::Pace;
    use hydroboom_math::Lanes;

    const PERIOD: f64 = 1e-3;

    pub(crate) fn feedback<T: Real>() -> DeviationFeedback<T> {
        let lit = T::lit;
        let design = DeviationDesign {
            push: lit(130.0),
            sooner: SoonerDesign { times: lit(2.5), heard_from: lit(4.0), begun: lit(0.5) },
            rate: lit(0.3),
            pressure: lit(500.0),
            drive: lit(5e-3),
            lag: lit(5e-3),
            by_pressure: StrokeByPressure {
                stroke_scatter: lit(1e-5),
                pressure_scatter: lit(1e4),
                keeps: lit(0.99),
            },
            bends: lit(0.5),
            quicker: lit(1.2),
            damping: lit(0.5),
            share: lit(0.8),
            authority: lit(20.0),
            motor_speed: lit(50.0),
            way_back: WayBackDesign {
                rate: lit(4.0),
                eager: Pace { by_ring: lit(0.8), motor_speed: lit(60.0) },
                wary: Pace { by_ring: lit(0.4), motor_speed: lit(18.0) },
            },
            dip: lit(4e5),
            softest: lit(0.1),
        };
        DeviationFeedback::new(design, lit(PERIOD))
    }

    pub(crate) fn station<T: Real>() -> Station<T> {
        Station {
            rest: Rest::from_array([65e5, -1e6, 0.11].map(T::lit)),
            stiff: OilSpring::from_array([0.0, -0.2, 2e-7, 0.0, -1.1e9, 0.0, 3.2e6].map(T::lit)),
            boom: Boom::from_array([2.4e-7, 2e-10].map(T::lit)),
        }
    }

    /// What feedback asks for where nothing is fed forward, nor known of what travel takes.
    fn asked(
        law: &DeviationFeedback<f64>,
        with: &Reckoned<f64>,
        now: &DeviationMemory<f64>,
    ) -> f64 {
        let most = law.design.authority;
        let way = law.way_back(with, now, most);
        let sooner = law.sooner(with, now, &way).asks;
        law.answer(with, now, &way, sooner, law.authority(most, 0.0))
    }

    #[test]
    fn what_pushes_is_found_and_made_good_for() {
        let (law, with) = (feedback::<f64>(), feedback().reckons(&station(), &MayBe::known(1.0)));
        let [_, a_v, a_p, _, c_v, _, b] = with.spring.to_array();
        let (push, rate) = (0.05, 2e6);
        // stroke, velocity, load pressure
        let mut crane = [1e-3, 0.0, 0.0];
        let mut memory = law.start(&with, &Watched::default());
        let mut speed = 0.0;
        for _ in 0..10_000 {
            let [load, _, load_pressure] = crane;
            let stroke = load + with.give * load_pressure;
            let off = Watched { stroke, load_pressure, motor_speed: speed };
            speed = law.update(&mut memory, &with, &off, 0.0, 0.0);
            // ten steps of a period, so that the crane is not the observer's own sum
            for _ in 0..10 {
                let [_, v, p] = crane;
                let slopes = [v, a_v * v + a_p * p + push, c_v * v + b * speed + rate];
                for (state, slope) in crane.iter_mut().zip(slopes) {
                    *state += 0.1 * PERIOD * slope;
                }
            }
        }
        let piston = crane[0] + with.give * crane[2];
        assert!(piston.abs() < 1e-6 && crane[1].abs() < 1e-6, "{crane:?}");
        assert!((memory.push / push - 1.0).abs() < 1e-3, "{memory:?}");
        assert!((memory.rate / rate - 1.0).abs() < 1e-3, "{memory:?}");
        assert!((speed + rate / b).abs() < 1e-3 && (crane[2] + push / a_p).abs() < 1.0);
    }

    /// The motor bends the boom, and so moves the piston before its load. Who takes the boom to be rigid takes that for a push, though nothing pushes.
    #[test]
    fn what_the_motor_bends_of_the_boom_is_no_push() {
        let law = |bends: f64| {
            let law = feedback::<f64>();
            DeviationFeedback { design: DeviationDesign { bends, ..law.design }, ..law }
        };
        let is = law(1.0).reckons(&station(), &MayBe::known(1.0));
        let [_, a_v, a_p, _, c_v, _, b] = is.spring.to_array();
        // what load pressure is thought to hold a push, at most, while the motor turns up to 10 rev/s and back
        let believed = |bends: f64| {
            let law = law(bends);
            let with = law.reckons(&station(), &MayBe::known(1.0));
            let mut load = [0.0; 3];
            let mut memory = law.start(&with, &Watched::default());
            let mut most = 0.0_f64;
            for k in 0..60 {
                let motor_speed = 10.0 - f64::from(k - 20).abs().min(20.0) * 0.5;
                let [y, _, load_pressure] = load;
                let off =
                    Watched { stroke: y + is.give * load_pressure, load_pressure, motor_speed };
                law.update(&mut memory, &with, &off, 0.0, 0.0);
                let push = memory.push + memory.sooner_push;
                most = most.max((push / with.spring.acceleration_by_pressure).abs());
                for _ in 0..10 {
                    let [_, v, p] = load;
                    let slopes = [v, a_v * v + a_p * p, c_v * v + b * motor_speed];
                    for (state, slope) in load.iter_mut().zip(slopes) {
                        *state += 0.1 * PERIOD * slope;
                    }
                }
            }
            most
        };
        let [rigid, half, whole] = [0.0, 0.5, 1.0].map(believed);
        assert!(rigid > 2e5, "{rigid}");
        assert!(whole < 0.1 * rigid && (whole..rigid).contains(&half), "{rigid} {half} {whole}");
    }

    /// Torn off by 0.15 m, it is nearer after a second and a half than by half of what the most that position may ask for would leave, and passes by
    /// a tenth at most.
    #[test]
    fn a_piston_that_was_torn_far_off_is_led_back() {
        let (law, with) = (feedback::<f64>(), feedback().reckons(&station(), &MayBe::known(1.0)));
        let [_, a_v, a_p, _, c_v, _, b] = with.spring.to_array();
        let mut crane = [-0.15, 0.0, 0.0];
        let mut memory = law.start(&with, &Watched { stroke: -0.15, ..Watched::default() });
        let mut passed = 0.0_f64;
        let mut after = [0.0; 2];
        for k in 0..3000 {
            let [stroke, _, load_pressure] = crane;
            let off = Watched { stroke, load_pressure, motor_speed: 0.0 };
            let speed = law.update(&mut memory, &with, &off, 0.0, 0.0);
            let speed = Real::clamp(speed, -50.0, 50.0);
            for _ in 0..10 {
                let [_, v, p] = crane;
                let slopes = [v, a_v * v + a_p * p, c_v * v + b * speed];
                for (state, slope) in crane.iter_mut().zip(slopes) {
                    *state += 0.1 * PERIOD * slope;
                }
            }
            passed = passed.max(crane[0]);
            if k == 1500 {
                after = [crane[0], memory.way_back];
            }
        }
        let alone = POSITION * law.design.authority * b / -c_v * 1.5;
        assert!(after[0].abs() < 0.5 * (0.15 - alone), "{after:?} {alone}");
        assert!(passed < 0.015, "{passed}");
        assert!(crane[0].abs() < 1e-3 && memory.way_back.abs() < 1e-3, "{crane:?}");
    }

    /// It may take back what the way back takes, and no more of the motor than it may anyway.
    #[test]
    fn what_comes_back_faster_than_its_way_is_braked() {
        let (law, with) = (feedback::<f64>(), feedback().reckons(&station(), &MayBe::known(1.0)));
        let torn = DeviationMemory { stroke: -0.1, way_back: -0.1, ..Default::default() };
        let way = law.way_back(&with, &torn, law.design.authority);
        assert_eq!(way.motor_speed, law.design.way_back.eager.motor_speed);
        let answer = |velocity: f64| {
            let now = DeviationMemory { velocity, ..torn };
            asked(&law, &with, &now)
        };
        assert!((answer(way.velocity) - way.motor_speed).abs() < 1e-9);
        // it would not come home by its swing, but by that of twice the speed
        let home = 0.1 * with.ring;
        assert!(home > 2.0 * way.velocity, "{home} {way:?}");
        assert!((answer(0.45 * home) - way.motor_speed).abs() < 1e-9);
        assert!(answer(home) < way.motor_speed - 1.0);
        // having swung to the other side, it is braked at once
        let swings = DeviationMemory { above: 0.1, below: 0.1, velocity: 0.45 * home, ..torn };
        let warily = asked(&law, &with, &swings);
        assert!(warily < law.design.way_back.wary.motor_speed - 1.0, "{warily}");
        // or having been told to be wary, for a while
        let mut told = DeviationMemory { velocity: 0.45 * home, ..torn };
        told.be_wary(1.0);
        assert_eq!(asked(&law, &with, &told), warily);
        assert_eq!(answer(way.velocity + 10.0), -law.design.authority);
        assert_eq!(answer(way.velocity - 10.0), way.motor_speed + law.design.authority);
    }

    /// What it asks for a moment after a push began, by what is believed sooner and without that.
    #[test]
    fn a_push_beyond_noise_is_met_sooner_and_one_within_it_as_before() {
        let law = feedback::<f64>();
        let with = law.reckons(&station(), &MayBe::known(1.0));
        let deaf = SoonerDesign { heard_from: 1e9, ..law.design.sooner };
        let slow =
            DeviationFeedback { design: DeviationDesign { sooner: deaf, ..law.design }, ..law };
        let after = |law: &DeviationFeedback<f64>, push: f64, periods: i32| {
            let mut memory = law.start(&with, &Watched::default());
            let mut speed = 0.0;
            for k in 0..periods {
                let time = PERIOD * f64::from(k);
                let off = Watched { stroke: 0.5 * push * time * time, ..Watched::default() };
                speed = law.update(&mut memory, &with, &off, 0.0, 0.0);
            }
            speed
        };
        let [sooner, later] = [&law, &slow].map(|law| after(law, -2.0, 12));
        assert!(sooner > 1.5 * later && later > 0.0, "{sooner} {later}");
        assert_eq!(after(&law, -0.02, 12), after(&slow, -0.02, 12));
    }

    /// By how much it asks otherwise for a push that is believed sooner, and leaves it within what feedback may ask for.
    #[test]
    fn a_piston_that_is_torn_far_off_hears_of_nothing_sooner() {
        let (law, with) = (feedback::<f64>(), feedback().reckons(&station(), &MayBe::known(1.0)));
        let sooner = |off: f64| {
            let now = DeviationMemory { stroke: off, way_back: off, ..Default::default() };
            let pushed = DeviationMemory { sooner_push: -0.1, ..now };
            let [with_it, without] = [pushed, now].map(|now| asked(&law, &with, &now));
            (with_it - without).abs()
        };
        let [near, between, far] = [0.0, 0.5 * FAR, FAR].map(sooner);
        assert!(
            near > 1.0 && (between / near - 0.5).abs() < 1e-9 && far == 0.0,
            "{near} {between} {far}"
        );
    }

    #[test]
    fn a_pressure_that_friction_holds_asks_for_nothing() {
        let (law, with) = (feedback::<f64>(), feedback().reckons(&station(), &MayBe::known(1.0)));
        let off = Watched { stroke: 0.0, load_pressure: 4e5, motor_speed: 0.3 };
        let mut memory = law.start(&with, &off);
        for _ in 0..100 {
            let speed = law.update(&mut memory, &with, &off, 0.3, 0.0);
            assert!((speed - 0.3).abs() < 1e-9, "{speed}");
        }
    }

    #[test]
    fn feedback_asks_for_no_more_than_it_may() {
        let (law, with) = (feedback::<f64>(), feedback().reckons(&station(), &MayBe::known(1.0)));
        // it swings at 1 m/s, not far off
        let mut memory = DeviationMemory { velocity: 1.0, ..Default::default() };
        assert_eq!(law.update(&mut memory, &with, &Watched::default(), 7.0, 0.0), 7.0 - 20.0);
    }

    /// Oil that gives has to be filled before a piston moves: there feedback may have as much of the motor as travel takes anyway. On stiff oil, and where travel
    /// takes little, it may not.
    #[test]
    fn on_soft_oil_feedback_may_ask_for_what_travel_takes() {
        let law = feedback::<f64>();
        let DeviationDesign { authority, motor_speed, softest, .. } = law.design;
        let asked = |stiffness: f64, travels: f64, feedforward: f64| {
            let with = law.reckons(&station(), &MayBe::known(stiffness));
            let mut memory = DeviationMemory { velocity: -10.0, ..Default::default() };
            law.update(&mut memory, &with, &Watched::default(), feedforward, travels) - feedforward
        };
        let soft = 1e-3 * softest;
        for travels in [0.0, 0.9 * authority, 1.3 * authority, 2.0 * authority] {
            assert_eq!(asked(soft, travels, 0.0), travels.max(authority));
            assert_eq!(asked(softest, travels, 0.0), authority);
        }
        // half as soft as it might be, for twice as much; no more than the motor has, and has left
        assert!((asked(0.5 * softest, 100.0, 0.0) - 2.0 * authority).abs() < 1e-9);
        assert_eq!(asked(soft, 100.0, 0.0), motor_speed);
        assert_eq!(asked(soft, 100.0, 20.0), motor_speed - 20.0);
    }

    /// A piston that was torn far off is answered by more on soft oil as long as it does not swing.
    #[test]
    fn a_wary_way_back_leaves_position_no_more_than_elsewhere() {
        let law = feedback::<f64>();
        let with = law.reckons(&station(), &MayBe::known(1e-3));
        let authority = law.design.authority;
        let reach = |swings: f64, most: f64| {
            let off = DeviationMemory { stroke: -1.0, ..Default::default() };
            let mut now = off;
            now.be_wary(swings);
            1.0 + law.way_back(&with, &now, most).left
        };
        assert!((reach(0.0, 2.0 * authority) / reach(0.0, authority) - 2.0).abs() < 1e-9);
        assert!((reach(1.0, 2.0 * authority) / reach(1.0, authority) - 1.0).abs() < 1e-9);
    }

    /// A load that was lost on the way is led back as one at rest is; what oil swings there is not, nor what swings from side to side.
    #[test]
    fn on_the_way_a_load_that_was_lost_is_led_back_eagerly() {
        let (law, with) = (feedback::<f64>(), feedback().reckons(&station(), &MayBe::known(1.0)));
        let way = |held: f64, sides: f64| {
            let push = held * with.spring.acceleration_by_pressure;
            let off = DeviationMemory { stroke: -0.1, push, ..Default::default() };
            let mut now = DeviationMemory { above: sides, below: sides, ..off };
            now.be_wary(1.0);
            law.way_back(&with, &now, law.design.authority).motor_speed
        };
        let WayBackDesign { eager, wary, .. } = law.design.way_back;
        for side in [1.0, -1.0] {
            assert_eq!(way(side * 0.9 * LOAD, 0.0), wary.motor_speed);
            assert!(way(side * 1.6 * LOAD, 0.0) > 2.0 * wary.motor_speed);
            assert_eq!(way(side * 1.6 * LOAD, 1.0), wary.motor_speed);
        }
        assert!(eager.motor_speed > 2.0 * wary.motor_speed);
    }

    /// Whichever way the motor is fed forward, what it has left beyond is all that it is braked by; but for half of what it may be at rest.
    #[test]
    fn it_is_braked_no_harder_than_it_can_be_driven() {
        let (law, with) = (feedback::<f64>(), feedback().reckons(&station(), &MayBe::known(1.0)));
        let answered = |velocity: f64, feedforward: f64| {
            let mut memory = DeviationMemory { velocity, ..Default::default() };
            law.update(&mut memory, &with, &Watched::default(), feedforward, 0.0) - feedforward
        };
        for side in [1.0, -1.0] {
            let braked = |feedforward: f64| side * answered(side, side * feedforward);
            assert_eq!([0.0, 30.0, 35.0, 45.0].map(braked), [-20.0, -20.0, -15.0, -10.0]);
            let driven = |feedforward: f64| side * answered(-side, side * feedforward);
            assert_eq!([0.0, 30.0, 35.0, 45.0].map(driven), [20.0, 20.0, 15.0, 10.0]);
        }
    }

    #[test]
    fn feedback_in_lanes_equals_that_in_f64() {
        let strokes = [-2e-3, 0.0, 1e-4, 3e-3];
        let (plain, lanes) = (feedback::<f64>(), feedback::<Lanes<4>>());
        let stiffness = [0.02, 0.3, 0.9, 1.0];
        let with = lanes.reckons(&station(), &MayBe::known(Lanes(stiffness)));
        let off = Watched {
            stroke: Lanes(strokes),
            load_pressure: Lanes([2e5; 4]),
            motor_speed: Lanes([7.0; 4]),
        };
        let mut together = DeviationMemory::<f64>::default().map(|v| Lanes([v; 4]));
        let speeds = lanes.update(&mut together, &with, &off, Lanes([8.0; 4]), Lanes([40.0; 4]));
        for (lane, stroke) in strokes.into_iter().enumerate() {
            let mut memory = DeviationMemory::default();
            let off = Watched { stroke, load_pressure: 2e5, motor_speed: 7.0 };
            let with = plain.reckons(&station(), &MayBe::known(stiffness[lane]));
            assert_eq!(plain.update(&mut memory, &with, &off, 8.0, 40.0), speeds.0[lane]);
            assert_eq!(memory, together.map(|v| v.0[lane]));
        }
    }
}
