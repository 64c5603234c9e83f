//! What becomes of the oil that the pump delivers: travel of the piston, compression, leakage. Learned while the machine works.
//!
//! ```text
//! A_p Δx = g ΔV_pump − V ΔS(p_A) − l Δt − c |Δφ| p           over windows of a tenth of a second
//! ```
//!
//! g is the pump's flow gain, l the leakage, c the pump's slip over each revolution and pressure, S(p) the share of its volume by which oil
//! shrinks up to a pressure, which hangs on the pressure p_c1 at which it stiffens. For each of some p_c1 that are thought possible g, l
//! and c are found by Bayes' rule. A window speaks against a p_c1 as far as it is further from its balance than it may be off, by what is misread of position and
//! pressure (which on soft oil is a lot of oil) and known badly of volumes: without excitation nothing is learned. What was learned is
//! forgotten at the rate of its memory, down to what was known before and never below: slip takes from what goes up and adds to what comes
//! down, so that a pump is known by what it does over a cycle.

use crate::OilStiffness;
use crate::belief::{Belief, Off};
use hydroboom_math::{Real, record};

/// How many pressures at which the oil may stiffen are weighed.
pub const TRANSITIONS: usize = 11;
/// Flow gain, leakage, slip.
const SOUGHT: usize = 3;

/// Squares of so many standard deviations speak against nothing.
const FITS: f64 = 2.0;
/// Pressures that differ by less are the same \[Pa\]: they were written to a file in between.
const SAME: f64 = 1.0;
/// What is learned stays within so many standard deviations of what was known before.
const BOUND: f64 = 4.0;

record! {
    /// What is known of the flow balance.
    pub struct Balance<T> {
        /// Pump delivery per nominal displacement, g
        #[unit = "1"]
        pub flow_gain: T,
        /// Leakage, l
        #[unit = "m³/s"]
        pub leakage: T,
        /// Pump slip over each revolution, by pressure, c
        #[unit = "m³/(rev Pa)"]
        pub slip: T,
        /// Pressure at the middle of the oil's transition, p_c1
        #[unit = "Pa"]
        pub transition: T,
    }
}

record! {
    /// What is believed, were the oil to stiffen at a certain pressure.
    pub struct Believed<T> {
        /// That pressure, p_c1
        #[unit = "Pa"]
        pub transition: T,
        /// Pump delivery per nominal displacement, g
        #[unit = "1"]
        pub flow_gain: T,
        /// Leakage, l
        #[unit = "m³/s"]
        pub leakage: T,
        /// Pump slip, c
        #[unit = "m³/(rev Pa)"]
        pub slip: T,
        /// Variance of g
        #[unit = "1"]
        pub flow_gain_variance: T,
        /// Covariance of g and l
        #[unit = "m³/s"]
        pub flow_gain_leakage: T,
        /// Covariance of g and c
        #[unit = "m³/(rev Pa)"]
        pub flow_gain_slip: T,
        /// Variance of l
        #[unit = "m⁶/s²"]
        pub leakage_variance: T,
        /// Covariance of l and c
        #[unit = "m⁶/(s rev Pa)"]
        pub leakage_slip: T,
        /// Variance of c
        #[unit = "m⁶/(rev² Pa²)"]
        pub slip_variance: T,
        /// Logarithm of how likely it is by what has been seen
        #[unit = "1"]
        pub likelihood: T,
    }
}

/// The cylinder's piston side with pump and line, and what is known of it before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlowBalance {
    /// Piston area \[m²\].
    pub piston_area: f64,
    /// Pump displacement \[m³/rev\].
    pub displacement: f64,
    /// Oil volume with the piston at zero \[m³\].
    pub volume: f64,
    /// Pressure that the pump draws from \[Pa\].
    pub suction: f64,
    /// The oil, as known before.
    pub stiffness: OilStiffness<f64>,
    /// What is known before.
    pub before: Balance<f64>,
    /// How uncertain that is, as standard deviations.
    pub uncertainty: Balance<f64>,
    /// Standard deviation of what a window says of the piston's travel \[m\].
    pub scatter: f64,
    /// Standard deviation of what a window says of the pressure's change \[Pa\]: on soft oil that is a lot of oil.
    pub pressure_scatter: f64,
    /// How far the compression may be off, as a share of it: volumes are not known better.
    pub compression_error: f64,
    /// Periods in a window.
    pub window: u32,
    /// What is left of a window's weight a window later.
    pub memory: f64,
    /// Sample period \[s\].
    pub period: f64,
}

