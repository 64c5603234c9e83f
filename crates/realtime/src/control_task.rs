//! Control task: one control period from measurement to command.

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

/// Largest position difference between simulation and machine, as a share of the tracking limit. Beyond it
/// the benchmark controller takes over. First under feedback, then in open loop.
const DRIFT: f64 = 2.0 / 3.0;
const OPEN_LOOP_DRIFT: f64 = 0.5;
/// Time constant with which the tracking limit decreases after a switch from open loop to feedback \[s\].
const RECOVERY: f64 = 2.0;
/// Largest delay of the simulation \[steps\]. It is more than the simulation has to catch up after the
/// longest delay that the control task tolerates.
const BEHIND: f64 = 500.0;
/// Piston travel over which the start offset fades out \[m\]. The offset is the released piston's distance
/// from the start of the course.
const FADING: f64 = 0.01;
/// Decay time constant of the offset that keeps the command continuous at a change of strategy \[s\].
const BUMP: f64 = 0.3;
/// Age in control periods beyond which a measurement is stale.
const FRESH: f64 = 5.5;
/// Time constant of the payload's mean while the load is held \[s\]. It smooths the boom's oscillation on
/// its locked cylinder.
const PAYLOAD_MEAN: f64 = 1.0;
/// Time for which a synchronised simulation must agree with the machine before its strategy is resumed
/// \[s\].
const TRUSTED: f64 = 0.5;

/// Inputs of one control period.
#[derive(Clone, Copy, Debug)]
pub struct Period {
    /// Time since the last executed period, by the machine's clock \[s\].
    pub elapsed: f64,
    /// Newest data from the machine; none before the first.
    pub incoming: Option<Incoming>,
    /// State of the simulated crane; none if there is no simulation.
    pub simulated: Option<Simulated>,
    /// Request of the operator.
    pub request: Request,
    /// Requested strategy.
    pub strategy: Strategy,
    /// Periods missed since the last executed one.
    pub missed: u32,
    /// Whether an operator is present.
    pub attended: bool,
    /// Whether the clock jumped backwards or far ahead.
    pub clock_jumped: bool,
    /// Timing of the real-time tasks, for the record.
    pub deadlines: Option<Deadlines>,
}

/// Record of one control period, for the log.
#[derive(Clone, Copy, Debug)]
pub struct Record {
    /// Time since the executive began \[s\].
    pub time: f64,
    /// Time of the course \[s\], negative during the approach to its start; none while the supervisor does
    /// not pass the controller's command on.
    pub course_time: Option<f64>,
    /// Largest speed of the course \[m/s\].
    pub course_speed: f64,
    /// Set point of the piston.
    pub reference: SetPoint<f64>,
    /// Part of the set point that is the decaying start offset \[m\].
    pub start_offset: f64,
    /// Newest measurement.
    pub measurement: Measurement,
    /// State reported by the machine, if it reports one.
    pub status: Option<MachineStatus>,
    /// State of the machine's attachment, if it counts its datagrams.
    pub link: Option<Link>,
    /// State of the simulated crane.
    pub simulated: Option<Simulated>,
    /// Decision of the supervisor, with the command that was sent.
    pub decision: Decision,
    /// Active strategy.
    pub strategy: Strategy,
    /// Reason why the benchmark controller took over; none while the requested strategy is active.
    pub fallback: Option<Fallback>,
    /// Outputs of the state estimator; none before the first measurement and for a crane without a
    /// scheduled LQR.
    pub estimates: Option<Estimates>,
    /// Conditions of the simulated crane.
    pub conditions: Conditions,
    /// Timing of the real-time tasks; none in simulated time.
    pub deadlines: Option<Deadlines>,
}

/// Reason why the benchmark controller takes over from another strategy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fallback {
    /// The simulation differs too much from the machine, is delayed, or failed.
    Simulation,
    /// The state estimator diverged, or an estimate is not finite.
    Estimator,
    /// The strategy's command is not finite.
    Command,
    /// There is no scheduled LQR for this crane.
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

/// Estimates of the machine's state with their standard deviations, at the time of the measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimates {
    /// Estimated state and parameters.
    pub state: MachineState<f64>,
    /// Standard deviations of the estimates.
    pub deviation: MachineState<f64>,
    /// Estimated parameters that a later run may start with.
    pub parameters: RetainedParameters<f64>,
    /// Innovations of position \[m\] and load pressure \[Pa\].
    pub innovation: [f64; 2],
    /// Standard deviations of the innovations by the filter; NaN where an innovation is zero, as while the
    /// load is held.
    pub innovation_deviation: [f64; 2],
    /// Mean of the normalised innovation squared \[1\].
    pub mean_nis: f64,
    /// Identified lag of the drive \[s\].
    pub drive_lag: f64,
    /// Estimated position of the tip; none for a crane whose tip is not estimated.
    pub tip: Option<TipEstimate<f64>>,
}

