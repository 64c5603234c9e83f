//! The executive in simulated time: the same tasks in one thread, each in its turn, as fast as it
//! goes and every time the same.

use crate::control_task::{ControlTask, Period, Record, limits};
use crate::machine::Incoming;
use crate::operator::Operator;
use crate::simulation_task::SimulationTask;
use hydroboom_control::{Motion, Strategy};
use hydroboom_description::Description;
use hydroboom_model::SimulationError;
use hydroboom_plant::PlantError;
use hydroboom_virtual_crane::VirtualCrane;

/// A run in simulated time.
pub struct Lockstep {
    control: ControlTask,
    simulation: SimulationTask,
    machine: VirtualCrane,
    steps: u32,
    sequence: u64,
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
        })
    }

    /// The machine.
    pub fn machine(&mut self) -> &mut VirtualCrane {
        &mut self.machine
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
        self.sequence += 1;
        let incoming = Incoming { sequence: self.sequence, reading: self.machine.reading() };
        let record = self.control.period(&Period {
            incoming: Some(incoming),
            simulated: Some(self.simulation.simulated()),
            request: operator.request(),
            strategy,
            overruns: 0,
            attended: true,
            clock_jumped: false,
        });
        operator.see(&record.decision);
        if let Some(speed) = self.control.simulated_motor() {
            (0..self.steps).for_each(|_| self.simulation.step(speed));
        }
        self.machine.advance(&record.decision.command)?;
        Ok(record)
    }
}
