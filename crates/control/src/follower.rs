//! Model following at work on a machine: state feedback on the simulated crane, feedback from the machine, and what is learned of it.

use crate::carried_load::CarriedLoad;
use crate::{
    Balances, Conditions, DeviationMemory, FollowingMemory, Known, Learner, Measured,
    ModelFollowing, Reading, Reference, Schedule, Seen, Watched,
};

/// A reference slower than this rests \[m/s\].
const AT_REST: f64 = 1e-4;

/// The whole controller, but for the simulated crane itself.
#[derive(Clone, Copy, Debug)]
pub struct Follower {
    learner: Learner,
    /// For the machine as it is known, with what it carries.
    law: ModelFollowing<f64>,
    /// What it seems to carry.
    carried: CarriedLoad,
    /// For the simulated crane, which takes on what is known of the machine in some time: what it is by now.
    simulated: (Conditions, ModelFollowing<f64>),
    following: FollowingMemory<f64>,
    feedback: DeviationMemory<f64>,
    /// Speed at which the simulated pump fills oil up for what the simulated crane is just taking on, which the machine has long had \[rev/s\].
    filled: f64,
    /// What the motor has to turn for each revolution of the simulated one: now, and when it was last told its speed.
    correction: [f64; 2],
}

impl Follower {
    /// At rest, by what is measured there: the payload is weighed.
    pub fn start(
        schedule: &Schedule,
        balances: &Balances,
        reading: &Reading<f64>,
        measured: &Measured<f64>,
    ) -> Self {
        let payload = schedule.payload(measured.stroke, measured.load_pressure);
        Self::new(Learner::start(schedule, balances, payload, reading, measured.load_pressure))
    }

    /// With what was learned before.
    pub fn new(learner: Learner) -> Self {
        let (law, conditions) = (learner.law(), learner.known().conditions());
        Self {
            learner,
            law,
            carried: CarriedLoad::weighed(conditions.payload),
            simulated: (conditions, law),
            following: law.start(),
            feedback: DeviationMemory::default(),
            filled: 0.0,
            correction: [learner.correction(); 2],
        }
    }

    /// What the simulated crane should be by now.
    pub fn known(&self) -> Known {
        self.learner.known()
    }

    /// What was learned.
    pub fn learner(&self) -> &Learner {
        &self.learner
    }

    /// Goes on with what was learned otherwise.
    pub fn set_learner(&mut self, learner: Learner) {
        self.learner = learner;
        self.law = learner.law();
        self.carried = CarriedLoad::weighed(learner.known().weighed);
        self.correction[0] = learner.correction();
    }

    /// Begins feedback where machine and simulated crane are now, both at rest, without a bump. The simulated crane is all that is known by now.
    pub fn begin(&mut self, machine: &Watched<f64>, simulated: &Seen<f64>) {
        let known = self.known().conditions();
        self.law = self.learner.law();
        self.carried = CarriedLoad::weighed(known.payload);
        self.simulated = (known, self.law);
        self.feedback = self.law.begin(machine, simulated);
        self.following = self.law.start();
        self.filled = 0.0;
        self.correction[1] = self.correction[0];
    }

    /// State feedback takes the simulated crane over from whatever turned its motor at `speed` \[rev/s\], without a bump.
    pub fn take_over(&mut self, reference: &Reference<f64>, simulated: &Seen<f64>, speed: f64) {
        self.simulated = (self.known().conditions(), self.learner.law());
        self.following = self.simulated.1.take_over(reference, simulated, speed);
        self.filled = 0.0;
    }

    /// A period, at whose beginning the machine's motor was told a speed \[rev/s\]: motor speed \[rev/s\] of the simulated crane, and of the
    /// machine.
    pub fn period(
        &mut self,
        told: f64,
        reference: &Reference<f64>,
        simulated: &Seen<f64>,
        reading: &Reading<f64>,
        measured: &Measured<f64>,
    ) -> [f64; 2] {
        self.learn(told, reference, simulated, reading, measured);
        let simulated_speed = self.lead(reference, simulated);
        let machine = Watched::of(measured, reading.motor_speed);
        [simulated_speed, self.answer(&machine, simulated, simulated_speed)]
    }