/// Timing of the real-time tasks, as the control task reads it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deadlines {
    /// Release delay of the control task \[ns\].
    pub control_late: u64,
    /// Execution time of its last period \[ns\].
    pub control_execution: u64,
    /// Missed releases of the control task since the start.
    pub control_missed: u64,
    /// Largest release delay of the simulation over about one control period \[ns\].
    pub simulation_late: u64,
    /// Longest execution time of a simulation step over about one control period \[ns\].
    pub simulation_execution: u64,
    /// Missed releases of the simulation since the start.
    pub simulation_missed: u64,
}

impl Record {
    /// Signals of the axis.
    pub fn signals(&self) -> &AxisSignals<f64> {
        &self.measurement.axes[0].signals
    }

    /// Tracking error x − x_ref \[m\] during the course; none during the approach to its start.
    pub fn error(&self) -> Option<f64> {
        self.course_time
            .filter(|time| *time >= 0.0)
            .map(|_| self.signals().stroke - self.reference.position)
    }
}

/// Control task, called once a period. It allocates no memory in the cycle.
#[derive(Clone)]
pub struct ControlTask {
    benchmark: Benchmark<f64>,
    /// Rod-side area over piston area.
    area_ratio: f64,
    course: Course,
    /// Set points ahead of the present time, without [`start_offset`](Self::start_offset).
    preview: Preview<f64>,
    /// Course time of the last set point in the preview \[s\].
    preview_end: f64,
    supervisor: Supervisor,
    /// Largest allowed tracking error now, under feedback, and in open loop \[m\].
    tracking: f64,
    closed_loop_tracking: f64,
    open_loop_tracking: f64,
    /// Simulation steps due in a control period.
    steps_due: f64,
    /// Step counter of the simulation at the last period.
    steps: u64,
    /// Number of steps by which the simulation is delayed.
    behind: f64,
    /// Synchronisation counter of the simulation at the last period.
    epoch: u64,
    /// Time for which the simulation has agreed with the machine since the fallback \[s\].
    trusted: f64,
    /// Synchronisation counter of the simulation when the fallback occurred.
    fallen_at: u64,
    time: f64,
    course_time: f64,
    decision: Decision,
    strategy: Strategy,
    fallback: Option<Fallback>,
    published: PublishedStrategy,
    /// State estimator and scheduled LQR; none for a crane without such a design.
    scheduled_lqr: Option<ScheduledLqrController>,
    /// Estimator of the tip position and its state; none for a crane whose tip is not estimated.
    tip: Option<TipEstimator<f64>>,
    tip_memory: TipMemory<f64>,
    /// Conditions of the simulated crane.
    conditions: Conditions,
    /// Speed of the simulated crane's motor \[rev/s\].
    simulated_motor: f64,
    /// Remaining start offset \[m\].
    start_offset: f64,
    /// Remaining offset of the command after a change of strategy \[rev/s\].
    offset: f64,
    wanted: f64,
    measurement: Measurement,
    valve: Option<ValveState>,
    status: Option<MachineStatus>,
    link: Option<Link>,
    age: f64,
}

impl ControlTask {
    /// Control task for a model, a course, supervision limits and the first strategy.
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

    /// Signals of the axis in the newest measurement.
    fn signals(&self) -> &AxisSignals<f64> {
        &self.measurement.axes[0].signals
    }

    /// Conditions for the simulated crane. Under the scheduled LQR payload and transition pressure are
    /// estimates, updated while the load is held. Before the first update they are those of the crane file.
    pub fn conditions(&self) -> Conditions {
        self.conditions
    }

    /// Replaces the course. Ignored while the controller moves the load.
    pub fn take(&mut self, course: Course) {
        if !self.decision.controls {
            self.supervisor.set_speed(course.speed());
            self.course = course;
        }
    }

    /// The same with other supervision limits, before the first request.
    #[must_use]
    pub fn within(mut self, limits: Limits) -> Self {
        self.supervisor = Supervisor::new(limits);
        self
    }

