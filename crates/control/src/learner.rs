//! What is learned of a machine while it works: what becomes of the oil, what the load pressure holds, and how late its motor is.

use crate::command_lag::{CommandLag, CommandLagMemory};
use crate::controller::AxisState;
use crate::flow_balance::{Balance, FlowBalance, FlowBalanceMemory};
use crate::load_balance::{HELD_BY_FRICTION, LoadBalance, LoadBalanceMemory};
use crate::measurement::AxisSignals;
use crate::model_following::ModelFollowing;
use crate::schedule::Schedule;
use hydroboom_math::Real;

/// What is known of the machine by now, beyond its description.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Known {
    /// Payload as it was weighed at rest, where friction holds a part of it \[kg\].
    pub weighed: f64,
    /// Payload by what has been seen in motion too \[kg\].
    pub payload: f64,
    /// Coulomb and viscous friction of the cylinder, over what its description has.
    pub friction: [f64; 2],
    /// Pump flow, leakage and where the oil stiffens.
    pub balance: Balance<f64>,
    /// How much later than the motor is told its speed it is read \[s\]. Open loop leads by it; feedback was designed for what the description has.
    pub lag: f64,
}

impl Known {
    /// What of it is simulated beside the machine. The pump's flow is not, but corrected where the machine's motor is told its speed; nor
    /// is what motion tells of payload and friction: a simulated crane that changes its load in motion moves for it, and the machine
    /// after it, where feedback meets a load that is known badly but does not change.
    pub fn conditions(&self) -> Conditions {
        Conditions { payload: self.weighed, transition: self.balance.transition }
    }
}

/// Under what a crane is simulated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conditions {
    /// Payload \[kg\].
    pub payload: f64,
    /// Pressure at which the oil stiffens, p_c1 \[Pa\].
    pub transition: f64,
}

impl Conditions {
    /// Nearer to others, a time later \[s\] in which a simulated crane takes them on, which is not thrown by them so.
    #[must_use]
    pub fn towards(&self, others: &Self, time: f64) -> Self {
        let share = (time / TAKEN_ON).min(1.0);
        Self {
            payload: self.payload + share * (others.payload - self.payload),
            transition: self.transition + share * (others.transition - self.transition),
        }
    }

    /// Whether others are worth a change of the simulated crane: a kilogram, a tenth of a bar.
    pub fn differ(&self, others: &Self) -> bool {
        (self.payload - others.payload).abs() > 1.0
            || (self.transition - others.transition).abs() > 1e4
    }
}

/// Time constant in which a simulated crane takes on what was learned \[s\].
const TAKEN_ON: f64 = 0.25;
/// Time constant in which the payload is learned at rest \[s\], by what the simulated crane lacks: four times that in which it is taken on, so that
/// both together do not swing.
const WEIGHING: f64 = 4.0 * TAKEN_ON;
/// A load is weighed once its pressure has been within so much of its mean over some tenths of a second for half a second:
/// one that was just hung on swings \[Pa\], \[s\], \[s\].
const QUIET: (f64, f64, f64) = (2e5, 0.3, 0.5);

/// What was learned a second ago is kept, in steps of half of it \[s\].
const KEPT: f64 = 0.5;

/// What was learned, to go on with later.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Learned {
    /// Payload as it was weighed at rest \[kg\].
    pub weighed: f64,
    /// Of the load pressure.
    pub load: LoadBalanceMemory,
    /// Of the flow balance.
    pub flow: FlowBalanceMemory,
    /// Of how late the motor is.
    pub lag: CommandLagMemory,
}

impl Learned {
    /// What is known by it.
    pub fn known(&self) -> Known {
        let Self { weighed, load, flow, lag } = self;
        let (payload, friction) = (load.payload(), load.friction());
        Known { weighed: *weighed, payload, friction, balance: flow.balance, lag: lag.lag }
    }
}

/// By what it is learned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Balances {
    /// What the load pressure holds.
    pub load: LoadBalance,
    /// What becomes of the oil.
    pub flow: FlowBalance,
    /// How late the motor is.
    pub lag: CommandLag,
}

/// Learns.
#[derive(Clone, Copy, Debug)]
pub struct Learner {
    schedule: Schedule,
    balances: Balances,
    now: Learned,
    /// What was known half a second to a second ago, and since then; the time since then \[s\].
    before: [Learned; 2],
    since: f64,
    /// Mean of the load pressure, and for how long it has been quiet \[s\].
    mean: f64,
    quiet: f64,
}

impl Learner {
    /// With a payload \[kg\] thought of, and a load pressure \[Pa\] measured.
    pub fn start(
        schedule: &Schedule,
        balances: &Balances,
        payload: f64,
        reading: &AxisSignals<f64>,
        load_pressure: f64,
    ) -> Self {
        let now = Learned {
            weighed: payload,
            load: balances.load.start(schedule, reading.stroke, payload),
            flow: balances.flow.start(reading),
            lag: balances.lag.start(reading),
        };
        Self {
            schedule: *schedule,
            balances: *balances,
            now,
            before: [now; 2],
            since: 0.0,
            mean: load_pressure,
            quiet: 0.0,
        }
    }

    /// Goes on with what was learned before.
    #[must_use]
    pub fn with(self, learned: Learned) -> Self {
        Self { now: learned, before: [learned; 2], ..self }
    }

    /// What was learned.
    pub fn learned(&self) -> &Learned {
        &self.now
    }

    /// What is known by now.
    pub fn known(&self) -> Known {
        self.now.known()
    }

