//! Model following at work on a machine: state feedback on the simulated crane, feedback from the machine, and what is learned of it.

use crate::boom::Boom;
use crate::carried_load::CarriedLoad;
use crate::controller::AxisState;
use crate::deviation::Watched;
use crate::deviation_memory::DeviationMemory;
use crate::feedback::benchmark::BenchmarkInput;
use crate::learner::{Balances, Conditions, Known, Learner};
use crate::measurement::AxisSignals;
use crate::model_following::{FollowingMemory, ModelFollowing};
use crate::out_of_reach::AT_REST;
use crate::out_of_reach::Led;
use crate::reference::profile::SetPoint;
use crate::schedule::Schedule;
use hydroboom_math::Real;

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
    /// What the machine's motor turns beyond the simulated one for the same motion \[rev/s\], for what the simulated crane has not taken on yet.
    unlike: f64,
    /// Load pressure of the simulated crane \[Pa\], and by how much it gains weight in the period \[Pa\]: in this one, and in the one before; none
    /// where something else than state feedback leads it.
    led: [Option<[f64; 2]>; 2],
    /// Where state feedback leads to in the period; nowhere where something else does.
    leads_to: Option<SetPoint<f64>>,
    /// How fast it will lead at most \[m/s\]: 0 where no path is known ahead.
    path_speed: f64,
    /// What the motor has to turn for each revolution of the simulated one: now, and when it was last told its speed.
    correction: [f64; 2],
}