    /// Learns from a period, at whose beginning the machine's motor was told a speed \[rev/s\].
    pub fn learn(
        &mut self,
        told: f64,
        reference: &Reference<f64>,
        simulated: &Seen<f64>,
        reading: &Reading<f64>,
        measured: &Measured<f64>,
    ) {
        let balanced = self.learner.learn_in_motion(told, reading, measured.load_pressure);
        let rests = reference.velocity.abs() < AT_REST;
        let weighed = self.learner.weighs(rests, measured.load_pressure, simulated);
        let carries_other = self.carries_other(simulated);
        if weighed || balanced || carries_other {
            let before = lightness(&self.law, simulated);
            let conditions =
                Conditions { payload: self.carried.believed, ..self.known().conditions() };
            self.law = self.learner.law_under(&conditions);
            // what a load pressure holds does not change by what moves with it
            self.feedback.push *= lightness(&self.law, simulated) / before;
            self.correction[0] = self.learner.correction();
        }
    }

    /// Whether the machine seems to carry another load: what pushes it is what it carries beyond the simulated crane.
    fn carries_other(&mut self, simulated: &Seen<f64>) -> bool {
        let schedule = self.learner.schedule();
        let per_pressure = schedule.per_pressure(simulated.stroke);
        let beyond = -self.feedback.push / lightness(&self.law, simulated);
        let seems = self.simulated.0.payload + per_pressure * beyond;
        let weighed = self.learner.known().weighed;
        let (heaviest, period) = (schedule.heaviest(), self.law.period);
        self.carried.update(seems, weighed, per_pressure, heaviest, period)
    }

    /// Learns from a period in which valves hold the load.
    pub fn weigh_held(&mut self, reading: &Reading<f64>, measured: &Measured<f64>) {
        self.learner.skip(reading);
        if self.learner.weighs_held(measured.stroke, measured.load_pressure) {
            self.law = self.learner.law();
        }
    }

    /// A period from which nothing can be learned.
    pub fn skip(&mut self, reading: &Reading<f64>) {
        self.learner.skip(reading);
    }

    /// Motor speed \[rev/s\] of the simulated crane for the coming period.
    pub fn lead(&mut self, reference: &Reference<f64>, simulated: &Seen<f64>) -> f64 {
        let known = self.known().conditions();
        let (conditions, law) = &mut self.simulated;
        if conditions.differ(&known) {
            let before = law.station(simulated.stroke).rest.load_pressure;
            *conditions = conditions.towards(&known, law.period);
            *law = self.learner.law_under(conditions);
            // what the simulated crane takes on is no push of the machine any longer, and the oil that takes is not the machine's to be moved
            let at = law.station(simulated.stroke);
            let gained = at.rest.load_pressure - before;
            self.feedback.load_pressure -= gained;
            self.feedback.push += at.stiff.acceleration_by_pressure * gained;
            let spring = at.spring(law.stiffness_at(simulated.load_pressure));
            let filled = gained / (law.period * spring.pressure_by_speed);
            self.filled = filled.clamp(-law.limits.speed, law.limits.speed);
        } else {
            self.filled = 0.0;
        }
        law.turns = self.correction[0];
        law.update(&mut self.following, reference, simulated) + self.filled
    }

    /// Motor speed \[rev/s\] of the machine for the coming period, the simulated crane's being given \[rev/s\].
    pub fn answer(
        &mut self,
        machine: &Watched<f64>,
        simulated: &Seen<f64>,
        simulated_speed: f64,
    ) -> f64 {
        let [correction, before] = self.correction;
        let simulated_speed = simulated_speed - self.filled;
        // what the correction has taken over is no rate that nobody knows of any longer
        let taken = (correction - before) * simulated_speed;
        let with = self.law.reckons(simulated, machine.load_pressure);
        self.feedback.rate += taken * with.spring.pressure_by_speed;
        self.correction[1] = correction;
        self.law.feedback(&mut self.feedback, machine, simulated, correction * simulated_speed)
    }
}

/// Acceleration by load pressure \[m/(s² Pa)\] where the simulated crane is.
fn lightness(law: &ModelFollowing<f64>, simulated: &Seen<f64>) -> f64 {
    law.station(simulated.stroke).stiff.acceleration_by_pressure
}
