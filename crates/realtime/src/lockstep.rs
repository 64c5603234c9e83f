//! Executive in simulated time: the same tasks in turn in one thread, as fast as the computer allows and
//! bit-identical in every repetition.

use crate::control_task::{ControlTask, Period, Record};
use crate::course::Course;
use crate::desk::Desk;
use crate::machine::Incoming;
use crate::operator::Operator;
use crate::posix::{now, wait_until};
use crate::session::{Lookout, Order};
use crate::setup::SetupError;
use crate::simulation_task::SimulationTask;
use crate::trouble::{Tampering, Trouble};
use hydroboom_control::command::AxisCommand;
use hydroboom_control::estimation::retained_parameters::RetainedParameters;
use hydroboom_control::measurement::Measurement;
use hydroboom_control::reference::trajectory::Trajectory;
use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::limits::Limits;
use hydroboom_control::supervision::supervisor::Decision;
use hydroboom_description::Description;
use hydroboom_design::limits;
use hydroboom_model::SimulationError;
use hydroboom_plant::PlantError;
use hydroboom_virtual_crane::{Truth, VirtualCrane};
use std::sync::Arc;

/// Disturbances of the tasks, the machine and their connection in a simulated run. The default methods disturb
/// nothing.
pub trait Disturbance {
    /// Measurement that arrives; none if it is lost.
    fn reading(&mut self, incoming: Incoming) -> Option<Incoming> {
        Some(incoming)
    }
    /// Command that arrives; none if it is lost. The machine's own watchdog then holds the load.
    fn command(&mut self, command: AxisCommand<f64>) -> Option<AxisCommand<f64>> {
        Some(command)
    }
    /// Command that drive and valve execute, given the command that acts on them.
    fn drive(&mut self, command: AxisCommand<f64>) -> AxisCommand<f64> {
        command
    }
    /// Number of simulation steps that are executed in this period, given the number `due`.
    fn steps(&mut self, due: u32) -> u32 {
        due
    }
    /// Whether an operator is present.
    fn attended(&mut self) -> bool {
        true
    }
    /// Whether the clock jumped.
    fn clock_jumped(&mut self) -> bool {
        false
    }
    /// Whether the control task is suspended in this period: it is not executed and sends nothing.
    fn control_is_held_up(&mut self) -> bool {
        false
    }
    /// Changes the machine itself, as its payload, valve or leakage, before it advances by a period.
    ///
    /// # Errors
    ///
    /// [`PlantError`] if the changed machine cannot be built.
    fn machine(&mut self, _machine: &mut VirtualCrane) -> Result<(), PlantError> {
        Ok(())
    }
}

/// Run without any disturbance.
pub struct Undisturbed;

impl Disturbance for Undisturbed {}

/// Executive in simulated time: control task, simulation task and virtual crane. A copy continues from the same
/// moment.
///
/// ```
/// use hydroboom_control::strategy::Strategy;
/// use hydroboom_description::Description;
/// use hydroboom_realtime::{lockstep::Lockstep, operator::Operator};
/// let (model, machine) = (Description::uia_single_boom()?, Description::uia_virtual()?);
/// let (motion, strategy) = (machine.motion(model.numbers.fast), Strategy::BenchmarkClosedLoop);
/// let mut run = Lockstep::new(&model, &machine, motion, strategy)?;
/// let record = run.period(&mut Operator::automatic(model.numbers.control_period), strategy)?;
/// assert_eq!(record.decision.command.holding_valve, 0.0, "the load is held at first");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct Lockstep {
    control: ControlTask,
    simulation: SimulationTask,
    machine: VirtualCrane,
    steps: u32,
    sequence: u64,
    /// Last command that arrived, and the number of periods since.
    arrived: (AxisCommand<f64>, u32),
    /// Periods for which the control task has been suspended.
    held_up: u32,
    /// Periods without a command after which the machine's own watchdog shuts it down.
    watchdog: u32,
    /// Last record.
    record: Option<Record>,
}

impl Lockstep {
    /// Executive designed for `model`, with a virtual crane as the machine, at rest at the start of the trajectory
    /// `path`. The load is held, and the pump is without pressure.
    ///
    /// # Errors
    ///
    /// [`SetupError`] if a crane cannot be built or the model has no supervision limits.
    pub fn new(
        model: &Description,
        machine: &Description,
        path: impl Trajectory + 'static,
        strategy: Strategy,
    ) -> Result<Self, SetupError> {
        Self::along(model, machine, Arc::new(path), strategy)
    }