impl Follower {
    /// At rest, by what is measured there: the payload is weighed.
    pub fn start(
        schedule: &Schedule,
        balances: &Balances,
        reading: &AxisSignals<f64>,
        measured: &BenchmarkInput<f64>,
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
            unlike: 0.0,
            led: [None; 2],
            leads_to: None,
            path_speed: 0.0,
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
    pub fn begin(&mut self, machine: &Watched<f64>, simulated: &AxisState<f64>) {
        let known = self.known().conditions();
        self.law = self.learner.law();
        self.carried = CarriedLoad::weighed(known.payload);
        self.simulated = (known, self.law);
        self.feedback = self.law.begin(machine, simulated);
        self.following = self.law.start();
        self.lead_nowhere();
        self.correction[1] = self.correction[0];
    }

    /// State feedback takes the simulated crane over from whatever turned its motor at `speed` \[rev/s\], without a bump.
    pub fn take_over(&mut self, reference: &SetPoint<f64>, simulated: &AxisState<f64>, speed: f64) {
        self.simulated = (self.known().conditions(), self.learner.law());
        self.following = self.simulated.1.take_over(reference, simulated, speed);
        self.lead_nowhere();
    }

    /// Nothing is known of where state feedback led the simulated crane.
    fn lead_nowhere(&mut self) {
        (self.unlike, self.led, self.leads_to) = (0.0, [None; 2], None);
        self.path_speed = 0.0;
    }

    /// Reference of a path that is known ahead, as it suits the machine: `path` is where it is so many seconds \[s\] from now, `speed` its largest
    /// \[m/s\]. It may be shown in the place of the path itself. What the path takes of the motor, feedback may on soft oil ask for, too.
    pub fn foreseen(&mut self, path: impl Fn(f64) -> SetPoint<f64>, speed: f64) -> SetPoint<f64> {
        self.path_speed = speed;
        self.law.foreseen(path, speed)
    }

    /// A period, at whose beginning the machine's motor was told a speed \[rev/s\]: motor speed \[rev/s\] of the simulated crane, and of the
    /// machine.
    pub fn period(
        &mut self,
        told: f64,
        reference: &SetPoint<f64>,
        simulated: &AxisState<f64>,
        reading: &AxisSignals<f64>,
        measured: &BenchmarkInput<f64>,
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
        reference: &SetPoint<f64>,
        simulated: &AxisState<f64>,
        reading: &AxisSignals<f64>,
        measured: &BenchmarkInput<f64>,
    ) {
        self.begin_period();
        let balanced = self.learner.learn_in_motion(told, reading, measured.load_pressure);
        let rests = reference.velocity.abs() < AT_REST;
        let weighed = self.learner.weighs(rests, measured.load_pressure, simulated);
        let carries_other = self.carries_other(simulated);
        if weighed || balanced || carries_other {
            let before = boom(&self.law, simulated);
            let conditions =
                Conditions { payload: self.carried.believed, ..self.known().conditions() };
            self.law = self.learner.law_under(&conditions);
            // what a load pressure holds does not change by what moves with it
            self.feedback.hangs_on(&boom(&self.law, simulated), &before);
            self.correction[0] = self.learner.correction();
        }
    }

    /// Whether the machine seems to carry another load: what pushes it is what it carries beyond the simulated crane. What that carries is known while
    /// state feedback leads it.
    fn carries_other(&mut self, simulated: &AxisState<f64>) -> bool {
        let [_, before] = self.led;
        if before.is_none() {
            let weighed = CarriedLoad::weighed(self.known().weighed);
            return core::mem::replace(&mut self.carried, weighed).believed != weighed.believed;
        }
        let schedule = self.learner.schedule();
        let per_pressure = schedule.per_pressure(simulated.stroke);
        let boom = boom(&self.law, simulated);
        let beyond = -self.feedback.push / boom.acceleration_by_pressure;
        let seems = self.simulated.0.payload + per_pressure * beyond;
        let weighed = self.learner.known().weighed;
        let (heaviest, period) = (schedule.heaviest(), self.law.period);
        self.carried.update(seems, weighed, per_pressure, heaviest, period)
    }

    /// Learns from a period in which valves hold the load.
    pub fn weigh_held(&mut self, reading: &AxisSignals<f64>, measured: &BenchmarkInput<f64>) {
        self.begin_period();
        self.learner.skip(reading);
        if self.learner.weighs_held(measured.stroke, measured.load_pressure) {
            self.law = self.learner.law();
        }
    }

    /// A period from which nothing can be learned.
    pub fn skip(&mut self, reading: &AxisSignals<f64>) {
        self.begin_period();
        self.learner.skip(reading);
    }

    /// Motor speed \[rev/s\] of the simulated crane for the coming period.
    pub fn lead(&mut self, reference: &SetPoint<f64>, simulated: &AxisState<f64>) -> f64 {
        let known = self.known().conditions();
        let (conditions, law) = &mut self.simulated;
        let (mut gained, mut filling) = (0.0, 0.0);
        if conditions.differ(&known) {
            let before = law.station(simulated.stroke).rest.load_pressure;
            *conditions = conditions.towards(&known, law.period);
            *law = self.learner.law_under(conditions);
            let at = law.station(simulated.stroke);
            let spring = at.spring(law.stiffness_at(simulated.load_pressure));
            gained = at.rest.load_pressure - before;
            // the oil that this takes is the simulated pump's alone: the machine has long had it
            let speed = gained / (law.period * spring.pressure_by_speed);
            filling = Real::clamp(speed, -law.limits.speed, law.limits.speed);
        }
        law.turns = self.correction[0];
        let speed = law.update(&mut self.following, reference, simulated) + filling;
        self.translate(simulated, speed, gained);
        self.leads_to = Some(*reference);
        speed
    }

    /// What the machine's motor takes for the same motion as a simulated crane that is not quite like it: the same acceleration of another mass, on oil
    /// of another stiffness. The simulated motor turns at `speed` \[rev/s\] in the coming period, in which the simulated crane gains so much weight \[Pa\].
    fn translate(&mut self, simulated: &AxisState<f64>, speed: f64, gained: f64) {
        let AxisState { stroke, velocity, load_pressure } = *simulated;
        let (theirs, law) = (&self.simulated.1, &self.law);
        let [at, own] = [theirs, law].map(|law| law.station(stroke));
        let slopes = [at, own].map(|station| station.rest.load_pressure_slope * velocity);
        let heavier = at.stiff.acceleration_by_pressure / own.stiff.acceleration_by_pressure;
        // of a rate of the simulated load pressure, what becomes of it on the machine
        let own_rate =
            |rate: f64, gained: f64| slopes[1] + heavier * (rate - gained / law.period - slopes[0]);

        let spring = at.spring(theirs.stiffness_at(load_pressure));
        let rate = spring.pressure_by_velocity * velocity
            + spring.pressure_by_speed * (speed - at.rest.holding_speed);
        let own_pressure =
            own.rest.load_pressure + heavier * (load_pressure - at.rest.load_pressure);
        let own_spring = own.spring(law.stiffness_at(own_pressure));
        let turning = own_rate(rate, gained) - own_spring.pressure_by_velocity * velocity;
        self.unlike = own.rest.holding_speed + turning / own_spring.pressure_by_speed - speed;

        // by what their pressures have gone apart so nothing pushes the machine
        let [now, before] = &mut self.led;
        *now = Some([load_pressure, gained]);
        if let Some([before, gained]) = *before {
            let rate = (load_pressure - before) / law.period;
            let apart = law.period * (own_rate(rate, gained) - rate);
            self.feedback.load_pressure += apart;
            self.feedback.pumped += apart;
            let boom = law.deviation.boom(&own);
            self.feedback.push -= boom.acceleration_by_pressure * apart;
            self.feedback.stroke -= boom.give * apart;
        }
    }

    /// Another period begins.
    fn begin_period(&mut self) {
        self.led = [None, self.led[0]];
        (self.unlike, self.leads_to) = (0.0, None);
    }

    /// Motor speed \[rev/s\] of the machine for the coming period, the simulated crane's being given \[rev/s\].
    pub fn answer(
        &mut self,
        machine: &Watched<f64>,
        simulated: &AxisState<f64>,
        simulated_speed: f64,
    ) -> f64 {
        let [correction, before] = self.correction;
        let simulated_speed = simulated_speed + self.unlike;
        // what the correction has taken over is no rate that nobody knows of any longer
        let taken = (correction - before) * simulated_speed;
        let with = self.law.reckons(simulated, machine.load_pressure);
        self.feedback.rate += taken * with.spring.pressure_by_speed;
        self.correction[1] = correction;
        let (feedback, feedforward) = (&mut self.feedback, correction * simulated_speed);
        match &self.leads_to {
            Some(reference) => {
                let travels = correction * self.law.travels(reference.position, self.path_speed);
                let led = Led { travels, ..self.following.led(reference, correction) };
                self.law.steer(feedback, machine, simulated, feedforward, &led)
            }
            None => self.law.feedback(feedback, machine, simulated, feedforward, 0.0),
        }
    }
}

/// The boom where the simulated crane is, as feedback reckons with it.
fn boom(law: &ModelFollowing<f64>, simulated: &AxisState<f64>) -> Boom<f64> {
    law.deviation.boom(&law.station(simulated.stroke))
}