/// g, l and c, were the oil to stiffen at a certain pressure.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Hypothesis {
    oil: OilStiffness<f64>,
    belief: Belief<SOUGHT>,
    /// Logarithm of how likely it was before, and of what has been seen under it.
    prior: f64,
    likelihood: f64,
}

/// What was learned, and the window that is under way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlowBalanceMemory {
    hypotheses: [Hypothesis; TRANSITIONS],
    revolutions: f64,
    stroke: f64,
    pressure: f64,
    count: u32,
    /// What is known now.
    pub balance: Balance<f64>,
    /// Standard deviation of the pressure at which the oil stiffens \[Pa\].
    pub doubt: f64,
}

impl FlowBalanceMemory {
    /// What is believed, to go on with later.
    pub fn believed(&self) -> [Believed<f64>; TRANSITIONS] {
        self.hypotheses.map(|h| {
            let [flow_gain, leakage, slip] = h.belief.estimate;
            let [g, l, c] = h.belief.covariance;
            Believed {
                transition: h.oil.transition,
                flow_gain,
                leakage,
                slip,
                flow_gain_variance: g[0],
                flow_gain_leakage: g[1],
                flow_gain_slip: g[2],
                leakage_variance: l[1],
                leakage_slip: l[2],
                slip_variance: c[2],
                likelihood: h.likelihood,
            }
        })
    }

    /// A window begins at a position \[m\] and a pressure \[Pa\].
    pub fn begin_window(&mut self, stroke: f64, pressure: f64) {
        (self.revolutions, self.count) = (0.0, 0);
        (self.stroke, self.pressure) = (stroke, pressure);
    }
}

impl FlowBalance {
    /// Nothing learned yet, at a piston position \[m\] and pressure \[Pa\].
    pub fn start(&self, stroke: f64, pressure: f64) -> FlowBalanceMemory {
        let middle = (TRANSITIONS / 2) as f64;
        let hypotheses = core::array::from_fn(|k| {
            // half a standard deviation apart
            let away = 0.5 * (k as f64 - middle);
            let transition = self.before.transition + away * self.uncertainty.transition;
            Hypothesis {
                oil: OilStiffness { transition, ..self.stiffness },
                belief: Belief::new(sought(&self.before), &sought(&self.uncertainty)),
                prior: -0.5 * away * away,
                likelihood: 0.0,
            }
        });
        let (balance, doubt) = (self.before, self.uncertainty.transition);
        FlowBalanceMemory {
            hypotheses,
            revolutions: 0.0,
            stroke,
            pressure,
            count: 0,
            balance,
            doubt,
        }
    }

    /// Goes on with what was believed before; none where that is about another crane, or nothing that can be believed.
    pub fn resume(&self, believed: &[Believed<f64>; TRANSITIONS]) -> Option<FlowBalanceMemory> {
        let mut memory = self.start(0.0, 0.0);
        for (h, b) in memory.hypotheses.iter_mut().zip(believed) {
            let same = (b.transition - h.oil.transition).abs() <= SAME;
            let covariance = [
                [b.flow_gain_variance, b.flow_gain_leakage, b.flow_gain_slip],
                [b.flow_gain_leakage, b.leakage_variance, b.leakage_slip],
                [b.flow_gain_slip, b.leakage_slip, b.slip_variance],
            ];
            h.belief = Belief { estimate: [b.flow_gain, b.leakage, b.slip], covariance };
            if !h.belief.is_sound() || !b.likelihood.is_finite() || !same {
                return None;
            }
            h.likelihood = b.likelihood;
        }
        let (found, doubt) = mean(&memory.hypotheses);
        (memory.balance, memory.doubt) = (self.bounded(found), doubt);
        Some(memory)
    }

