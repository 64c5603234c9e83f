//! Model following: the simulated crane is made to follow the reference, and the machine the simulated crane.
//!
//! ```text
//! reference -> state feedback -> simulated crane -> its motor speed, state
//!                                                        |          |
//!                              machine <- motor speed <- (+) <- PI and pressure feedback on what the machine lacks
//! ```
//!
//! The simulation's state is known and free of noise, so that its loop may be as fast as the machine is to be steered. What
//! it asks of its motor is the feedforward. The benchmark's PI and pressure feedback then see only by how much the machine
//! differs from the simulation, and damp what is already damped no second time.

use crate::{Benchmark, HighPass, Measured, MotorLimits, Reference};
use hydroboom_math::{Real, record};

record! {
    /// What is seen of the simulated crane.
    pub struct Seen<T> {
        /// Piston position, x_cyl
        #[unit = "m"]
        pub stroke: T,
        /// Piston velocity, v_cyl
        #[unit = "m/s"]
        pub velocity: T,
        /// Load pressure, p_L = p_A − (A_r/A_p) p_B
        #[unit = "Pa"]
        pub load_pressure: T,
    }
}

impl<T: Real> Seen<T> {
    /// What a measurement would show of it.
    pub fn measured(&self) -> Measured<T> {
        Measured { stroke: self.stroke, load_pressure: self.load_pressure }
    }
}

record! {
    /// The crane at a piston position as a mass on an oil spring, in small changes of piston position x, velocity v, load
    /// pressure p and motor speed n: `v' = a_x x + a_v v + a_p p`, `p' = c_x x + c_v v + c_p p + b n`.
    pub struct OilSpring<T> {
        /// a_x
        #[unit = "1/s²"]
        pub acceleration_by_stroke: T,
        /// a_v
        #[unit = "1/s"]
        pub acceleration_by_velocity: T,
        /// a_p
        #[unit = "m/(s² Pa)"]
        pub acceleration_by_pressure: T,
        /// c_x
        #[unit = "Pa/(s m)"]
        pub pressure_by_stroke: T,
        /// c_v
        #[unit = "Pa/m"]
        pub pressure_by_velocity: T,
        /// c_p
        #[unit = "1/s"]
        pub pressure_by_pressure: T,
        /// b
        #[unit = "Pa/rev"]
        pub pressure_by_speed: T,
    }
}

record! {
    /// What a lag of each is worth in motor speed.
    pub struct Gains<T> {
        /// Of position
        #[unit = "rev/(s m)"]
        pub position: T,
        /// Of velocity
        #[unit = "rev/m"]
        pub velocity: T,
        /// Of load pressure
        #[unit = "rev/(s Pa)"]
        pub pressure: T,
        /// Of position, summed up over time
        #[unit = "rev/(s² m)"]
        pub integral: T,
    }
}

impl<T: Real> OilSpring<T> {
    /// Natural frequency of the mass on the oil \[rad/s\].
    #[inline(always)]
    pub fn ring(&self) -> T {
        (-self.acceleration_by_pressure * self.pressure_by_velocity).sqrt()
    }

    /// Gains that place the poles of position, velocity, pressure and integral: a pair of natural frequency `ring` \[rad/s\] and
    /// damping ratio `damping`, and two at −`bandwidth` \[rad/s\]. By comparing coefficients of
    /// `s (s − c_p + b k_p)(s² − a_v s − a_x) − a_p s (c_x + c_v s) + a_p b (k_i + k_x s + k_v s²)`.
    pub fn gains(&self, ring: T, damping: T, bandwidth: T) -> Gains<T> {
        let [a_x, a_v, a_p, c_x, c_v, c_p, b] = self.to_array();
        let two = T::lit(2.0);
        // (s² + 2 ζ ω s + ω²)(s + ω_b)²
        let (q1, q0) = (two * damping * ring, ring.square());
        let (r1, r0) = (two * bandwidth, bandwidth.square());
        let d3 = q1 + r1;
        let d2 = q0 + q1 * r1 + r0;
        let d1 = q0 * r1 + q1 * r0;
        let d0 = q0 * r0;
        // what the pressure's own pole becomes
        let kept = d3 + a_v;
        Gains {
            pressure: (kept + c_p) / b,
            velocity: (d2 + a_x + a_v * kept + a_p * c_v) / (a_p * b),
            position: (d1 + a_x * kept + a_p * c_x) / (a_p * b),
            integral: d0 / (a_p * b),
        }
    }
}

