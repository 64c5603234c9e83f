//! The control task: one control period from reading to command.

use crate::conditions::Conditions;
use crate::course::Course;
use crate::machine::{Incoming, Link};
use crate::simulation_task::Simulated;
use hydroboom_control::controller::Controller;
use hydroboom_control::estimation::reduced_model::MachineState;
use hydroboom_control::estimation::retained_parameters::RetainedParameters;
use hydroboom_control::estimation::tip::{TipEstimate, TipEstimator, TipMemory};
use hydroboom_control::feedback::benchmark::{Benchmark, BenchmarkInput};
use hydroboom_control::feedback::published_strategy::PublishedStrategy;
use hydroboom_control::feedback::scheduled_lqr_controller::ScheduledLqrController;
use hydroboom_control::measurement::{AxisSignals, Measurement};
use hydroboom_control::reference::preview::{PERIODS_AHEAD, Preview};
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::limits::{Limits, MachineStatus, Observation, ValveState};
use hydroboom_control::supervision::plausibility::ranges;
use hydroboom_control::supervision::supervisor::{Decision, Request, Supervisor};
use hydroboom_description::Description;
use hydroboom_design::scheduled_lqr::{known_delay, scheduled_lqr_controller};
use hydroboom_design::tip::tip_estimator;
use std::cell::Cell;

/// The simulation may be so far from the machine before the benchmark takes over, as a share of the
/// largest tracking error: in closed loop, in open loop.
const DRIFT: f64 = 2.0 / 3.0;
const OPEN_LOOP_DRIFT: f64 = 0.5;
/// Time constant in which the limit comes down after feedback has taken over from open loop \[s\].
const RECOVERY: f64 = 2.0;
/// Steps that the simulation may be behind: more than it makes up for after a delay that the control
/// task bears.
const BEHIND: f64 = 500.0;
/// Travel over which the difference between the released piston and the course's beginning fades \[m\].
const FADING: f64 = 0.01;
/// A bump that a switch to open loop or to the scheduled LQR would make dies out with this time constant \[s\].
const BUMP: f64 = 0.3;
/// A reading that is older than so many periods is stale.
const FRESH: f64 = 5.5;
/// Time constant of the mean over the payload's estimates while the load is held \[s\]: the boom swings on its locked cylinder.
const PAYLOAD_MEAN: f64 = 1.0;
/// A simulation that was set to the machine's state is followed again after it was true for so
/// long \[s\].
const TRUSTED: f64 = 0.5;

/// What a control period needs to know.
#[derive(Clone, Copy, Debug)]
pub struct Period {
    /// Time since the last executed period, by the machine's clock \[s\].
    pub elapsed: f64,
    /// Newest reading, if any has come.
    pub incoming: Option<Incoming>,
    /// What the simulation shows; none while there is none.
    pub simulated: Option<Simulated>,
    /// What a person asks for.
    pub request: Request,
    /// The strategy that is asked for.
    pub strategy: Strategy,
    /// Periods missed since the last executed one.
    pub missed: u32,
    /// Whether somebody attends the machine.
    pub attended: bool,
    /// Whether the clock went back, or far ahead.
    pub clock_jumped: bool,
    /// How the tasks were on time, for the record.
    pub deadlines: Option<Deadlines>,
}

/// One control period, for the log.
#[derive(Clone, Copy, Debug)]
pub struct Record {
    /// Time since the executive began \[s\].
    pub time: f64,
    /// Time since the course began \[s\], negative on the way to its beginning; none while the load is
    /// not the controller's.
    pub course_time: Option<f64>,
    /// Largest speed of the course \[m/s\].
    pub course_speed: f64,
    /// Where the piston should be.
    pub reference: SetPoint<f64>,
    /// What of it is the released piston's distance from the course's beginning, faded out \[m\].
    pub start_offset: f64,
    /// What was measured.
    pub measurement: Measurement,
    /// State that the machine reports of itself, where it reports one.
    pub status: Option<MachineStatus>,
    /// What its attachment tells of itself, where it counts.
    pub link: Option<Link>,
    /// What the simulation showed.
    pub simulated: Option<Simulated>,
    /// What was decided and sent.
    pub decision: Decision,
    /// The strategy at work.
    pub strategy: Strategy,
    /// Why the benchmark had to take over; none where the strategy that was asked for is at work.
    pub fallback: Option<Fallback>,
    /// What the state estimator tells; none before the first measurement, and for a crane that has no such design.
    pub estimates: Option<Estimates>,
    /// Conditions of the crane simulated beside the machine.
    pub conditions: Conditions,
    /// How the tasks were on time; none in simulated time.
    pub deadlines: Option<Deadlines>,
}

