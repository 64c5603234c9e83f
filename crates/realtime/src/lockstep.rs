//! The executive in simulated time: the same tasks in one thread, each in its turn, as fast as it
//! goes and every time the same.

use crate::control_task::{ControlTask, Period, Record, limits};
use crate::machine::Incoming;
use crate::operator::Operator;
use crate::simulation_task::SimulationTask;
use hydroboom_control::{Command, Motion, Strategy};
use hydroboom_description::Description;
use hydroboom_model::SimulationError;
use hydroboom_plant::PlantError;
use hydroboom_virtual_crane::{Truth, VirtualCrane};

/// What may go wrong between the tasks and the machine. By default nothing does.
pub trait Disturbance {
    /// What arrives of a reading, if anything.
    fn reading(&mut self, incoming: Incoming) -> Option<Incoming> {
        Some(incoming)
    }
    /// What arrives of a command; none: nothing does, and the machine's own watchdog holds the load.
    fn command(&mut self, command: Command<f64>) -> Option<Command<f64>> {
        Some(command)
    }
    /// How many of the simulation's steps are taken.
    fn steps(&mut self, due: u32) -> u32 {
        due
    }
    /// Whether somebody attends.
    fn attended(&mut self) -> bool {
        true
    }
    /// Whether the clock jumped.
    fn clock_jumped(&mut self) -> bool {
        false
    }
    /// Deadlines that were missed in a row.
    fn overruns(&mut self) -> u32 {
        0
    }
    /// Does something to the machine itself.
    ///
    /// # Errors
    ///
    /// [`PlantError`] when there is no such machine.
    fn machine(&mut self, _machine: &mut VirtualCrane) -> Result<(), PlantError> {
        Ok(())
    }
}

/// Nothing goes wrong.
pub struct Undisturbed;

impl Disturbance for Undisturbed {}

/// Without a command for so many periods the machine's own watchdog shuts it down, as a drive does.
const WATCHDOG: u32 = 20;

/// A run in simulated time.
pub struct Lockstep {
    control: ControlTask,
    simulation: SimulationTask,
    machine: VirtualCrane,
    steps: u32,
    sequence: u64,
    /// What the machine was told last, and for how many periods it has been told nothing.
    told: (Command<f64>, u32),
}

impl Lockstep {
    /// A virtual crane with its load held and its pump without pressure, and an executive that knows
    /// the model.
    ///
    /// # Errors
    ///
    /// [`PlantError`] when either crane cannot be built.
    pub fn new(
        model: &Description,
        machine: &Description,
        motion: Motion<f64>,
        strategy: Strategy,
    ) -> Result<Self, PlantError> {
        let mut start = machine.start(motion.start);
        start.preload = 0.0;
        let n = &model.numbers;
        Ok(Self {
            control: ControlTask::new(model, motion, limits(model, motion.speed), strategy),
            simulation: SimulationTask::new(model, &model.start(motion.start))?,
            machine: VirtualCrane::new(machine, &start)?,
            steps: (n.control_period / n.simulation_period).round() as u32,
            sequence: 0,
            told: (HELD, 0),
        })
    }

    /// One control period; what was done in it.
    ///
    /// # Errors
    ///
    /// [`SimulationError`] when the machine breaks.
    pub fn period(
        &mut self,
        operator: &mut Operator,
        strategy: Strategy,
    ) -> Result<Record, SimulationError> {
        self.disturbed_period(operator, strategy, &mut Undisturbed)
    }

    /// One control period in which something may go wrong.
    ///
    /// # Errors
    ///
    /// [`SimulationError`] when the machine breaks.
    pub fn disturbed_period(
        &mut self,
        operator: &mut Operator,
        strategy: Strategy,
        disturbance: &mut dyn Disturbance,
    ) -> Result<Record, SimulationError> {
        self.sequence += 1;
        let incoming = Incoming { sequence: self.sequence, reading: self.machine.reading() };
        let record = self.control.period(&Period {
            incoming: disturbance.reading(incoming),
            simulated: Some(self.simulation.simulated()),
            request: operator.request(),
            strategy,
            overruns: disturbance.overruns(),
            attended: disturbance.attended(),
            clock_jumped: disturbance.clock_jumped(),
        });
        operator.see(&record.decision);
        if let Some(speed) = self.control.simulated_motor() {
            (0..disturbance.steps(self.steps)).for_each(|_| self.simulation.step(speed));
        }
        self.told = match disturbance.command(record.decision.command) {
            Some(command) => (command, 0),
            None if self.told.1 >= WATCHDOG => (HELD, self.told.1),
            None => (self.told.0, self.told.1 + 1),
        };
        // what was asked for cannot be built: then nothing is done to it
        let _ = disturbance.machine(&mut self.machine);
        self.machine.advance(&self.told.0)?;
        Ok(record)
    }

    /// What nobody sees of the machine.
    pub fn truth(&self) -> Truth {
        self.machine.truth()
    }
}

const HELD: Command<f64> = Command { motor_speed: 0.0, holding_valve: 0.0 };