    /// A period in which the motor turned at a speed \[rev/s\], and ended at a position \[m\] and a pressure \[Pa\]. True at the end of
    /// a window, when something was learned. A window with a reading that is no number is left out.
    pub fn update(
        &self,
        memory: &mut FlowBalanceMemory,
        speed: f64,
        stroke: f64,
        pressure: f64,
    ) -> bool {
        memory.revolutions += speed * self.period;
        memory.count += 1;
        if memory.count < self.window {
            return false;
        }
        let travel = self.piston_area * (stroke - memory.stroke);
        let volume = self.volume + self.piston_area * stroke;
        let turned = memory.revolutions;
        let lifted = 0.5 * (pressure + memory.pressure) - self.suction;
        let features = [
            self.displacement * turned,
            -self.period * f64::from(memory.count),
            -turned.abs() * lifted,
        ];
        let sound = (travel + features[0] + memory.pressure + pressure).is_finite();
        if sound {
            for hypothesis in &mut memory.hypotheses {
                let oil = &hypothesis.oil;
                let shrunk =
                    volume * (oil.compression(pressure) - oil.compression(memory.pressure));
                // what a pressure that is read wrongly looks like
                let modulus = oil.share(pressure).min(oil.share(memory.pressure)) * oil.highest;
                let misread = volume * self.pressure_scatter / modulus;
                let doubt = (self.compression_error * shrunk).square() + misread.square();
                self.weigh(hypothesis, &features, travel + shrunk, doubt);
            }
            let (found, doubt) = mean(&memory.hypotheses);
            (memory.balance, memory.doubt) = (self.bounded(found), doubt);
        }
        memory.begin_window(stroke, pressure);
        sound
    }

    /// What is believed, no farther from what was known before than is thought possible; oil does not leak in.
    fn bounded(&self, found: Balance<f64>) -> Balance<f64> {
        let (before, by) = (&self.before, &self.uncertainty);
        let far = BOUND * by.flow_gain;
        let flow_gain = found.flow_gain.clamp(before.flow_gain - far, before.flow_gain + far);
        let leakage = found.leakage.clamp(0.0, before.leakage + BOUND * by.leakage);
        let slip = found.slip.clamp(0.0, before.slip + BOUND * by.slip);
        Balance { flow_gain, leakage, slip, ..found }
    }

    fn weigh(&self, h: &mut Hypothesis, features: &[f64; SOUGHT], seen: f64, doubt: f64) {
        h.belief.forget(1.0 - self.memory, &sought(&self.uncertainty));
        let own = (self.piston_area * self.scatter).square() + doubt;
        let Off { off, variance } = h.belief.learn(features, seen, own);
        // what fits as well as it may speaks for nothing: where everything rests that is oil of any stiffness
        let against = 0.5 * (off * off / variance - FITS).max(0.0);
        h.likelihood = self.memory * h.likelihood - against;
    }
}

fn sought(balance: &Balance<f64>) -> [f64; SOUGHT] {
    [balance.flow_gain, balance.leakage, balance.slip]
}