/// Why the benchmark takes over from another strategy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fallback {
    /// The simulation drifted away from the machine, is late, or failed.
    Simulation,
    /// The state estimator diverged, or yields no finite number.
    Estimator,
    /// The strategy's command is no finite number.
    Command,
    /// The crane has no such design.
    NoDesign,
}

impl Fallback {
    /// Name in logs and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Simulation => "simulation-drifted",
            Self::Estimator => "estimator-diverged",
            Self::Command => "command-not-finite",
            Self::NoDesign => "no-design",
        }
    }
}

/// Estimates of the machine and how well they are known, at the time of the measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimates {
    /// Estimates.
    pub state: MachineState<f64>,
    /// Their standard deviations.
    pub deviation: MachineState<f64>,
    /// Parameters that a later run may begin with.
    pub parameters: RetainedParameters<f64>,
    /// Innovations of position \[m\] and load pressure \[Pa\].
    pub innovation: [f64; 2],
    /// Their standard deviations by the filter; not a number where an innovation is nought, as while the load is held.
    pub innovation_deviation: [f64; 2],
    /// Mean of the normalised innovations squared \[1\].
    pub mean_nis: f64,
    /// Identified lag of the drive \[s\].
    pub drive_lag: f64,
    /// Position of the tip; none for a crane whose tip is not estimated.
    pub tip: Option<TipEstimate<f64>>,
}

/// How the tasks were on time, seen from the control task.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deadlines {
    /// How late control was released \[ns\].
    pub control_late: u64,
    /// How long its last period took \[ns\].
    pub control_execution: u64,
    /// Releases of control that were missed since the beginning.
    pub control_missed: u64,
    /// The latest of about a period's releases of the simulation \[ns\].
    pub simulation_late: u64,
    /// The longest of about a period's steps of the simulation \[ns\].
    pub simulation_execution: u64,
    /// Releases of the simulation that were missed since the beginning.
    pub simulation_missed: u64,
}

impl Record {
    /// Signals of the axis.
    pub fn signals(&self) -> &AxisSignals<f64> {
        &self.measurement.axes[0].signals
    }

    /// Tracking error x − x_ref \[m\] while the course runs, the way to its beginning left out.
    pub fn error(&self) -> Option<f64> {
        self.course_time
            .filter(|time| *time >= 0.0)
            .map(|_| self.signals().stroke - self.reference.position)
    }
}

/// The control task, called once a period; it allocates nothing.
#[derive(Clone)]
pub struct ControlTask {
    benchmark: Benchmark<f64>,
    /// Rod-side area over piston area.
    area_ratio: f64,
    course: Course,
    /// The course around now, without [`start_offset`](Self::start_offset).
    preview: Preview<f64>,
    /// Time of the course at the preview's last set point \[s\].
    preview_end: f64,
    supervisor: Supervisor,
    /// Largest tracking error that is allowed now, with feedback, and without \[m\].
    tracking: f64,
    closed_loop_tracking: f64,
    open_loop_tracking: f64,
    /// Steps of the simulation that are due in a period.
    steps_due: f64,
    /// Steps it had taken when it was looked at last.
    steps: u64,
    /// Steps that it is behind.
    behind: f64,
    /// How often it had been set to a state when it was looked at last.
    epoch: u64,
    /// For how long it has been true since then \[s\].
    trusted: f64,
    /// How often it had been set to a state when it was followed last.
    fallen_at: u64,
    time: f64,
    course_time: f64,
    decision: Decision,
    strategy: Strategy,
    fallback: Option<Fallback>,
    published: PublishedStrategy,
    /// Estimator and scheduled LQR; none for a crane that has no such design.
    scheduled_lqr: Option<ScheduledLqrController>,
    /// Estimator of the tip, and what it carries; none where the tip is not estimated.
    tip: Option<TipEstimator<f64>>,
    tip_memory: TipMemory<f64>,
    /// Conditions of the simulated crane.
    conditions: Conditions,
    /// Speed of the simulated crane's motor \[rev/s\].
    simulated_motor: f64,
    /// What is left of the difference between the released piston and the course's beginning \[m\].
    start_offset: f64,
    /// What is still left of a bump \[rev/s\].
    offset: f64,
    wanted: f64,
    measurement: Measurement,
    valve: Option<ValveState>,
    status: Option<MachineStatus>,
    link: Option<Link>,
    age: f64,
}

