//! Control task: one control period from measurement to command.

mod course_preview;
mod estimation;
mod record;
mod strategy_selection;

pub use record::{Deadlines, Estimates, Fallback, Period, Record};

use crate::conditions::Conditions;
use crate::course::Course;
use crate::machine::Link;
use crate::simulation_task::Simulated;
use hydroboom_control::estimation::retained_parameters::RetainedParameters;
use hydroboom_control::estimation::tip::{TipEstimator, TipMemory};
use hydroboom_control::feedback::benchmark::{Benchmark, BenchmarkInput};
use hydroboom_control::feedback::published_strategy::PublishedStrategy;
use hydroboom_control::feedback::scheduled_lqr_controller::ScheduledLqrController;
use hydroboom_control::measurement::{AxisSignals, Measurement};
use hydroboom_control::reference::preview::Preview;
use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::limits::{Limits, MachineStatus, Observation, ValveState};
use hydroboom_control::supervision::plausibility::ranges;
use hydroboom_control::supervision::supervisor::{Decision, Supervisor};
use hydroboom_description::Description;
use hydroboom_design::scheduled_lqr::{known_delay, scheduled_lqr_controller};
use hydroboom_design::tip::tip_estimator;

/// Piston travel over which the start offset fades out \[m\]. The offset is the released piston's distance
/// from the start of the course.
const FADING: f64 = 0.01;
/// Age in control periods beyond which a measurement is stale.
const FRESH: f64 = 5.5;

/// Control task: measurement, state estimation, control law, supervision and command of one control period. It
/// allocates no memory in the cycle.
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
    /// Delay from command to actuation that the attachment measured while the load was held \[control periods\]; 0 where
    /// it measures none.
    command_delay: usize,
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
    /// Control task in its initial state, with estimator and control laws designed for `model`, supervision limits,
    /// and the first strategy.
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
            command_delay: 0,
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

    /// Payload and oil for the simulated crane. Under the scheduled LQR both are estimates, updated while the load is
    /// held. Before the first update they are those of the crane file.
    pub fn conditions(&self) -> Conditions {
        self.conditions
    }

    /// Replaces the course for the next start. Ignored while the controller moves the load.
    pub fn take(&mut self, course: Course) {
        if !self.decision.controls {
            self.supervisor.set_speed(course.speed());
            self.course = course;
        }
    }

    /// Control task with other supervision limits; to be used before the first period.
    #[must_use]
    pub fn within(mut self, limits: Limits) -> Self {
        self.supervisor = Supervisor::new(limits);
        self
    }

    /// Control task whose state estimator starts with the parameters of an earlier run. Without a scheduled LQR for
    /// the crane it has no effect.
    #[must_use]
    pub fn with_retained_parameters(mut self, retained: RetainedParameters<f64>) -> Self {
        self.scheduled_lqr =
            self.scheduled_lqr.map(|controller| controller.with_retained_parameters(retained));
        self
    }

    /// Time without a command after which the drive stops by itself \[s\].
    pub fn watchdog(&self) -> f64 {
        self.supervisor.limits().watchdog
    }

    /// Delay from command to actuation for the simulated crane \[control periods\]; 0 where the attachment measures none.
    pub fn command_delay(&self) -> usize {
        self.command_delay
    }

    /// Motor speed for the simulated crane until the next period \[rev/s\]; none while the controller does not move
    /// the load.
    pub fn simulated_motor(&self) -> Option<f64> {
        self.decision.controls.then_some(self.simulated_motor)
    }

    /// Executes one control period: from the newest measurement to the command, which the record contains. It
    /// allocates nothing, and reads no clock: all inputs are in `now`.
    pub fn period(&mut self, now: &Period) -> Record {
        let period = self.benchmark.period;
        let (new_readings, lost_readings) = self.read(now);
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
            lost_readings,
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

    /// Takes over the newest measurement and the state of the attachment; returns the numbers of new and of
    /// lost readings.
    fn read(&mut self, now: &Period) -> (u32, u32) {
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
            self.valve = incoming.valve;
            self.age = 0.0;
        }
        let lost_before = self.link.map_or(0, |link| link.lost);
        // the states of machine and connection are updated in every period, also without a new measurement
        self.status = now.incoming.map_or(self.status, |incoming| incoming.status);
        self.link = now.incoming.and_then(|incoming| incoming.link);
        let lost = self.link.map_or(0, |link| link.lost.saturating_sub(lost_before));
        (new_readings, u32::try_from(lost).unwrap_or(u32::MAX))
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
}

#[cfg(test)]
mod tests;