record! {
    /// All that is known of the simulated crane at a piston position.
    pub struct Station<T> {
        /// Load pressure at rest, p_0
        #[unit = "Pa"]
        pub load_pressure: T,
        /// Its change along the stroke
        #[unit = "Pa/m"]
        pub load_pressure_slope: T,
        /// Motor speed that makes good for leakage at rest, n_0
        #[unit = "rev/s"]
        pub holding_speed: T,
        /// Acceleration by stroke, a_x
        #[unit = "1/s²"]
        pub acceleration_by_stroke: T,
        /// Acceleration by velocity, a_v
        #[unit = "1/s"]
        pub acceleration_by_velocity: T,
        /// Acceleration by load pressure, a_p
        #[unit = "m/(s² Pa)"]
        pub acceleration_by_pressure: T,
        /// Rate of the load pressure by velocity in stiff oil, c_v
        #[unit = "Pa/m"]
        pub pressure_by_velocity: T,
        /// Rate of the load pressure by motor speed in stiff oil, b
        #[unit = "Pa/rev"]
        pub pressure_by_speed: T,
    }
}

impl<T: Real> Station<T> {
    /// From the load pressure at rest, its slope and the motor speed that holds it, and the spring there, which has `stiffness` of
    /// stiff oil's.
    pub fn new([pressure, slope, holding]: [T; 3], spring: &OilSpring<T>, stiffness: T) -> Self {
        Self {
            load_pressure: pressure,
            load_pressure_slope: slope,
            holding_speed: holding,
            acceleration_by_stroke: spring.acceleration_by_stroke,
            acceleration_by_velocity: spring.acceleration_by_velocity,
            acceleration_by_pressure: spring.acceleration_by_pressure,
            pressure_by_velocity: spring.pressure_by_velocity / stiffness,
            pressure_by_speed: spring.pressure_by_speed / stiffness,
        }
    }

    /// The oil spring where the oil has `stiffness` of stiff oil's. What leaks by pressure is left to the integral.
    #[inline(always)]
    pub fn spring(&self, stiffness: T) -> OilSpring<T> {
        let zero = T::zero();
        OilSpring {
            acceleration_by_stroke: self.acceleration_by_stroke,
            acceleration_by_velocity: self.acceleration_by_velocity,
            acceleration_by_pressure: self.acceleration_by_pressure,
            pressure_by_stroke: zero,
            pressure_by_velocity: self.pressure_by_velocity * stiffness,
            pressure_by_pressure: zero,
            pressure_by_speed: self.pressure_by_speed * stiffness,
        }
    }
}

record! {
    /// What the state feedback remembers.
    pub struct FollowingMemory<T> {
        /// Lag of the position, summed up
        #[unit = "m s"]
        pub lag: T,
        /// Velocity of the reference a period ago
        #[unit = "m/s"]
        pub reference_velocity: T,
        /// Share of feedback, smoothed once
        #[unit = "rev/s"]
        pub once: T,
        /// Share of feedback, smoothed twice
        #[unit = "rev/s"]
        pub feedback: T,
        /// Speed of the simulated motor
        #[unit = "rev/s"]
        pub motor_speed: T,
    }
}

/// What state feedback asks for.
struct Wanted<T> {
    /// Motor speed that the reference takes \[rev/s\].
    feedforward: T,
    /// What state feedback adds where the oil is as stiff as it is wanted to be \[rev/s\].
    feedback: T,
    /// How much more of that it takes in the oil as it is.
    softer: T,
    /// How far the simulated crane is behind \[m\].
    lag: T,
    /// What the lag summed up is worth \[rev/(s² m)\].
    by_lag: T,
}

/// Feedback is raised by no more than this where the pressure dips into soft oil.
const SOFTEST: f64 = 2.0;

/// Piston positions at which the simulated crane is known; in between it is interpolated.
pub const STATIONS: usize = 17;

