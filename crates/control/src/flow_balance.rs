//! What becomes of the oil that the pump delivers: travel of the piston, compression, leakage. Learned while the machine works.
//!
//! ```text
//! A_p Δx = g ΔV_pump − V ΔS(p_A) − l λ(Δp) Δt − c |Δφ| Δp + m_k − m_{k−1}           over windows of a tenth of a second
//! ```
//!
//! g is the pump's flow gain, l the leakage, c the pump's slip over each revolution and pressure. Δp is the pressure across the pump, λ how leakage grows with it
//! by the crane file's orifices, 1 where l is stated. S(p) is the share of its volume by which oil
//! shrinks up to a pressure, which hangs on the pressure p_c1 at which it stiffens. For each of some p_c1 that are thought possible g, l
//! and c are found by Bayes' rule. m_k is the oil for which what is misread of position and pressure at the end of window k is taken (on soft oil, a lot): it is
//! a fourth number of each, for it ends one window and begins the next, so that windows one after the other know as much as one that is as long as all.
//! A window speaks against a p_c1 as far as it is further from its balance than it may be off, by that
//! and by volumes, which are known badly: without excitation nothing is learned. What was learned is
//! forgotten at the rate of its memory, down to what was known before and never below: slip takes from what goes up and adds to what comes
//! down, so that a pump is known by what it does over a cycle.

use crate::belief::{Belief, FARTHEST, Off};
use crate::likelihood::weights;
use crate::measurement::AxisSignals;
use crate::oil_stiffness::OilStiffness;
use crate::out_of_range::OutOfRange;
use hydroboom_math::{Real, record};

/// How many pressures at which the oil may stiffen are weighed.
pub const TRANSITIONS: usize = 11;
/// Flow gain, leakage, slip.
const SOUGHT: usize = 3;
/// Those, and what was misread where a window began.
const NUMBERS: usize = SOUGHT + 1;

/// Squares of so many standard deviations speak against nothing.
const FITS: f64 = 2.0;
/// Pressures that differ by less are the same \[Pa\]: they were written to a file in between.
const SAME: f64 = 1.0;
/// What was misread where no window has ended yet: another number takes its place when the first one does \[m³\].
const UNREAD: f64 = 1.0;
/// What is learned stays within so many standard deviations of what was known before.
const BOUND: f64 = 4.0;
/// Flow gains of pumps, worn and new, displacements being known to some percent.
const FLOW_GAINS: [f64; 2] = [0.5, 1.2];

record! {
    /// What is known of the flow balance.
    pub struct Balance<T> {
        /// Pump delivery per nominal displacement, g
        #[unit = "1"]
        pub flow_gain: T,
        /// Leakage under the pressure across the pump at which it is stated, l
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
    /// What the pump delivers at its motor's highest speed \[m³/s\]: no more than that can leak.
    pub delivery: f64,
    /// Oil volume with the piston at zero \[m³\].
    pub volume: f64,
    /// Pressure across the pump \[Pa\] at which leakage is stated, not zero.
    pub stated_at: f64,
    /// Share of leakage there that is laminar and grows with pressure; the rest grows with its root.
    pub laminar: f64,
    /// The oil, as known before.
    pub stiffness: OilStiffness<f64>,
    /// What is known before.
    pub before: Balance<f64>,
    /// How uncertain that is, as standard deviations.
    pub uncertainty: Balance<f64>,
    /// Standard deviation of what a window of the machine lacks of its balance, as travel of the piston \[m\].
    pub scatter: f64,
    /// Standard deviation of a position that is read \[m\].
    pub position_scatter: f64,
    /// Standard deviation of a pressure that is read \[Pa\]: on soft oil that is a lot of oil.
    pub pressure_scatter: f64,
    /// How far the compression may be off, as a share of it: volumes are not known better.
    pub compression_error: f64,
    /// Periods in a window, more than [`TRANSITIONS`]: a hypothesis is weighed in each.
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
    belief: Belief<NUMBERS>,
    /// Logarithm of how likely it was before, and of what has been seen under it.
    prior: f64,
    likelihood: f64,
}

/// A window that has ended.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Window {
    /// What g, l, c and the misreading at its beginning are to be multiplied by.
    weights: [f64; NUMBERS],
    /// Oil that the piston's travel took \[m³\].
    travelled: f64,
    /// Oil volume \[m³\].
    volume: f64,
    /// Pressures at its beginning and end \[Pa\].
    pressures: [f64; 2],
    /// Whether another one ended where it begins.
    goes_on: bool,
}

