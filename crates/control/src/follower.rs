//! Model following at work on a machine: state feedback on the simulated crane, feedback from the machine, and what is learned of it.

use crate::flow_balance::{Balance, FlowBalance, FlowBalanceMemory};
use crate::{
    DeviationMemory, FollowingMemory, Measured, ModelFollowing, Reading, Reference, Seen, Watched,
};

/// How many payloads state feedback is designed for.
pub const PAYLOADS: usize = 6;

/// State feedback for any payload.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Schedule {
    /// Payloads \[kg\], rising.
    pub payloads: [f64; PAYLOADS],
    /// State feedback for each.
    pub laws: [ModelFollowing<f64>; PAYLOADS],
}

impl Schedule {
    /// State feedback for a payload \[kg\].
    pub fn at(&self, payload: f64) -> ModelFollowing<f64> {
        let last = PAYLOADS - 2;
        let k = self.payloads.partition_point(|p| *p <= payload).saturating_sub(1).min(last);
        let [below, above] = [self.payloads[k], self.payloads[k + 1]];
        let share = ((payload - below) / (above - below)).clamp(0.0, 1.0);
        self.laws[k].between(&self.laws[k + 1], share)
    }

    /// The payload \[kg\] with which the crane rests at a load pressure \[Pa\], piston at `stroke` \[m\].
    pub fn payload(&self, stroke: f64, load_pressure: f64) -> f64 {
        let share = (load_pressure - self.empty(stroke)) / self.span(stroke);
        share.clamp(0.0, 1.0) * self.payloads[PAYLOADS - 1]
    }

    fn empty(&self, stroke: f64) -> f64 {
        self.laws[0].station(stroke).rest.load_pressure
    }

    fn span(&self, stroke: f64) -> f64 {
        self.laws[PAYLOADS - 1].station(stroke).rest.load_pressure - self.empty(stroke)
    }
}

/// What is known of the machine by now, beyond its description.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Known {
    /// Payload \[kg\].
    pub payload: f64,
    /// Pump flow, leakage and where the oil stiffens.
    pub balance: Balance<f64>,
}

/// A load that rests differs from the simulated one by more than what friction can hold back \[Pa\].
const HELD_BY_FRICTION: f64 = 6e5;
/// Time constant in which the payload is learned at rest \[s\].
const WEIGHING: f64 = 0.5;
/// A load is weighed once its pressure has been within so much of its mean over some tenths of a second for half a second:
/// one that was just hung on swings \[Pa\], \[s\], \[s\].
const QUIET: (f64, f64, f64) = (2e5, 0.3, 0.5);
/// A reference slower than this rests \[m/s\].
const AT_REST: f64 = 1e-4;

/// The whole controller, but for the simulated crane itself.
#[derive(Clone, Copy, Debug)]
pub struct Follower {
    schedule: Schedule,
    law: ModelFollowing<f64>,
    flow: FlowBalance,
    /// Whether anything is learned.
    pub learns: bool,
    following: FollowingMemory<f64>,
    feedback: DeviationMemory<f64>,
    learned: FlowBalanceMemory,
    known: Known,
    /// Mean of the load pressure, and for how long it has been quiet \[s\].
    mean: f64,
    quiet: f64,
    /// What the motor has to turn for each revolution of the simulated one.
    correction: f64,
}

impl Follower {
    /// At rest, by what is measured there: the payload is weighed.
    pub fn start(
        schedule: &Schedule,
        flow: &FlowBalance,
        reading: &Reading<f64>,
        measured: &Measured<f64>,
    ) -> Self {
        let payload = schedule.payload(measured.stroke, measured.load_pressure);
        let law = schedule.at(payload);
        Self {
            schedule: *schedule,
            law,
            flow: *flow,
            learns: true,
            following: law.start(),
            feedback: DeviationMemory::default(),
            learned: flow.start(reading.stroke, reading.pressure_a),
            known: Known { payload, balance: flow.before },
            mean: measured.load_pressure,
            quiet: 0.0,
            correction: 1.0,
        }
    }

    /// What the simulated crane should be by now.
    pub fn known(&self) -> Known {
        self.known
    }

    /// Begins feedback where machine and simulated crane are now, without a bump.
    pub fn begin(
        &mut self,
        reading: &Reading<f64>,
        measured: &Measured<f64>,
        simulated: &Seen<f64>,
    ) {
        self.feedback = self.law.begin(&watched(reading, measured), simulated);
        self.following = self.law.start();
    }

    /// A period: motor speed \[rev/s\] of the simulated crane, and of the machine.
    pub fn period(
        &mut self,
        reference: &Reference<f64>,
        simulated: &Seen<f64>,
        reading: &Reading<f64>,
        measured: &Measured<f64>,
    ) -> [f64; 2] {
        let before = self.correction;
        if self.learns {
            self.learn(reference, simulated, reading, measured);
        }
        let simulated_speed = self.law.update(&mut self.following, reference, simulated);
        // what the correction has taken over is no rate that nobody knows of any longer
        let taken = (self.correction - before) * simulated_speed;
        let by_speed = self.law.reckons(simulated).spring.pressure_by_speed;
        self.feedback.rate += taken * by_speed;
        let machine = watched(reading, measured);
        let feedforward = self.correction * simulated_speed;
        let speed = self.law.feedback(&mut self.feedback, &machine, simulated, feedforward);
        [simulated_speed, speed]
    }

    fn learn(
        &mut self,
        reference: &Reference<f64>,
        simulated: &Seen<f64>,
        reading: &Reading<f64>,
        measured: &Measured<f64>,
    ) {
        let Reading { motor_speed, stroke, pressure_a, .. } = *reading;
        if self.flow.update(&mut self.learned, motor_speed, stroke, pressure_a) {
            let balance = &self.learned.balance;
            self.known.balance = *balance;
            self.law.stiffness.transition = balance.transition;
            self.law.doubt = self.learned.doubt;
            self.correction = self.flow.before.flow_gain / balance.flow_gain;
        }
        let (near, slowly, long) = QUIET;
        let period = self.law.period;
        self.mean += (measured.load_pressure - self.mean) * period / slowly;
        let is_quiet =
            (measured.load_pressure - self.mean).abs() < near && reference.velocity.abs() < AT_REST;
        self.quiet = if is_quiet { self.quiet + period } else { 0.0 };
        let off = self.mean - simulated.load_pressure;
        if self.quiet > long && off.abs() > HELD_BY_FRICTION {
            let heaviest = self.schedule.payloads[PAYLOADS - 1];
            let per_pressure = heaviest / self.schedule.span(simulated.stroke);
            let gained = off * per_pressure * period / WEIGHING;
            self.known.payload = (self.known.payload + gained).clamp(0.0, heaviest);
            let (transition, doubt) = (self.law.stiffness.transition, self.law.doubt);
            self.law = self.schedule.at(self.known.payload);
            (self.law.stiffness.transition, self.law.doubt) = (transition, doubt);
        }
    }
}

fn watched(reading: &Reading<f64>, measured: &Measured<f64>) -> Watched<f64> {
    let Measured { stroke, load_pressure } = *measured;
    Watched { stroke, load_pressure, motor_speed: reading.motor_speed }
}