impl ControlTask {
    /// A control task that knows the model, for a course and within limits.
    pub fn new(model: &Description, course: Course, limits: Limits, strategy: Strategy) -> Self {
        let n = &model.numbers;
        let benchmark = model.benchmark();
        let area_ratio = model.cylinder().area_ratio();
        Self {
            published: PublishedStrategy::new(strategy, benchmark, area_ratio),
            scheduled_lqr: scheduled_lqr_controller(model)
                .ok()
                .map(|controller| controller.with_delay(known_delay(model))),
            tip: tip_estimator(model),
            tip_memory: TipMemory::default(),
            conditions: Conditions::described(n),
            benchmark,
            area_ratio,
            preview: Preview::at_rest(benchmark.period, 0.0),
            preview_end: 0.0,
            course,
            tracking: n.supervision_tracking_open_loop,
            closed_loop_tracking: n.supervision_tracking,
            open_loop_tracking: n.supervision_tracking_open_loop,
            steps_due: (n.control_period / n.simulation_period).round(),
            steps: 0,
            behind: 0.0,
            epoch: 0,
            trusted: 0.0,
            fallen_at: 0,
            supervisor: Supervisor::new(limits),
            time: 0.0,
            course_time: 0.0,
            decision: Decision::IDLE,
            strategy,
            fallback: None,
            simulated_motor: 0.0,
            start_offset: 0.0,
            offset: 0.0,
            wanted: 0.0,
            measurement: Measurement::default(),
            valve: None,
            status: None,
            link: None,
            age: f64::INFINITY,
        }
    }

    /// Signals of the axis, as measured last.
    fn signals(&self) -> &AxisSignals<f64> {
        &self.measurement.axes[0].signals
    }

    /// Conditions under which the crane beside the machine is to be simulated. Under the scheduled LQR payload and transition pressure are those
    /// estimated while the load was held last; as described before that.
    pub fn conditions(&self) -> Conditions {
        self.conditions
    }

    /// Takes another course, if the load is not the controller's just now.
    pub fn take(&mut self, course: Course) {
        if !self.decision.controls {
            self.supervisor.set_speed(course.speed());
            self.course = course;
        }
    }

    /// Supervised within other limits; before anything has been asked for.
    #[must_use]
    pub fn within(mut self, limits: Limits) -> Self {
        self.supervisor = Supervisor::new(limits);
        self
    }

    /// Time without a command after which the drive stops by itself \[s\].
    pub fn watchdog(&self) -> f64 {
        self.supervisor.limits().watchdog
    }

    /// Speed of the simulated crane's motor \[rev/s\] until the next period; none while it rests.
    pub fn simulated_motor(&self) -> Option<f64> {
        self.decision.controls.then_some(self.simulated_motor)
    }