    /// Executive as of [`new`](Self::new), along a shared trajectory.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new).
    pub fn along(
        model: &Description,
        machine: &Description,
        path: Arc<dyn Trajectory>,
        strategy: Strategy,
    ) -> Result<Self, SetupError> {
        let (begin, speed) = (path.reference(0.0).position, path.speed());
        let mut start = machine.start(begin);
        start.preload = 0.0;
        let n = &model.numbers;
        let course = Course::new(path);
        Ok(Self {
            control: ControlTask::new(model, course, limits(model, speed)?, strategy),
            simulation: SimulationTask::new(model, begin)?,
            machine: VirtualCrane::new(machine, &start)?,
            steps: (n.control_period / n.simulation_period).round() as u32,
            sequence: 0,
            arrived: (HELD, 0),
            held_up: 0,
            watchdog: (machine.numbers.supervision_watchdog / n.control_period).round() as u32,
            record: None,
        })
    }

    /// Executive whose state estimator starts with the parameters of an earlier run.
    #[must_use]
    pub fn with_retained_parameters(mut self, retained: RetainedParameters<f64>) -> Self {
        self.control = self.control.with_retained_parameters(retained);
        self
    }

    /// Executes one control period without disturbances and returns its record.
    ///
    /// # Errors
    ///
    /// [`SimulationError`] if the simulation of the machine fails.
    pub fn period(
        &mut self,
        operator: &mut Operator,
        strategy: Strategy,
    ) -> Result<Record, SimulationError> {
        self.disturbed_period(operator, strategy, &mut Undisturbed)
    }

    /// Executes one control period with disturbances and returns its record; in a period in which the control task is
    /// suspended, the record of the last executed one.
    ///
    /// # Errors
    ///
    /// [`SimulationError`] if the simulation of the machine fails.
    pub fn disturbed_period(
        &mut self,
        operator: &mut Operator,
        strategy: Strategy,
        disturbance: &mut dyn Disturbance,
    ) -> Result<Record, SimulationError> {
        self.sequence += 1;
        let measurement = Measurement { number: self.sequence, ..self.machine.measurement() };
        let incoming = Incoming::new(measurement, self.machine.valve());
        let incoming = disturbance.reading(incoming);
        let is_held_up = disturbance.control_is_held_up();
        if let (true, Some(record)) = (is_held_up, self.record) {
            self.held_up += 1;
            self.move_machine(None, disturbance)?;
            return Ok(record);
        }
        let missed = std::mem::take(&mut self.held_up);
        let record = self.control.period(&Period {
            elapsed: f64::from(missed + 1) * self.machine.period(),
            incoming,
            simulated: Some(self.simulation.simulated()),
            request: operator.request(),
            strategy,
            missed,
            attended: disturbance.attended(),
            clock_jumped: disturbance.clock_jumped(),
            deadlines: None,
        });
        operator.see(&record.decision);
        self.simulation.set_conditions(&self.control.conditions());
        self.simulation.set_command_delay(self.control.command_delay());
        self.record = Some(record);
        self.move_machine(Some(record.decision.command), disturbance)?;
        Ok(record)
    }

    /// Advances simulation and machine by one period, with the command sent, if any.
    fn move_machine(
        &mut self,
        sent: Option<AxisCommand<f64>>,
        disturbance: &mut dyn Disturbance,
    ) -> Result<(), SimulationError> {
        if let Some(speed) = self.control.simulated_motor() {
            (0..disturbance.steps(self.steps)).for_each(|_| self.simulation.step(speed));
        }
        self.arrived = match sent.and_then(|command| disturbance.command(command)) {
            Some(command) => (command, 0),
            None if self.arrived.1 >= self.watchdog => (HELD, self.arrived.1),
            None => (self.arrived.0, self.arrived.1 + 1),
        };
        // a fault that cannot be built has no effect on the machine
        let _ = disturbance.machine(&mut self.machine);
        self.machine.advance(&disturbance.drive(self.arrived.0))
    }

    /// Executive with other supervision limits.
    #[must_use]
    pub fn within(mut self, limits: Limits) -> Self {
        self.control = self.control.within(limits);
        self
    }

    /// Executes an order of the session. A fault to inject is returned, because it is a disturbance.
    pub fn take(&mut self, order: Order) -> Option<Tampering> {
        match order {
            Order::Course(course) => self.control.take(course),
            Order::Synchronise(at) => self.simulation.synchronise(&at),
            Order::Tamper(what) => return Some(what),
        }
        None
    }

    /// Virtual crane in its present state.
    pub fn machine(&self) -> &VirtualCrane {
        &self.machine
    }

    /// True state of the machine, also of quantities that no sensor measures.
    pub fn truth(&self) -> Truth {
        self.machine.truth()
    }
}

const HELD: AxisCommand<f64> = AxisCommand { motor_speed: 0.0, holding_valve: 0.0 };