record! {
    /// Bulk modulus over pressure (7), `β(p) = (β_max + β_min)/2 + (β_max − β_min)/2 tanh((p − p_c1)/p_c2)`.
    pub struct OilStiffness<T> {
        /// β_max
        #[unit = "Pa"]
        pub highest: T,
        /// β_min
        #[unit = "Pa"]
        pub lowest: T,
        /// p_c1
        #[unit = "Pa"]
        pub transition: T,
        /// p_c2
        #[unit = "Pa"]
        pub width: T,
    }
}

impl<T: Real> OilStiffness<T> {
    /// Bulk modulus at a pressure \[Pa\], as a share of the highest.
    #[inline(always)]
    pub fn share(&self, pressure: T) -> T {
        let half = T::lit(0.5);
        let lowest = self.lowest / self.highest;
        let step = ((pressure - self.transition) / self.width).tanh();
        half * (T::one() + lowest) + half * (T::one() - lowest) * step
    }

    /// Share of its volume by which oil shrinks from the pressure p_c1 to another \[Pa\], `∫ dp/β`: with z = (p − p_c1)/p_c2, m and d
    /// half the sum and half the difference of both limits, `p_c2/(m² − d²) (m z − d ln((β_max e^z + β_min e^−z)/(2 m)))`.
    pub fn compression(&self, pressure: T) -> T {
        let half = T::lit(0.5);
        let (mean, difference) =
            (half * (self.highest + self.lowest), half * (self.highest - self.lowest));
        let z = (pressure - self.transition) / self.width;
        // the larger power is taken out, so that none overflows
        let up = T::zero().lt(z);
        let away = T::select(up, z, -z);
        let small = (-(away + away)).exp();
        let sum =
            T::select(up, self.highest + self.lowest * small, self.highest * small + self.lowest);
        let log = away + (half * sum / mean).ln();
        self.width / (self.highest * self.lowest) * (mean * z - difference * log)
    }
}

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
    /// What the piston side has beyond the load pressure, for the rod side \[Pa\].
    pub beyond_load: T,
    /// What of a change of the feedback's share is followed in a period, twice over: the boom's bending is not to be fed back.
    pub smoothing: T,
    /// Time from a command to what is read of it \[s\]: so far the simulated crane is ahead of the reference.
    pub lead: T,
    /// High-pass of the pressure feedback.
    pub high_pass: HighPass<T>,
    /// By how much the pressure may dip in motion, below which the oil is taken to be as soft as there \[Pa\].
    pub dip: T,
    /// Proportional gain of feedback from the machine, as a share of the frequency at which it rings.
    pub feedback_share: T,
    /// Integral gain, as a share of the proportional gain's square.
    pub feedback_integral: T,
    /// Pressure feedback over the benchmark's: its high-pass is faster, which takes some of its damping.
    pub feedback_pressure: T,
    /// Damping ratio that the simulated crane's ringing is to have.
    pub damping: T,
    /// Bandwidth of its position \[rad/s\], where the oil is stiff enough for it.
    pub bandwidth: T,
    /// The motor's limits.
    pub limits: MotorLimits<T>,
    /// Sample period \[s\].
    pub period: T,
}

impl<T: Real> ModelFollowing<T> {
    /// Memory to start with, at rest.
    pub fn start(&self) -> FollowingMemory<T> {
        let zero = T::zero();
        FollowingMemory::from_array([zero; FollowingMemory::NAMES.len()])
    }

    /// What lies between this one and another, by the other's share, 0 to 1: for payloads in between.
    pub fn between(&self, other: &Self, share: T) -> Self {
        let mut new = *self;
        for (station, other) in new.stations.iter_mut().zip(&other.stations) {
            let (a, b) = (station.to_array(), other.to_array());
            *station =
                Station::from_array(core::array::from_fn(|i| share.mul_add(b[i] - a[i], a[i])));
        }
        new
    }

    /// The crane at a position \[m\].
    #[inline(always)]
    pub fn station(&self, stroke: T) -> Station<T> {
        let last = T::lit((STATIONS - 1) as f64);
        let place = ((stroke - self.first) / self.spacing).clamp(T::zero(), last);
        // every station weighs by how near it is: none is chosen by a condition on the position
        let mut sum = Station::from_array([T::zero(); Station::NAMES.len()]);
        for (k, station) in self.stations.iter().enumerate() {
            let away = (place - T::lit(k as f64)).abs();
            let weight = (T::one() - away).max(T::zero());
            sum = Station::from_array(core::array::from_fn(|i| {
                weight.mul_add(station.to_array()[i], sum.to_array()[i])
            }));
        }
        sum
    }