    /// One control period.
    pub fn period(&mut self, now: &Period) -> Record {
        let period = self.benchmark.period;
        let before = self.measurement.number;
        let newest = now.incoming.filter(|incoming| incoming.measurement.number != before);
        // a machine that was restarted counts anew
        let new_readings = newest.map_or(0, |i| match i.measurement.number.checked_sub(before) {
            Some(more) => u32::try_from(more).unwrap_or(1),
            None => 1,
        });
        self.age += now.elapsed;
        if let Some(incoming) = newest {
            self.measurement = incoming.measurement;
            (self.valve, self.status) = (incoming.valve, incoming.status);
            self.age = 0.0;
        }
        let lost_before = self.link.map_or(0, |link| link.lost);
        // an attachment also tells what it did while no measurement came
        self.link = now.incoming.and_then(|incoming| incoming.link);
        let lost = self.link.map_or(0, |link| link.lost.saturating_sub(lost_before));
        let measured = BenchmarkInput::of(self.signals(), self.area_ratio);
        let controls = self.decision.controls;
        if !controls {
            self.course_time = -self.course.approach();
        }
        let reference = match controls {
            true => {
                let mut reference = self.preview.now();
                // the course begins where the released piston is, and what that is off fades as it moves
                let faded = reference.velocity.abs() * period / FADING;
                self.start_offset *= 1.0 - faded.min(1.0);
                reference.position += self.start_offset;
                reference
            }
            false => self.course.reference(self.course_time),
        };
        self.estimate();
        self.adopt_estimates(now);
        if controls {
            self.control(&reference, &measured, now);
        } else {
            self.wanted = 0.0;
            self.strategy = now.strategy;
            self.fallback = None;
        }
        let observation = Observation {
            elapsed: now.elapsed,
            reading: *self.signals(),
            valve: self.valve,
            machine: self.status,
            age: self.age,
            new_readings,
            lost_readings: u32::try_from(lost).unwrap_or(u32::MAX),
            commands_lost: self.link.is_some_and(|link| link.commands_lost),
            reference: reference.position,
            tracking: self.tracking,
            wanted: self.wanted,
            course_over: self.course_time >= self.course.duration(),
            missed: now.missed,
            attended: now.attended,
            clock_jumped: now.clock_jumped,
        };
        let before = self.decision;
        self.decision = self.supervisor.advance(&observation, now.request);
        let record = Record {
            time: self.time,
            course_time: controls.then_some(self.course_time),
            course_speed: self.course.speed(),
            reference,
            start_offset: if controls { self.start_offset } else { 0.0 },
            measurement: self.judged(),
            status: self.status,
            link: self.link,
            simulated: now.simulated,
            decision: self.decision,
            strategy: self.strategy,
            fallback: self.fallback,
            estimates: self.estimates(),
            conditions: self.conditions,
            deadlines: now.deadlines,
        };
        self.time += now.elapsed;
        match (before.controls, self.decision.controls) {
            (false, true) => self.begin(now),
            (true, true) => {
                self.course_time += period;
                self.advance_preview();
            }
            (_, false) => {}
        }
        record
    }

    /// The state estimator runs under every strategy, so that a hand-over finds it settled.
    fn estimate(&mut self) {
        let measurement = self.judged();
        // before the first measurement there is nothing to begin with
        let Some(controller) = self.scheduled_lqr.as_mut().filter(|_| measurement.number > 0)
        else {
            return;
        };
        // delays are those of the attachment, where it measures them; they stay while the load moves
        let is_held = self.decision.is_at_rest();
        if let Some(delay) = self.link.and_then(|link| link.delay).filter(|_| is_held) {
            let [measurement, command] = delay.cycles();
            controller.set_delays(measurement, command);
        }
        match self.decision.controls {
            true => controller.observe(&measurement, self.decision.command.motor_speed),
            false => controller.observe_held(&measurement),
        }
        if let (Some(tip), Some(estimated)) = (&self.tip, controller.estimated()) {
            let filter = &controller.estimator().filter;
            tip.update(&mut self.tip_memory, filter, &estimated.filter);
        }
    }

    /// The same with an estimator that begins with the parameters of an earlier run.
    #[must_use]
    pub fn with_retained_parameters(mut self, retained: RetainedParameters<f64>) -> Self {
        self.scheduled_lqr =
            self.scheduled_lqr.map(|controller| controller.with_retained_parameters(retained));
        self
    }

    fn estimates(&self) -> Option<Estimates> {
        let controller = self.scheduled_lqr.as_ref()?;
        let estimated = controller.estimated()?;
        let filter = &estimated.filter;
        Some(Estimates {
            state: filter.estimate,
            deviation: controller.estimator().filter.deviation(filter),
            innovation: filter.innovation,
            innovation_deviation: core::array::from_fn(|k| {
                filter.innovation[k].abs() / filter.nis[k].sqrt()
            }),
            mean_nis: filter.mean_nis,
            drive_lag: estimated.drive.time_constant(self.benchmark.period),
            parameters: RetainedParameters::of(estimated),
            tip: self.tip.map(|tip| {
                tip.estimate(&self.tip_memory, &controller.estimator().filter.model, filter)
            }),
        })
    }

    /// The newest measurement, and what of it may be used.
    fn judged(&self) -> Measurement {
        let is_stale = self.age > FRESH * self.benchmark.period;
        let ranges = ranges(self.supervisor.limits());
        let axes = self.measurement.axes.map(|axis| match is_stale {
            true => axis.within(&ranges).stale(),
            false => axis.within(&ranges),
        });
        Measurement { axes, ..self.measurement }
    }

