//! The simulation beside the machine: a step of 50 us at a time.

use crate::conditions::Conditions;
use hydroboom_control::controller::{AxisState, SimulatedState};
use hydroboom_description::{BuildError, Description};
use hydroboom_model::{Crane, CraneState, Input, Scheme, Simulation};
use hydroboom_plant::PlantError;

/// A crane at rest, three segments.
#[derive(Clone, Copy, Debug)]
pub struct AtRest {
    conditions: Conditions,
    crane: Crane<f64, 3>,
    state: CraneState<f64, 3>,
}

impl AtRest {
    /// The model under conditions, at rest with its piston at a position \[m\] and its pump pre-loaded. Takes milliseconds: not for a
    /// real-time cycle.
    ///
    /// # Errors
    ///
    /// [`PlantError`] when the description gives no model of three segments, or no state of rest.
    pub fn new(
        model: &Description,
        conditions: &Conditions,
        stroke: f64,
    ) -> Result<Self, PlantError> {
        let crane = model.crane_over(&conditions.numbers(&model.numbers))?;
        let state = crane.at_rest(&model.start(stroke)).map_err(BuildError::from)?;
        Ok(Self { conditions: *conditions, crane, state })
    }
}

/// What the simulation shows the controller, and who looks on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Simulated {
    /// Steps taken.
    pub steps: u64,
    /// How often it was set to a state.
    pub epoch: u64,
    /// What the controllers look at.
    pub state: SimulatedState,
    /// Absolute angle of each boom segment \[rad\].
    pub angle: [f64; 3],
    /// Whether it left what the model holds for; it then stays where it was.
    pub failed: bool,
}

impl Simulated {
    /// State of its axis.
    pub fn axis(&self) -> &AxisState<f64> {
        &self.state.axes[0]
    }
}

/// The simulated crane, three segments, published scheme.
#[derive(Clone)]
pub struct SimulationTask {
    model: Description,
    /// Under what it is simulated, and is to be.
    conditions: Conditions,
    wanted: Conditions,
    simulation: Simulation<3>,
    simulated: Simulated,
}

impl SimulationTask {
    /// A simulated crane as described, at rest with its piston at a position \[m\] and its pump pre-loaded.
    ///
    /// # Errors
    ///
    /// [`PlantError`] when the description gives no model of three segments, or no state of rest.
    pub fn new(model: &Description, stroke: f64) -> Result<Self, PlantError> {
        let at = AtRest::new(model, &Conditions::described(&model.numbers), stroke)?;
        let step = model.numbers.simulation_period;
        let simulation = Simulation::new(at.crane, at.state, Scheme::Published, step)
            .map_err(PlantError::Simulation)?;
        let mut task = Self {
            model: model.clone(),
            conditions: at.conditions,
            wanted: at.conditions,
            simulation,
            simulated: Simulated::default(),
        };
        task.look();
        Ok(task)
    }

    /// One step with the given pump speed \[rev/s\].
    pub fn step(&mut self, pump_speed: f64) {
        if self.simulated.failed {
            return;
        }
        if self.conditions.differ(&self.wanted) {
            self.take_on();
        }
        match self.simulation.advance(&Input { pump_speed, holding_valve: 1.0 }, 1) {
            Ok(()) => {
                self.simulated.steps += 1;
                self.look();
            }
            Err(_) => self.simulated.failed = true,
        }
    }

    /// Conditions to change to, as it moves.
    pub fn set_conditions(&mut self, now: &Conditions) {
        self.wanted = *now;
    }

    /// Nearer to the conditions that are wanted. It takes a tenth of a microsecond.
    fn take_on(&mut self) {
        self.conditions = self.conditions.towards(&self.wanted, self.simulation.step());
        // the crane is of the make that it was, so that there is one
        if let Ok(crane) = self.model.crane_over(&self.conditions.numbers(&self.model.numbers)) {
            self.simulation.set_crane(crane);
        }
    }

    /// Goes on from rest, also after it has failed. A state that is not valid is left out.
    pub fn synchronise(&mut self, at: &AtRest) {
        if self.simulation.set_state(at.state).is_ok() {
            self.simulation.set_crane(at.crane);
            self.conditions = at.conditions;
            self.simulated.failed = false;
            self.simulated.epoch += 1;
            self.look();
        }
    }

    fn look(&mut self) {
        let (crane, state) = (self.simulation.crane(), self.simulation.state());
        let p = crane.circuit.pressures(&state.circuit);
        let pose = crane.boom.pose(&state.boom.angle);
        let cylinder = crane.boom.cylinder_pose(&pose);
        let axis = AxisState {
            stroke: cylinder.stroke,
            velocity: cylinder.velocity(&crane.boom, &state.boom.angular_velocity),
            load_pressure: crane.cylinder.load_pressure(p.a, p.b),
        };
        self.simulated.state = SimulatedState { axes: [axis] };
        self.simulated.angle = state.boom.angle;
    }

    /// What it shows now.
    pub fn simulated(&self) -> Simulated {
        self.simulated
    }
}