/// What all hypotheses together say, each by how likely it is; and by how much they differ in the pressure at which the oil stiffens.
fn mean(hypotheses: &[Hypothesis; TRANSITIONS]) -> (Balance<f64>, f64) {
    let log = |h: &Hypothesis| h.prior + h.likelihood;
    let best = hypotheses.iter().map(log).fold(f64::NEG_INFINITY, f64::max);
    let mean = |of: &dyn Fn(&Hypothesis) -> f64| {
        let weights = hypotheses.iter().map(|h| (Real::exp(log(h) - best), of(h)));
        let [weight, sum] =
            weights.fold([0.0; 2], |[weight, sum], (w, value)| [weight + w, sum + w * value]);
        sum / weight
    };
    let transition = mean(&|h| h.oil.transition);
    let variance = mean(&|h| (h.oil.transition - transition).square());
    let [flow_gain, leakage, slip] = core::array::from_fn(|k| mean(&|h| h.belief.estimate[k]));
    (Balance { flow_gain, leakage, slip, transition }, Real::sqrt(variance))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn oil(transition: f64) -> OilStiffness<f64> {
        OilStiffness { highest: 1.6e9, lowest: 2e7, transition, width: 5e5 }
    }

    fn balance() -> FlowBalance {
        FlowBalance {
            piston_area: 3.3e-3,
            displacement: 10.6e-6,
            volume: 4e-3,
            stiffness: oil(35e5),
            suction: 2e5,
            before: Balance { flow_gain: 0.91, leakage: 1.2e-6, slip: 0.0, transition: 35e5 },
            uncertainty: Balance {
                flow_gain: 0.03,
                leakage: 1.2e-6,
                slip: 1.5e-14,
                transition: 8e5,
            },
            scatter: 1e-4,
            pressure_scatter: 1e4,
            compression_error: 0.15,
            window: 100,
            memory: 0.999,
            period: 1e-3,
        }
    }

    /// A piston that goes where its oil lets it: motor speeds \[rev/s\] and pressures \[Pa\] over time, then what is learned.
    fn learned(
        truth: Balance<f64>,
        seconds: u32,
        speed: impl Fn(f64) -> f64,
        pressure: impl Fn(f64) -> f64,
    ) -> FlowBalanceMemory {
        let flow = balance();
        let oil = oil(truth.transition);
        let mut stroke = 0.1;
        let mut before = pressure(0.0);
        let mut memory = flow.start(stroke, before);
        for k in 1..=1000 * seconds {
            let time = 1e-3 * f64::from(k);
            let now = pressure(time);
            let shrunk = oil.compression(now) - oil.compression(before);
            let volume = flow.volume + flow.piston_area * stroke;
            let pumped = truth.flow_gain * flow.displacement * speed(time) * flow.period;
            let lost = truth.leakage * flow.period;
            stroke += (pumped - lost - volume * shrunk) / flow.piston_area;
            flow.update(&mut memory, speed(time), stroke, now);
            before = now;
        }
        memory
    }

    #[test]
    fn pump_leakage_and_air_are_found_where_the_machine_moves_and_its_pressure_changes() {
        let truth = Balance { flow_gain: 0.945, leakage: 2e-6, slip: 0.0, transition: 27e5 };
        let pressure = |t: f64| 30e5 + 6e5 * (6.0 * t).sin();
        let memory = learned(truth, 20, |t| 20.0 * (0.5 * t).sin(), pressure);
        // and it is known that it was found
        assert!(memory.doubt < 0.3 * balance().uncertainty.transition, "{}", memory.doubt);
        let found = memory.balance;
        assert!((found.flow_gain - truth.flow_gain).abs() < 5e-3, "{found:?}");
        assert!((found.leakage - truth.leakage).abs() < 4e-7, "{found:?}");
        assert!((found.transition - truth.transition).abs() < 2e5, "{found:?}");
    }

    #[test]
    fn nothing_is_learned_of_what_nothing_excites() {
        let truth = Balance { flow_gain: 0.945, leakage: 1.2e-6, slip: 0.0, transition: 27e5 };
        let memory = learned(truth, 20, |_| 0.12, |_| 65e5);
        let doubt = memory.doubt / balance().uncertainty.transition;
        assert!((0.8..1.1).contains(&doubt), "{doubt}");
        let (at_rest, before) = (memory.balance, balance().before);
        assert!((at_rest.flow_gain - before.flow_gain).abs() < 5e-3, "{at_rest:?}");
        assert!((at_rest.transition - before.transition).abs() < 1e3, "{at_rest:?}");
    }

    /// On soft oil a pressure that is read a little wrongly looks like a lot of oil, but speaks for no other oil for that.
    #[test]
    fn noise_at_rest_does_not_tell_how_stiff_the_oil_is() {
        let flow = balance();
        let mut memory = flow.start(0.1, 16e5);
        for k in 1..=60_000 {
            let noise = 0.6 * flow.pressure_scatter * (1e3 * f64::from(k)).sin();
            // as much is pumped as leaks
            flow.update(&mut memory, 0.12, 0.1, 16e5 + noise);
        }
        let doubt = memory.doubt / flow.uncertainty.transition;
        let moved = memory.balance.transition - flow.before.transition;
        assert!(doubt > 0.8 && moved.abs() < 1e5, "{doubt}, {moved} Pa");
        assert!((memory.balance.flow_gain - flow.before.flow_gain).abs() < 5e-3);
    }

    /// Slip takes from what goes up and adds to what comes down: the gain over a cycle is neither of both, and half of what they differ by is slip.
    #[test]
    fn a_pump_is_known_by_the_whole_cycle_and_not_by_its_end() {
        let flow = balance();
        let (mut stroke, pressure) = (0.1, 65e5);
        let mut memory = flow.start(stroke, pressure);
        let [up, down] = [0.90, 0.92];
        for k in 0..30_000 {
            let (speed, gain) = match k / 5_000 {
                0 | 1 => (20.0, up),
                3 | 4 => (-20.0, down),
                _ => (0.0, 0.0),
            };
            let pumped = gain * flow.displacement * speed;
            stroke += (pumped - flow.before.leakage) * flow.period / flow.piston_area;
            flow.update(&mut memory, speed, stroke, pressure);
        }
        let Balance { flow_gain, slip, leakage, .. } = memory.balance;
        // half a minute of a memory of 100 s: what came last counts a little more
        assert!((flow_gain - 0.5 * (up + down)).abs() < 1e-3, "{flow_gain}");
        let lost = slip * (pressure - flow.suction) / flow.displacement;
        assert!((lost - 0.5 * (down - up)).abs() < 1e-3, "{lost}");
        // next to nothing of which is taken for leakage at rest
        let slipped = 0.5 * (down - up) * flow.displacement * 20.0;
        assert!((leakage - flow.before.leakage).abs() < 0.05 * slipped, "{leakage}, {slipped}");
    }

    #[test]
    fn what_nobody_can_believe_is_not_gone_on_with() {
        let flow = balance();
        let believed = flow.start(0.1, 30e5).believed();
        assert!(flow.resume(&believed).is_some());
        let broken = |change: fn(&mut Believed<f64>)| {
            let mut believed = believed;
            change(&mut believed[3]);
            flow.resume(&believed).is_none()
        };
        assert!(broken(|b| b.flow_gain_variance = -1e-4));
        // correlated by more than wholly
        assert!(broken(|b| b.flow_gain_leakage = 1.0));
        assert!(broken(|b| b.likelihood = f64::NAN));
        assert!(broken(|b| b.transition += 1e5));
    }

    #[test]
    fn what_cannot_be_is_not_learned() {
        // a pump that delivers a half more, and oil that leaks in
        let truth = Balance { flow_gain: 1.4, leakage: -1e-5, slip: 0.0, transition: 35e5 };
        let found = learned(truth, 20, |t| 20.0 * (0.5 * t).sin(), |_| 65e5).balance;
        let most = balance().before.flow_gain + BOUND * balance().uncertainty.flow_gain;
        assert!(found.leakage >= 0.0 && found.flow_gain <= most, "{found:?}");
    }

    #[test]
    fn a_reading_that_is_no_number_teaches_nothing() {
        let flow = balance();
        let mut memory = flow.start(0.1, 30e5);
        for _ in 0..300 {
            flow.update(&mut memory, 10.0, f64::NAN, 30e5);
        }
        assert_eq!(memory.balance, flow.before);
        for _ in 0..300 {
            flow.update(&mut memory, 0.0, 0.1, 30e5);
        }
        assert!(memory.balance.to_array().iter().all(|v| v.is_finite()), "{:?}", memory.balance);
    }
}