/// What was learned, and the window that is under way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlowBalanceMemory {
    hypotheses: [Hypothesis; TRANSITIONS],
    revolutions: f64,
    across: f64,
    stroke: f64,
    pressure: f64,
    count: u32,
    goes_on: bool,
    /// The window before, and how many hypotheses were weighed by it: one in a period, so that no period has to do much more than another.
    ended: Option<Window>,
    weighed: usize,
    /// What is known now.
    pub balance: Balance<f64>,
    /// Standard deviation of the pressure at which the oil stiffens \[Pa\].
    pub doubt: f64,
}

impl FlowBalanceMemory {
    /// What is believed, to go on with later. Some may have learned of one window more than others.
    pub fn believed(&self) -> [Believed<f64>; TRANSITIONS] {
        self.hypotheses.map(|h| {
            let [flow_gain, leakage, slip, _] = h.belief.estimate;
            let [g, l, c, _] = h.belief.covariance;
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

    /// A window begins with a reading, after what tells nothing.
    pub fn begin_window(&mut self, reading: &AxisSignals<f64>) {
        (self.revolutions, self.across, self.count) = (0.0, 0.0, 0);
        (self.stroke, self.pressure) = (reading.stroke, reading.pressure_a);
        self.goes_on = false;
    }
}

impl FlowBalance {
    /// Nothing learned yet.
    pub fn start(&self, reading: &AxisSignals<f64>) -> FlowBalanceMemory {
        let middle = (TRANSITIONS / 2) as f64;
        let hypotheses = core::array::from_fn(|k| {
            // half a standard deviation apart
            let away = 0.5 * (k as f64 - middle);
            let transition = self.before.transition + away * self.uncertainty.transition;
            Hypothesis {
                oil: OilStiffness { transition, ..self.stiffness },
                belief: Belief::new(
                    numbers(&self.before, 0.0),
                    &numbers(&self.uncertainty, UNREAD),
                ),
                prior: -0.5 * away * away,
                likelihood: 0.0,
            }
        });
        let (balance, doubt) = (self.before, self.uncertainty.transition);
        FlowBalanceMemory {
            hypotheses,
            revolutions: 0.0,
            across: 0.0,
            stroke: reading.stroke,
            pressure: reading.pressure_a,
            count: 0,
            goes_on: false,
            ended: None,
            weighed: 0,
            balance,
            doubt,
        }
    }

    /// Goes on with what was believed before.
    ///
    /// # Errors
    ///
    /// The first field that cannot have been learned, after the number of its hypothesis. Another transition is that of
    /// another crane.
    pub fn resume(
        &self,
        believed: &[Believed<f64>; TRANSITIONS],
    ) -> Result<FlowBalanceMemory, (usize, OutOfRange)> {
        let mut memory = self.start(&AxisSignals::default());
        for (k, (h, b)) in memory.hypotheses.iter_mut().zip(believed).enumerate() {
            self.check(h, b).map_err(|wrong| (k, wrong))?;
            let covariance = [
                [b.flow_gain_variance, b.flow_gain_leakage, b.flow_gain_slip, 0.0],
                [b.flow_gain_leakage, b.leakage_variance, b.leakage_slip, 0.0],
                [b.flow_gain_slip, b.leakage_slip, b.slip_variance, 0.0],
                [0.0, 0.0, 0.0, UNREAD.square()],
            ];
            h.belief = Belief { estimate: [b.flow_gain, b.leakage, b.slip, 0.0], covariance };
            h.likelihood = b.likelihood;
        }
        let (found, doubt) = mean(&memory.hypotheses);
        (memory.balance, memory.doubt) = (self.bounded(found), doubt);
        Ok(memory)
    }

    /// Refuses what cannot be believed under a hypothesis.
    fn check(&self, hypothesis: &Hypothesis, b: &Believed<f64>) -> Result<(), OutOfRange> {
        let transition = hypothesis.oil.transition;
        OutOfRange::check(0, b.transition, [transition - SAME, transition + SAME])?;
        let belief = Belief {
            estimate: [b.flow_gain, b.leakage, b.slip],
            covariance: [
                [b.flow_gain_variance, b.flow_gain_leakage, b.flow_gain_slip],
                [b.flow_gain_leakage, b.leakage_variance, b.leakage_slip],
                [b.flow_gain_slip, b.leakage_slip, b.slip_variance],
            ],
        };
        let checked = belief.check(&self.possible(), &sought(&self.uncertainty));
        checked.map_err(|wrong| OutOfRange { field: 1 + wrong.field, ..wrong })?;
        // no window speaks against it by more, and each is forgotten
        let against = 0.5 * FARTHEST.square() / (1.0 - self.memory);
        OutOfRange::check(Believed::NAMES.len() - 1, b.likelihood, [-against, 0.0])
    }

    /// Ranges of g, l and c under each hypothesis: flow gains of pumps, and no more leakage and slip than the pump delivers.
    /// Where a hypothesis is wrong, and by noise, both are estimated below zero, too; what is used of all is not.
    fn possible(&self) -> [[f64; 2]; SOUGHT] {
        let slip = self.displacement / self.stated_at;
        [FLOW_GAINS, [-self.delivery, self.delivery], [-slip, slip]]
    }

    /// A period that ended with a reading. True where something was learned. A window with a reading that is no number is left out.
    pub fn update(&self, memory: &mut FlowBalanceMemory, reading: &AxisSignals<f64>) -> bool {
        let learned = self.weigh_next(memory);
        memory.revolutions += reading.motor_speed * self.period;
        memory.across += reading.pressure_pump_a - reading.pressure_pump_b;
        memory.count += 1;
        if memory.count >= self.window {
            self.end_window(memory, reading);
        }
        learned
    }

    fn end_window(&self, memory: &mut FlowBalanceMemory, reading: &AxisSignals<f64>) {
        let AxisSignals { stroke, pressure_a: pressure, .. } = *reading;
        let turned = memory.revolutions;
        let periods = f64::from(memory.count);
        let across = memory.across / periods;
        let window = Window {
            weights: [
                self.displacement * turned,
                -self.period * periods * self.leaks(across),
                -turned.abs() * across,
                -1.0,
            ],
            travelled: self.piston_area * (stroke - memory.stroke),
            volume: self.volume + self.piston_area * 0.5 * (stroke + memory.stroke),
            pressures: [memory.pressure, pressure],
            goes_on: memory.goes_on,
        };
        let sound =
            (turned + across + stroke + memory.stroke + memory.pressure + pressure).is_finite();
        memory.begin_window(reading);
        memory.goes_on = sound;
        (memory.ended, memory.weighed) = (sound.then_some(window), 0);
    }

    /// Weighs the next hypothesis by the window that has ended; true once that was the last one.
    fn weigh_next(&self, memory: &mut FlowBalanceMemory) -> bool {
        let Some(window) = &memory.ended else { return false };
        self.weigh(&mut memory.hypotheses[memory.weighed], window);
        memory.weighed += 1;
        if memory.weighed < TRANSITIONS {
            return false;
        }
        memory.ended = None;
        let (found, doubt) = mean(&memory.hypotheses);
        (memory.balance, memory.doubt) = (self.bounded(found), doubt);
        true
    }

    /// Leakage under a pressure across the pump \[Pa\], over the one that is stated.
    pub fn leaks(&self, across: f64) -> f64 {
        let share = (across / self.stated_at).max(0.0);
        self.laminar * share + (1.0 - self.laminar) * Real::sqrt(share)
    }

    /// What is believed, no farther from what was known before than is thought possible; oil does not leak in.
    fn bounded(&self, found: Balance<f64>) -> Balance<f64> {
        let (before, by) = (&self.before, &self.uncertainty);
        let far = BOUND * by.flow_gain;
        let flow_gain =
            Real::clamp(found.flow_gain, before.flow_gain - far, before.flow_gain + far);
        let leakage = Real::clamp(found.leakage, 0.0, before.leakage + BOUND * by.leakage);
        let slip = Real::clamp(found.slip, 0.0, before.slip + BOUND * by.slip);
        Balance { flow_gain, leakage, slip, ..found }
    }

    fn weigh(&self, h: &mut Hypothesis, window: &Window) {
        let [then, now] = window.pressures;
        let shrunk = window.volume * (h.oil.compression(now) - h.oil.compression(then));
        // variance of the oil for which a misread position and pressure are taken
        let misread = |pressure: f64| {
            let modulus = h.oil.share(pressure) * h.oil.highest;
            (self.piston_area * self.position_scatter).square()
                + (window.volume * self.pressure_scatter / modulus).square()
        };
        let own =
            (self.piston_area * self.scatter).square() + (self.compression_error * shrunk).square();
        let [begun, ended] = [misread(then), misread(now)];
        if !window.goes_on {
            h.belief.replace(SOUGHT, 0.0, Real::sqrt(begun));
        }
        h.belief.forget(1.0 - self.memory, &sought(&self.uncertainty));
        let seen = window.travelled + shrunk;
        let Off { off, variance } = h.belief.learn_between(&window.weights, seen, own, ended);
        h.belief.keep_within(&self.possible());
        // what fits as well as it may speaks for nothing: where everything rests that is oil of any stiffness
        let against = 0.5 * (off * off / variance - FITS).max(0.0);
        h.likelihood = self.memory * h.likelihood - against;
    }
}

fn numbers(balance: &Balance<f64>, misread: f64) -> [f64; NUMBERS] {
    let [flow_gain, leakage, slip] = sought(balance);
    [flow_gain, leakage, slip, misread]
}

fn sought(balance: &Balance<f64>) -> [f64; SOUGHT] {
    [balance.flow_gain, balance.leakage, balance.slip]
}

/// What all hypotheses together say, each by how likely it is; and the standard deviation of the pressure at which the oil stiffens.
fn mean(hypotheses: &[Hypothesis; TRANSITIONS]) -> (Balance<f64>, f64) {
    let weights = weights(&hypotheses.each_ref().map(|h| h.prior + h.likelihood));
    let mean = |of: &dyn Fn(&Hypothesis) -> f64| {
        hypotheses.iter().zip(&weights.weights).map(|(h, weight)| weight * of(h)).sum::<f64>()
    };
    let transition = mean(&|h| h.oil.transition);
    let [flow_gain, leakage, slip] = core::array::from_fn(|k| mean(&|h| h.belief.estimate[k]));
    let apart = hypotheses[1].oil.transition - hypotheses[0].oil.transition;
    (Balance { flow_gain, leakage, slip, transition }, weights.deviation * apart)
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
            delivery: 50.0 * 10.6e-6,
            volume: 4e-3,
            stiffness: oil(35e5),
            stated_at: 63e5,
            laminar: 0.0,
            before: Balance { flow_gain: 0.91, leakage: 1.2e-6, slip: 0.0, transition: 35e5 },
            uncertainty: Balance {
                flow_gain: 0.03,
                leakage: 1.2e-6,
                slip: 1.5e-14,
                transition: 8e5,
            },
            scatter: 1e-4,
            position_scatter: 2e-5,
            pressure_scatter: 1e4,
            compression_error: 0.15,
            window: 100,
            memory: 0.999,
            period: 1e-3,
        }
    }

    /// Pressure on the pump's other side \[Pa\].
    const SUCTION: f64 = 2e5;

    fn reading(motor_speed: f64, stroke: f64, pressure: f64) -> AxisSignals<f64> {
        AxisSignals {
            motor_speed,
            stroke,
            pressure_a: pressure,
            pressure_pump_a: pressure,
            pressure_pump_b: SUCTION,
            ..AxisSignals::default()
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
        let mut memory = flow.start(&reading(0.0, stroke, before));
        for k in 1..=1000 * seconds {
            let time = 1e-3 * f64::from(k);
            let now = pressure(time);
            let shrunk = oil.compression(now) - oil.compression(before);
            let volume = flow.volume + flow.piston_area * stroke;
            let pumped = truth.flow_gain * flow.displacement * speed(time) * flow.period;
            let lost = truth.leakage * flow.leaks(now - SUCTION) * flow.period;
            stroke += (pumped - lost - volume * shrunk) / flow.piston_area;
            flow.update(&mut memory, &reading(speed(time), stroke, now));
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
        let mut memory = flow.start(&reading(0.0, 0.1, 16e5));
        for k in 1..=60_000 {
            let noise = 0.6 * flow.pressure_scatter * (1e3 * f64::from(k)).sin();
            // as much is pumped as leaks
            flow.update(&mut memory, &reading(0.12, 0.1, 16e5 + noise));
        }
        let doubt = memory.doubt / flow.uncertainty.transition;
        let moved = memory.balance.transition - flow.before.transition;
        assert!(doubt > 0.8 && moved.abs() < 1e5, "{doubt}, {moved} Pa");
        assert!((memory.balance.flow_gain - flow.before.flow_gain).abs() < 5e-3);
    }

    /// A pressure between two hypotheses is found nearer than by the nearest of them, over all that lie between.
    #[test]
    fn oil_that_stiffens_between_two_pressures_is_found_there() {
        let apart = 0.5 * balance().uncertainty.transition;
        let swings = |t: f64| 30e5 + 6e5 * (6.0 * t).sin();
        let mut squares = [0.0; 2];
        for tenths in 1..10 {
            let share = 0.1 * f64::from(tenths);
            let transition = balance().before.transition - (1.0 + share) * apart;
            let truth = Balance { transition, ..balance().before };
            let found = learned(truth, 20, |t| 20.0 * (0.5 * t).sin(), swings);
            let off = (found.balance.transition - transition) / apart;
            let nearest = share.min(1.0 - share);
            squares[0] += off * off;
            squares[1] += nearest * nearest;
        }
        assert!(squares[0] < squares[1], "{squares:?}");
    }

    /// On soft oil a window at rest tells less of what leaks than is misread; half a minute of them does, for they end where the next ones begin.
    #[test]
    fn windows_one_after_the_other_tell_what_leaks_of_soft_oil() {
        let flow = balance();
        let (pressure, leakage) = (16e5, 3.0 * flow.before.leakage);
        let leaks = leakage * flow.leaks(pressure - SUCTION);
        let speed = leaks / (flow.before.flow_gain * flow.displacement);
        let modulus = flow.stiffness.share(pressure) * flow.stiffness.highest;
        let misread = flow.volume * flow.pressure_scatter / modulus;
        assert!(misread > 10.0 * leaks * 0.1, "a window tells enough");
        let mut memory = flow.start(&reading(speed, 0.1, pressure));
        for k in 1..=30_000 {
            let noise = flow.pressure_scatter * (1e3 * f64::from(k)).sin();
            flow.update(&mut memory, &reading(speed, 0.1, pressure + noise));
        }
        // what was thought before, two of its standard deviations off, keeps an eighth of a say
        let found = memory.balance.leakage;
        assert!((found / leakage - 1.0).abs() < 0.2, "{found} for {leakage}");
    }

    /// Leakage through orifices grows with the root of pressure, through gaps with pressure itself; stated it is for one pressure.
    #[test]
    fn what_leaks_is_stated_for_one_pressure_whatever_the_load() {
        for laminar in [0.0, 0.6] {
            let flow = FlowBalance { laminar, ..balance() };
            let lost = |across: f64| {
                2e-6 * ((1.0 - laminar) * (across / 63e5).sqrt() + laminar * across / 63e5)
            };
            for pressure in [22e5, 65e5, 90e5] {
                let (mut stroke, mut memory) = (0.1, flow.start(&reading(0.0, 0.1, pressure)));
                for _ in 0..20_000 {
                    stroke -= lost(pressure - SUCTION) * flow.period / flow.piston_area;
                    flow.update(&mut memory, &reading(0.0, stroke, pressure));
                }
                // a twentieth is left of what was thought before; another law would be off by two fifths
                let found = memory.balance.leakage;
                assert!((found / 2e-6 - 1.0).abs() < 0.1, "{laminar}, {pressure} Pa: {found}");
            }
        }
        assert_eq!(balance().leaks(-1e5), 0.0);
    }

    /// Slip takes from what goes up and adds to what comes down: the gain over a cycle is neither of both, and half of what they differ by is slip.
    #[test]
    fn a_pump_is_known_by_the_whole_cycle_and_not_by_its_end() {
        let flow = balance();
        let (mut stroke, pressure) = (0.1, 65e5);
        let mut memory = flow.start(&reading(0.0, stroke, pressure));
        let [up, down] = [0.90, 0.92];
        for k in 0..30_000 {
            let (speed, gain) = match k / 5_000 {
                0 | 1 => (20.0, up),
                3 | 4 => (-20.0, down),
                _ => (0.0, 0.0),
            };
            let pumped = gain * flow.displacement * speed;
            stroke += (pumped - flow.before.leakage * flow.leaks(pressure - SUCTION)) * flow.period
                / flow.piston_area;
            flow.update(&mut memory, &reading(speed, stroke, pressure));
        }
        let Balance { flow_gain, slip, leakage, .. } = memory.balance;
        // half a minute of a memory of 100 s: what came last counts a little more
        assert!((flow_gain - 0.5 * (up + down)).abs() < 1e-3, "{flow_gain}");
        let lost = slip * (pressure - SUCTION) / flow.displacement;
        assert!((lost - 0.5 * (down - up)).abs() < 1e-3, "{lost}");
        // next to nothing of which is taken for leakage at rest
        let slipped = 0.5 * (down - up) * flow.displacement * 20.0;
        assert!((leakage - flow.before.leakage).abs() < 0.05 * slipped, "{leakage}, {slipped}");
    }

    #[test]
    fn what_cannot_have_been_learned_is_not_gone_on_with() {
        let flow = balance();
        let believed = flow.start(&reading(0.0, 0.1, 30e5)).believed();
        assert_eq!(flow.resume(&believed).map(|memory| memory.believed()), Ok(believed));
        let refused = |change: fn(&mut Believed<f64>)| {
            let mut believed = believed;
            change(&mut believed[3]);
            flow.resume(&believed).err().map(|(k, wrong)| (k, Believed::NAMES[wrong.field]))
        };
        assert_eq!(refused(|b| b.flow_gain_variance = -1e-4), Some((3, "flow_gain_variance")));
        // correlated by more than wholly
        assert_eq!(refused(|b| b.flow_gain_leakage = 1.0), Some((3, "flow_gain_leakage")));
        assert_eq!(refused(|b| b.leakage_slip = -1e-6), Some((3, "leakage_slip")));
        assert_eq!(refused(|b| b.flow_gain = 1.3), Some((3, "flow_gain")));
        assert_eq!(refused(|b| b.leakage = 1e-3), Some((3, "leakage")));
        assert_eq!(refused(|b| b.slip = 1e-11), Some((3, "slip")));
        assert_eq!(refused(|b| b.likelihood = f64::NAN), Some((3, "likelihood")));
        assert_eq!(refused(|b| b.likelihood = 1.0), Some((3, "likelihood")));
        assert_eq!(refused(|b| b.transition += 1e5), Some((3, "transition")));
    }

    #[test]
    fn what_cannot_be_is_not_learned() {
        // a pump that delivers a half more, and oil that leaks in
        let truth = Balance { flow_gain: 1.4, leakage: -1e-5, slip: 0.0, transition: 35e5 };
        let found = learned(truth, 20, |t| 20.0 * (0.5 * t).sin(), |_| 65e5).balance;
        let most = balance().before.flow_gain + BOUND * balance().uncertainty.flow_gain;
        assert!(found.leakage >= 0.0 && found.flow_gain <= most, "{found:?}");
    }

    /// However wrong a machine is: what is learned of it can be read back.
    #[test]
    fn whatever_is_learned_can_be_gone_on_with() {
        for (flow_gain, leakage) in [(3.0, 1e-4), (0.1, -1e-4), (-1.0, 2e-3)] {
            let truth = Balance { flow_gain, leakage, slip: 1e-12, transition: 20e5 };
            let swings = |t: f64| 30e5 + 20e5 * (6.0 * t).sin();
            let memory = learned(truth, 20, |t| 20.0 * (0.5 * t).sin(), swings);
            let back = balance().resume(&memory.believed());
            assert_eq!(back.map(|back| back.balance), Ok(memory.balance));
        }
    }

    #[test]
    fn a_reading_that_is_no_number_teaches_nothing() {
        let flow = balance();
        let mut memory = flow.start(&reading(0.0, 0.1, 30e5));
        for _ in 0..300 {
            flow.update(&mut memory, &reading(10.0, f64::NAN, 30e5));
        }
        assert_eq!(memory.balance, flow.before);
        for _ in 0..300 {
            flow.update(&mut memory, &reading(0.0, 0.1, 30e5));
        }
        assert!(memory.balance.to_array().iter().all(|v| v.is_finite()), "{:?}", memory.balance);
    }
}