    /// The preview where the course begins. Times ahead are summed up period by period as the course's time is, so that a set
    /// point is the same when it is ahead and when it is now.
    fn begin_preview(&mut self) {
        let (course, period, begin) =
            (&self.course, self.benchmark.period, -self.course.approach());
        let clock = Cell::new((0.0, begin));
        let time = |after: f64| {
            let periods = after / period;
            if periods < 0.5 {
                return begin + after;
            }
            let (mut counted, mut time) = match clock.get() {
                (counted, time) if counted < periods => (counted, time),
                _ => (0.0, begin),
            };
            while counted + 0.5 < periods {
                (counted, time) = (counted + 1.0, time + period);
            }
            clock.set((counted, time));
            time
        };
        self.preview = Preview::new(period, |after| course.reference(time(after)));
        self.preview_end = time(PERIODS_AHEAD as f64 * period);
    }

    /// The preview a period later.
    fn advance_preview(&mut self) {
        let (course, now, period) = (&self.course, self.course_time, self.benchmark.period);
        self.preview_end += period;
        let (end, ahead) = (self.preview_end, PERIODS_AHEAD as f64 * period);
        self.preview.advance(|after| match (after - ahead).abs() < 0.5 * period {
            true => course.reference(end),
            false => course.reference(now + after),
        });
    }

    /// The simulated crane takes payload and transition pressure from the estimator while the load is held. A change in motion would move it, and a
    /// machine that is led by it.
    fn adopt_estimates(&mut self, now: &Period) {
        let is_held = !self.decision.controls && self.decision.command.holding_valve < 0.5;
        let is_fresh = self.age < FRESH * self.benchmark.period;
        let controller = self.scheduled_lqr.as_ref().filter(|controller| controller.is_valid());
        let Some(estimated) = controller.and_then(ScheduledLqrController::estimated) else {
            return;
        };
        if is_held && is_fresh && now.strategy.estimates() {
            let MachineState { payload, transition_pressure, .. } = estimated.filter.estimate;
            let share = self.benchmark.period / PAYLOAD_MEAN;
            let payload = self.conditions.payload + share * (payload - self.conditions.payload);
            self.conditions = Conditions { payload, transition_pressure };
        }
    }

    /// The strategy asked for; on the way to its beginning a course is measured, whatever comes then.
    fn asked(&self, now: &Period) -> Strategy {
        match self.course_time < 0.0 && !now.strategy.estimates() {
            true => Strategy::BenchmarkClosedLoop,
            false => now.strategy,
        }
    }

    /// The load is the controller's from the next period on.
    fn begin(&mut self, now: &Period) {
        self.offset = 0.0;
        let beginning = self.course.reference(-self.course.approach()).position;
        self.start_offset = self.signals().stroke - beginning;
        // the scheduled LQR takes over from the benchmark in the first period
        self.strategy = match self.asked(now) {
            asked if asked.estimates() => Strategy::BenchmarkClosedLoop,
            asked => asked,
        };
        self.tracking = match self.strategy.measures() {
            true => self.closed_loop_tracking,
            false => self.open_loop_tracking,
        };
        self.simulated_motor = 0.0;
        self.behind = 0.0;
        self.steps = now.simulated.map_or(0, |s| s.steps);
        self.published.start_simulated(now.simulated.as_ref().map(Simulated::axis));
        if let Some(simulated) = now.simulated {
            self.epoch = simulated.epoch;
        }
        // what keeps the pump pre-loaded now is what the leakage takes
        let mut reference = self.course.reference(-self.course.approach());
        reference.position += self.start_offset;
        let speed = self.decision.command.motor_speed;
        self.wanted = speed;
        self.published.start_at(self.strategy, &self.measurement, &reference, speed);
        self.begin_preview();
    }

    /// Motor speed of the scheduled LQR \[rev/s\]; none under another strategy.
    fn estimated_command(&mut self, strategy: Strategy, reference: &SetPoint<f64>) -> Option<f64> {
        let takes_over = strategy != self.strategy;
        let controller = self.scheduled_lqr.as_mut().filter(|_| strategy.estimates())?;
        let mut preview = self.preview;
        preview.shift(self.start_offset);
        if takes_over {
            controller.take_over(reference.position);
        }
        let [command] = controller.update(&self.measurement, &preview, None).axes;
        Some(command.motor_speed)
    }