    /// Bulk modulus at a load pressure \[Pa\], as a share of stiff oil's.
    #[inline(always)]
    pub fn stiffness_at(&self, load_pressure: T) -> T {
        self.stiffness.share(load_pressure + self.beyond_load)
    }

    /// Motor speed \[rev/s\] of the simulated crane for the coming period.
    ///
    /// The reference, as it will be a lead later, has its load pressure and motor speed by the oil spring's equations:
    /// `p* = p_0 + (a − a_v v)/a_p + p_fr`, `n* = n_0 + (p_0' v/s − c_v v)/b`; then
    /// `n = n* + (s*/s) (k_x (x* − x) + k_v (v* − v) + k_p (p* − p) + k_i ∫(x* − x))`, s being the stiffness of the oil at the pressure that is,
    /// and s* at the one that is wanted. The integral holds while the motor cannot follow and the lag would drive it further.
    #[inline(always)]
    pub fn update(
        &self,
        memory: &mut FollowingMemory<T>,
        reference: &Reference<T>,
        seen: &Seen<T>,
    ) -> T {
        let Wanted { feedforward, feedback, softer, lag, .. } =
            self.wanted(memory, reference, seen);
        memory.reference_velocity = reference.velocity;
        memory.once = memory.once + self.smoothing * (feedback - memory.once);
        memory.feedback = memory.feedback + self.smoothing * (memory.once - memory.feedback);
        let wanted = feedforward + memory.feedback * softer;
        let reached = self.limits.follow(memory.motor_speed, wanted, self.period);
        let zero = T::zero();
        let winding = (reached.lt(wanted) & zero.lt(lag)) | (wanted.lt(reached) & lag.lt(zero));
        memory.lag = T::select(winding, memory.lag, memory.lag + self.period * lag);
        memory.motor_speed = reached;
        reached
    }

    /// Memory with which the next [`update`](Self::update) asks for `speed` \[rev/s\], so that state feedback takes over from
    /// whatever moved the simulated crane until now without a bump.
    pub fn take_over(
        &self,
        reference: &Reference<T>,
        seen: &Seen<T>,
        speed: T,
    ) -> FollowingMemory<T> {
        let zero = T::zero();
        let velocity = reference.velocity;
        let mut memory = FollowingMemory {
            lag: zero,
            reference_velocity: velocity,
            once: zero,
            feedback: zero,
            motor_speed: speed,
        };
        let wanted = self.wanted(&memory, reference, seen);
        memory.feedback = (speed - wanted.feedforward) / wanted.softer;
        memory.once = memory.feedback;
        memory.lag = (memory.feedback - wanted.feedback) / wanted.by_lag;
        memory
    }

    #[inline(always)]
    fn wanted(
        &self,
        memory: &FollowingMemory<T>,
        reference: &Reference<T>,
        seen: &Seen<T>,
    ) -> Wanted<T> {
        let half = T::lit(0.5);
        let acceleration = (reference.velocity - memory.reference_velocity) / self.period;
        let gained = self.lead * acceleration;
        let v = reference.velocity + gained;
        let position = reference.position + self.lead * (reference.velocity + half * gained);

        let at = self.station(position);
        let friction = self.friction_pressure * (v / self.friction_speed).tanh();
        let moving = (acceleration - at.acceleration_by_velocity * v) / at.acceleration_by_pressure;
        let pressure = at.load_pressure + moving + friction;
        let [wanted_stiffness, stiffness] =
            [pressure, seen.load_pressure].map(|load| self.stiffness_at(load));
        let spring = at.spring(wanted_stiffness);
        let rate = (at.load_pressure_slope - spring.pressure_by_velocity) * v;
        let feedforward = at.holding_speed + rate / spring.pressure_by_speed;

        let gains = self.gains(&spring);
        let lag = position - seen.stroke;
        let by_lag = gains.integral;
        let feedback = gains.position * lag
            + gains.velocity * (v - seen.velocity)
            + gains.pressure * (pressure - seen.load_pressure);
        let feedback = feedback + by_lag * memory.lag;
        // a dip into soft oil is over before much more of the pump would help
        let softer = (wanted_stiffness / stiffness).min(T::lit(SOFTEST));
        Wanted { feedforward, feedback, softer, lag, by_lag }
    }