/// Rate of simulated time relative to the computer's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// As fast as the computer allows.
    Free,
    /// At most real time, so that a person can watch.
    Clock,
}

/// Periods between two requests for orders.
const ORDERS: u32 = 20;
/// Periods of a held load at rest before a run ends.
const RESTED: u32 = 200;

/// Runs a session in simulated time until its end condition holds, and returns the last decision of the supervisor.
///
/// # Errors
///
/// [`SimulationError`] if the simulation of the machine fails.
pub fn run(
    lockstep: Lockstep,
    machine: &Description,
    lookout: Lookout<'_>,
    pace: Pace,
) -> Result<Decision, SimulationError> {
    let watched = Watched { trouble: Trouble::new(machine), desk: lookout.desk };
    attend(&mut Disturbed { lockstep, watched }, lookout, pace)
}

/// Tasks and machine that advance by control periods in simulated time.
pub trait Periods {
    /// Error that prevents the next period.
    type Error;
    /// Duration of a control period \[s\].
    fn duration(&self) -> f64;
    /// Executes an order.
    fn take(&mut self, order: Order);
    /// Executes one control period. Returns the true state of the machine before it, if known, and the
    /// record.
    ///
    /// # Errors
    ///
    /// [`Self::Error`] if the period cannot be executed.
    fn next(
        &mut self,
        operator: &mut Operator,
        desk: &Desk,
    ) -> Result<(Option<Truth>, Record), Self::Error>;
}

/// Virtual crane with injected faults.
struct Disturbed<'a> {
    lockstep: Lockstep,
    watched: Watched<'a>,
}

impl Periods for Disturbed<'_> {
    type Error = SimulationError;

    fn duration(&self) -> f64 {
        self.lockstep.machine.period()
    }

    fn take(&mut self, order: Order) {
        if let Some(what) = self.lockstep.take(order) {
            self.watched.trouble.tamper(what);
        }
    }

    fn next(
        &mut self,
        operator: &mut Operator,
        desk: &Desk,
    ) -> Result<(Option<Truth>, Record), SimulationError> {
        let truth = self.lockstep.truth();
        let strategy = desk.strategy();
        let record = self.lockstep.disturbed_period(operator, strategy, &mut self.watched)?;
        self.watched.trouble.pass();
        Ok((Some(truth), record))
    }
}

/// Runs a session by control periods until its end condition holds, and returns the last decision of the supervisor.
///
/// # Errors
///
/// The error of the period that could not be executed.
pub fn attend<P: Periods>(
    periods: &mut P,
    lookout: Lookout<'_>,
    pace: Pace,
) -> Result<Decision, P::Error> {
    let Lookout { desk, attendant, ending } = lookout;
    let mut operator = Operator::new(periods.duration());
    let period = (periods.duration() * 1e9).round() as u64;
    let (mut release, mut rested, mut count) = (now(), 0, 0_u32);
    loop {
        if count.is_multiple_of(ORDERS) {
            attendant.orders().into_iter().for_each(|order| periods.take(order));
        }
        count = count.wrapping_add(1);
        operator.listen(desk);
        let (truth, record) = periods.next(&mut operator, desk)?;
        if let Some(truth) = truth {
            attendant.see_truth(&truth);
        }
        attendant.see(&record);
        rested = match ending.has_come(&operator, desk, &record.decision) {
            true => rested + 1,
            false => 0,
        };
        if rested > RESTED {
            return Ok(record.decision);
        }
        if pace == Pace::Clock {
            // after a delay of more than ten periods the schedule restarts from the present time
            release = (release + period).max(now().saturating_sub(10 * period));
            wait_until(release, 0);
        }
    }
}

/// Injected faults, and the operator desk.
struct Watched<'a> {
    trouble: Trouble,
    desk: &'a Desk,
}

impl Disturbance for Watched<'_> {
    fn reading(&mut self, incoming: Incoming) -> Option<Incoming> {
        self.trouble.reading(incoming)
    }
    fn command(&mut self, command: AxisCommand<f64>) -> Option<AxisCommand<f64>> {
        self.trouble.command(command)
    }
    fn steps(&mut self, due: u32) -> u32 {
        self.trouble.steps(due)
    }
    fn attended(&mut self) -> bool {
        self.trouble.attended() && self.desk.is_attended()
    }
    fn clock_jumped(&mut self) -> bool {
        self.trouble.clock_jumped()
    }
    fn control_is_held_up(&mut self) -> bool {
        self.trouble.control_is_held_up()
    }
    fn drive(&mut self, command: AxisCommand<f64>) -> AxisCommand<f64> {
        self.trouble.drive(command)
    }
    fn machine(&mut self, machine: &mut VirtualCrane) -> Result<(), PlantError> {
        self.trouble.machine(machine)
    }
}