    /// State feedback for what is known.
    pub fn law(&self) -> ModelFollowing<f64> {
        self.law_under(&self.known().conditions())
    }

    /// State feedback for a crane under other conditions.
    pub fn law_under(&self, conditions: &Conditions) -> ModelFollowing<f64> {
        let mut law = self.schedule.at(conditions.payload);
        law.stiffness.transition = conditions.transition;
        law.doubt = self.now.flow.doubt;
        law.deviation = law.deviation.led_late(self.now.lag.likely());
        law.turns = self.correction();
        // what a load that is lost asks of the motor hangs on the one that was there
        law.reserve.beyond = self.schedule.beyond(self.known().weighed);
        law
    }

    /// State feedback over the payload.
    pub(crate) fn schedule(&self) -> &Schedule {
        &self.schedule
    }

    /// What the motor has to turn for each revolution of the simulated one.
    pub fn correction(&self) -> f64 {
        self.balances.flow.before.flow_gain / self.now.flow.balance.flow_gain
    }

    /// A period at whose beginning the motor was told a speed \[rev/s\] and in which the pump moved oil, and the load pressure \[Pa\] at its
    /// end; true where something was learned of the oil.
    pub fn learn_in_motion(
        &mut self,
        told: f64,
        reading: &AxisSignals<f64>,
        load_pressure: f64,
    ) -> bool {
        let Balances { load, flow, lag } = &self.balances;
        self.since += flow.period;
        if self.since >= KEPT {
            self.before = [self.before[1], self.now];
            self.since = 0.0;
        }
        load.update(&self.schedule, &mut self.now.load, reading.stroke, load_pressure);
        lag.update(&mut self.now.lag, told, reading);
        flow.update(&mut self.now.flow, reading)
    }

    /// A period at a load pressure \[Pa\] in which the piston is told to rest, or is not, and what is simulated of it; true where the load
    /// weighs other than was thought.
    pub fn weighs(&mut self, rests: bool, load_pressure: f64, simulated: &AxisState<f64>) -> bool {
        let off = match self.is_quiet(rests, load_pressure) {
            true => self.mean - simulated.load_pressure,
            false => return false,
        };
        if off.abs() <= HELD_BY_FRICTION {
            return false;
        }
        let per_pressure = self.schedule.per_pressure(simulated.stroke);
        let gained = off * per_pressure * self.balances.load.period / WEIGHING;
        self.weigh(simulated.stroke, self.now.weighed + gained);
        true
    }

    /// A period in which valves hold the load, at a position \[m\] and a load pressure \[Pa\]: it is weighed at once. True where it weighs other
    /// than was thought.
    pub fn weighs_held(&mut self, stroke: f64, load_pressure: f64) -> bool {
        let before = self.now.weighed;
        let law = self.schedule.at(before);
        let off = self.mean - law.station(stroke).rest.load_pressure;
        let quiet = self.is_quiet(true, load_pressure);
        if !quiet || off.abs() <= HELD_BY_FRICTION {
            return false;
        }
        self.weigh(stroke, self.schedule.payload(stroke, self.mean));
        // beyond the lightest and the heaviest there is nothing to learn
        (self.now.weighed - before).abs() > 1.0
    }

    fn weigh(&mut self, stroke: f64, payload: f64) {
        self.now.weighed = Real::clamp(payload, 0.0, self.schedule.heaviest());
        let payload = self.now.weighed;
        self.balances.load.weighed(&self.schedule, &mut self.now.load, stroke, payload);
    }

    /// A period that tells nothing of the machine in motion.
    pub fn skip(&mut self, reading: &AxisSignals<f64>) {
        self.now.load.begin_window(reading.stroke);
        self.now.flow.begin_window(reading);
        self.now.lag.begin_window(reading);
    }

    /// Forgets what was learned in the last half second to second: a fault is found later than it begins.
    pub fn forget_the_last(&mut self) {
        self.now = self.before[0];
        self.before = [self.now; 2];
        (self.since, self.quiet) = (0.0, 0.0);
    }

    /// Whether the load pressure \[Pa\] tells what the load weighs.
    fn is_quiet(&mut self, rests: bool, load_pressure: f64) -> bool {
        let (near, slowly, long) = QUIET;
        let period = self.balances.load.period;
        if !load_pressure.is_finite() {
            self.quiet = 0.0;
            return false;
        }
        self.mean += (load_pressure - self.mean) * period / slowly;
        let is_quiet = (load_pressure - self.mean).abs() < near && rests;
        self.quiet = if is_quiet { self.quiet + period } else { 0.0 };
        self.quiet > long
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In steps however small: by one over e after a time constant, and never beyond.
    #[test]
    fn what_is_learned_is_taken_on_within_its_time() {
        let (known, wanted) = (
            Conditions { payload: 300.0, transition: 35e5 },
            Conditions { payload: 100.0, transition: 20e5 },
        );
        for step in [50e-6, 1e-3, 20e-3] {
            let steps = (TAKEN_ON / step).round() as u32;
            let taken = (0..steps).fold(known, |taken, _| taken.towards(&wanted, step));
            let left = [(taken.payload - 100.0) / 200.0, (taken.transition - 20e5) / 15e5];
            for left in left {
                assert!(
                    (left - (-1.0_f64).exp()).abs() < step / TAKEN_ON,
                    "{left} in steps of {step}"
                );
            }
        }
        assert_eq!(known.towards(&wanted, 10.0), wanted);
    }
}