    /// The speed the strategy wants.
    fn control(&mut self, reference: &SetPoint<f64>, measured: &BenchmarkInput<f64>, now: &Period) {
        let b = self.benchmark;
        if let Some(simulated) = now.simulated.filter(|s| s.epoch != self.epoch) {
            // it was set to where the machine is, at rest
            self.epoch = simulated.epoch;
            self.steps = simulated.steps;
            self.published.start_simulated(Some(simulated.axis()));
            (self.simulated_motor, self.behind, self.trusted) = (0.0, 0.0, 0.0);
        }
        let asked = self.asked(now);
        // a strategy that needs a simulation that is not there, or not true, is not followed
        let most = match asked.measures() {
            true => DRIFT * self.closed_loop_tracking,
            false => OPEN_LOOP_DRIFT * self.open_loop_tracking,
        };
        if let Some(simulated) = now.simulated {
            let taken = simulated.steps.saturating_sub(self.steps) as f64;
            self.behind = (self.behind + self.steps_due - taken).max(0.0);
            self.steps = simulated.steps;
        }
        let alive = self.behind < BEHIND;
        let near = |s: Simulated| (s.axis().stroke - measured.stroke).abs() <= most;
        let is_true = alive && now.simulated.is_some_and(|s| !s.failed && near(s));
        let estimator = asked.estimates().then_some(self.scheduled_lqr.as_ref());
        let estimator = estimator.map(|c| c.map(ScheduledLqrController::is_valid));
        // an estimator that has diverged begins anew with the next release, and so does a law without a command
        self.fallback = match (self.fallback, estimator) {
            (Some(Fallback::Estimator), _) | (_, Some(Some(false))) => Some(Fallback::Estimator),
            (Some(Fallback::Command), _) => Some(Fallback::Command),
            (_, Some(None)) => Some(Fallback::NoDesign),
            _ if asked.simulates() && !is_true => Some(Fallback::Simulation),
            (Some(Fallback::NoDesign), _) => None,
            (before, _) => before,
        };
        let drifted = self.fallback == Some(Fallback::Simulation);
        self.trusted = if is_true && drifted { self.trusted + b.period } else { 0.0 };
        // it is followed again only after it was set to the machine's state
        if drifted && self.trusted >= TRUSTED && self.epoch != self.fallen_at {
            self.fallback = None;
        }
        if self.fallback != Some(Fallback::Simulation) {
            self.fallen_at = self.epoch;
        }
        let mut strategy = match self.fallback.is_some() {
            true => Strategy::BenchmarkClosedLoop,
            false => asked,
        };
        let estimated = self.estimated_command(strategy, reference);
        if estimated.is_some_and(|speed| !speed.is_finite()) {
            self.fallback = Some(Fallback::Command);
            strategy = Strategy::BenchmarkClosedLoop;
        }
        let estimated = estimated.filter(|speed| speed.is_finite());
        if let (None, Some(controller)) = (estimated, &mut self.scheduled_lqr) {
            controller.hand_over();
        }
        let changes = strategy != self.strategy;
        if changes && self.strategy.estimates() && strategy.measures() {
            // it has not looked at the machine since
            self.published.forget_measurements(&self.measurement);
        }
        if changes && !strategy.estimates() {
            self.published.change_to(strategy, self.wanted);
        }
        // the simulated crane is led under every strategy, so that any can be changed to
        let simulated = now.simulated.filter(|s| !s.failed).map(|s| s.state);
        let mut preview = self.preview;
        preview.shift(self.start_offset);
        let measurement = self.judged();
        let published = self.published.update(&measurement, &preview, simulated.as_ref());
        if let (Some(_), Some([speed])) =
            (simulated, self.published.status().simulated_motor_speeds)
        {
            self.simulated_motor = speed;
        }
        let asked = estimated.unwrap_or(published.axes[0].motor_speed);
        if changes {
            self.offset = self.wanted - asked;
            self.strategy = strategy;
        }
        self.wanted = asked + self.offset;
        self.offset *= 1.0 - b.period / BUMP;
        // feedback that takes over from open loop has its time to make good what it finds
        self.tracking = match strategy.measures() {
            true => {
                self.tracking + (self.closed_loop_tracking - self.tracking) * b.period / RECOVERY
            }
            false => self.open_loop_tracking,
        };
    }
}

#[cfg(test)]
mod tests;