    /// Time without a command after which the drive stops by itself \[s\].
    pub fn watchdog(&self) -> f64 {
        self.supervisor.limits().watchdog
    }

    /// Motor speed of the simulated crane until the next period \[rev/s\]; none while the load is held.
    pub fn simulated_motor(&self) -> Option<f64> {
        self.decision.controls.then_some(self.simulated_motor)
    }

    /// One control period.
    pub fn period(&mut self, now: &Period) -> Record {
        let period = self.benchmark.period;
        let before = self.measurement.number;
        let newest = now.incoming.filter(|incoming| incoming.measurement.number != before);
        // after a restart the machine counts its measurements from one
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
        // the attachment's state is updated in every period, also without a new measurement
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
                // the course starts at the released piston; the start offset decays with the travel
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

    /// Updates the state estimator. It runs under every strategy, so that it has converged at a change of
    /// strategy.
    fn estimate(&mut self) {
        let measurement = self.judged();
        // the filter is initialised from the first measurement
        let Some(controller) = self.scheduled_lqr.as_mut().filter(|_| measurement.number > 0)
        else {
            return;
        };
        // delays come from the attachment if it measures them; they are constant while the load moves
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

    /// The same with a state estimator that starts with the parameters of an earlier run.
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

    /// Newest measurement with each signal marked as good, out of range or stale.
    fn judged(&self) -> Measurement {
        let is_stale = self.age > FRESH * self.benchmark.period;
        let ranges = ranges(self.supervisor.limits());
        let axes = self.measurement.axes.map(|axis| match is_stale {
            true => axis.within(&ranges).stale(),
            false => axis.within(&ranges),
        });
        Measurement { axes, ..self.measurement }
    }

    /// Fills the preview at the start of the course. Times ahead are summed period by period, as the course
    /// time is. A set point is then bit-identical in the preview and at its own period.
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

    /// Shifts the preview by one period.
    fn advance_preview(&mut self) {
        let (course, now, period) = (&self.course, self.course_time, self.benchmark.period);
        self.preview_end += period;
        let (end, ahead) = (self.preview_end, PERIODS_AHEAD as f64 * period);
        self.preview.advance(|after| match (after - ahead).abs() < 0.5 * period {
            true => course.reference(end),
            false => course.reference(now + after),
        });
    }

    /// Updates payload and transition pressure of the simulated crane from the estimator while the load is
    /// held. A change during motion would disturb the simulation, and with it the machine under simulation
    /// feedforward.
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

    /// Requested strategy. During the approach to the start of a course an open-loop strategy is replaced
    /// by the benchmark controller.
    fn asked(&self, now: &Period) -> Strategy {
        match self.course_time < 0.0 && !now.strategy.estimates() {
            true => Strategy::BenchmarkClosedLoop,
            false => now.strategy,
        }
    }

    /// Prepares the strategies for control of the load from the next period on.
    fn begin(&mut self, now: &Period) {
        self.offset = 0.0;
        let beginning = self.course.reference(-self.course.approach()).position;
        self.start_offset = self.signals().stroke - beginning;
        // the scheduled LQR takes over from the benchmark controller in the first period
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
        // the motor speed that keeps the pump pre-loaded now compensates the leakage: it is the initial
        // command
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

    /// Computes the motor speed of the active strategy.
    fn control(&mut self, reference: &SetPoint<f64>, measured: &BenchmarkInput<f64>, now: &Period) {
        let b = self.benchmark;
        if let Some(simulated) = now.simulated.filter(|s| s.epoch != self.epoch) {
            // the simulation was synchronised with the machine at rest
            self.epoch = simulated.epoch;
            self.steps = simulated.steps;
            self.published.start_simulated(Some(simulated.axis()));
            (self.simulated_motor, self.behind, self.trusted) = (0.0, 0.0, 0.0);
        }
        let asked = self.asked(now);
        // a strategy that uses the simulation needs one that runs, is on time and agrees with the machine
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
        // a diverged estimator is initialised again at the next release; a non-finite command is not
        // retried in motion
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
        // the strategy is resumed only after a synchronisation of the simulation with the machine
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
            // the published strategies had no measurements while the scheduled LQR was active
            self.published.forget_measurements(&self.measurement);
        }
        if changes && !strategy.estimates() {
            self.published.change_to(strategy, self.wanted);
        }
        // the simulated crane follows the course under every strategy, so that any strategy can be selected
        // later
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
        // after a change from open loop the tracking limit decreases slowly while feedback removes the
        // error
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