    /// Gains at a position \[m\] with the crane at rest.
    pub fn gains_at_rest(&self, stroke: T) -> Gains<T> {
        let at = self.station(stroke);
        self.gains(&at.spring(self.stiffness_at(at.load_pressure)))
    }

    #[inline(always)]
    fn gains(&self, spring: &OilSpring<T>) -> Gains<T> {
        let ring = spring.ring();
        spring.gains(ring, self.damping, ring.min(self.bandwidth))
    }

    /// What feedback from the machine is to bring together: where the simulated crane was a lead ago, and by how much the machine's load
    /// pressure differs.
    #[inline(always)]
    pub fn compared(&self, measured: &Measured<T>, seen: &Seen<T>) -> (Reference<T>, Measured<T>) {
        let position = seen.stroke - self.lead * seen.velocity;
        let load_pressure = measured.load_pressure - seen.load_pressure;
        (
            Reference { position, velocity: seen.velocity },
            Measured { stroke: measured.stroke, load_pressure },
        )
    }

    /// The benchmark controller for what the machine lacks: its gains as they are where the oil is stiff, less where it is soft,
    /// as the crane at a position \[m\] bears them; its high-pass as fast as the crane rings.
    #[inline(always)]
    pub fn feedback(&self, benchmark: &Benchmark<T>, stroke: T) -> Benchmark<T> {
        let at = self.station(stroke);
        let stiffness = self.stiffness_at(at.load_pressure - self.dip);
        let ring = at.spring(stiffness).ring();
        let share = self.feedback_share * ring;
        Benchmark {
            proportional: share.min(benchmark.proportional),
            integral: (self.feedback_integral * share.square()).min(benchmark.integral),
            pressure_feedback: self.feedback_pressure * benchmark.pressure_feedback,
            high_pass: self.high_pass,
            ..*benchmark
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_math::{Dual, Lanes};

    fn oil<T: Real>() -> OilStiffness<T> {
        OilStiffness {
            highest: T::lit(1.6e9),
            lowest: T::lit(2e7),
            transition: T::lit(35e5),
            width: T::lit(5e5),
        }
    }

    /// The paper's crane in round numbers, alike over its whole stroke.
    fn law<T: Real>() -> ModelFollowing<T> {
        let lit = T::lit;
        let station =
            Station::from_array([65e5, -1e6, 0.11, -0.3, -0.2, 2e-7, -1.1e9, 3.2e6].map(T::lit));
        ModelFollowing {
            stations: [station; STATIONS],
            first: lit(0.005),
            spacing: lit(0.49 / 16.0),
            friction_pressure: lit(1.7e5),
            friction_speed: lit(4e-3),
            stiffness: oil(),
            beyond_load: lit(2e5),
            smoothing: lit(0.15),
            lead: lit(5e-3),
            high_pass: HighPass::new(lit(0.2), lit(1e-3)),
            dip: lit(7e5),
            feedback_share: lit(0.25),
            feedback_integral: lit(0.6),
            feedback_pressure: lit(0.6),
            damping: lit(0.7),
            bandwidth: lit(12.6),
            limits: MotorLimits { speed: lit(50.0), slew: lit(500.0) },
            period: lit(1e-3),
        }
    }

    #[test]
    fn compression_is_the_integral_of_one_over_the_bulk_modulus() {
        let oil = oil::<Dual<f64, 1>>();
        for bar in [-1.0, 0.0, 10.0, 34.0, 35.0, 40.0, 90.0, 400.0, 4000.0] {
            let pressure = Dual::variable(bar * 1e5, 0);
            let slope = oil.compression(pressure).slope[0];
            let wanted = 1.0 / (1.6e9 * oil.share(pressure).value);
            assert!((slope / wanted - 1.0).abs() < 1e-9, "{bar} bar: {slope} for {wanted}");
        }
    }

    #[test]
    fn poles_are_where_they_were_wished() {
        let spring = OilSpring::from_array([-0.3, -0.2, 2e-7, 1e7, -1.1e9, -0.03, 3.2e6]);
        let (ring, damping, bandwidth) = (15.0, 0.7, 9.0);
        let g: Gains<f64> = spring.gains(ring, damping, bandwidth);
        let [a_x, a_v, a_p, c_x, c_v, c_p, b] = spring.to_array();
        // s (s − c_p + b k_p)(s² − a_v s − a_x) − a_p s (c_x + c_v s) + a_p b (k_i + k_x s + k_v s²) at its wished zeros, which
        // come in powers of a complex s = r + i m
        let at = |r: f64, m: f64| {
            let mul = |(p, q): (f64, f64), (x, y): (f64, f64)| (p * x - q * y, p * y + q * x);
            let s = (r, m);
            let s2 = mul(s, s);
            let pressure = (r - c_p + b * g.pressure, m);
            let mass = (s2.0 - a_v * r - a_x, s2.1 - a_v * m);
            let first = mul(s, mul(pressure, mass));
            let flow = mul(s, (c_x + c_v * r, c_v * m));
            let back = (
                g.integral + g.position * r + g.velocity * s2.0,
                g.position * m + g.velocity * s2.1,
            );
            let re = first.0 - a_p * flow.0 + a_p * b * back.0;
            let im = first.1 - a_p * flow.1 + a_p * b * back.1;
            (re.abs() + im.abs()) / (ring * ring * bandwidth * bandwidth)
        };
        let turned = ring * Real::sqrt(1.0 - damping * damping);
        assert!(at(-ring * damping, turned) < 1e-9);
        assert!(at(-bandwidth, 0.0) < 1e-9);
    }

    #[test]
    fn it_takes_over_at_the_speed_that_it_finds() {
        let law = law::<f64>();
        let reference = Reference { position: 0.21, velocity: 0.05 };
        let seen = Seen { stroke: 0.2095, velocity: 0.045, load_pressure: 66e5 };
        let mut memory = law.take_over(&reference, &seen, 12.5);
        let next = law.update(&mut memory, &reference, &seen);
        assert!((next - 12.5).abs() < 1e-9, "{next}");
    }

    #[test]
    fn a_motor_that_cannot_follow_does_not_wind_the_integral_up() {
        let law = law::<f64>();
        let mut memory = law.start();
        let reference = Reference { position: 0.4, velocity: 0.0 };
        let far = Seen { stroke: 0.1, velocity: 0.0, load_pressure: 65e5 };
        for _ in 0..5000 {
            law.update(&mut memory, &reference, &far);
        }
        assert_eq!((memory.motor_speed, memory.lag), (50.0, 0.0));
    }

    #[test]
    fn soft_oil_is_fed_back_to_gently_and_stiff_oil_as_the_benchmark_at_most() {
        let benchmark = Benchmark {
            proportional: 4.5,
            integral: 14.45,
            pressure_feedback: 4.77e-11,
            high_pass: HighPass::new(1.04, 1e-3),
            revolutions_per_metre: 313.05,
            displacement: 10.6e-6,
            limits: MotorLimits { speed: 50.0, slew: 500.0 },
            period: 1e-3,
        };
        let stiff = law::<f64>().feedback(&benchmark, 0.25);
        let mut light = law::<f64>();
        light.stations.iter_mut().for_each(|s| s.load_pressure = 12e5);
        let soft = light.feedback(&benchmark, 0.25);
        assert!(soft.proportional < 0.2 * stiff.proportional, "{soft:?}");
        assert!(stiff.proportional <= 4.5 && stiff.integral <= 14.45);
    }

    #[test]
    fn state_feedback_in_lanes_equals_that_in_f64() {
        let strokes = [0.003, 0.2, 0.31, 0.499];
        let (plain, lanes) = (law::<f64>(), law::<Lanes<4>>());
        let reference = Reference { position: 0.25, velocity: 0.1 };
        let mut together = lanes.start();
        let seen = Seen {
            stroke: Lanes(strokes),
            velocity: Lanes([0.09; 4]),
            load_pressure: Lanes([40e5; 4]),
        };
        let speeds = lanes.update(&mut together, &reference.map(|v| Lanes([v; 4])), &seen);
        for (lane, stroke) in strokes.into_iter().enumerate() {
            let mut memory = plain.start();
            let seen = Seen { stroke, velocity: 0.09, load_pressure: 40e5 };
            assert_eq!(plain.update(&mut memory, &reference, &seen), speeds.0[lane]);
            assert_eq!(memory.lag, together.lag.0[lane]);
        }
    }
}
