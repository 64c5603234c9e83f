//! The simulation beside the machine: a step of 50 us at a time.

use hydroboom_control::Seen;
use hydroboom_description::{BuildError, Description};
use hydroboom_model::{Crane, CraneState, Input, Scheme, Simulation, Start};
use hydroboom_plant::PlantError;

/// State of the simulated crane, three segments.
pub type SimulatedState = CraneState<f64, 3>;

/// What the simulation shows the controller, and who looks on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Simulated {
    /// Steps taken.
    pub steps: u64,
    /// How often it was set to a state.
    pub epoch: u64,
    /// What the controllers look at.
    pub seen: Seen<f64>,
    /// Absolute angle of each boom segment \[rad\].
    pub angle: [f64; 3],
    /// Whether it left what the model holds for; it then stays where it was.
    pub failed: bool,
}

/// The simulated crane, three segments, published scheme.
pub struct SimulationTask {
    simulation: Simulation<3>,
    simulated: Simulated,
}

/// The model, and its state at rest. Takes milliseconds: not for a real-time cycle.
///
/// # Errors
///
/// [`PlantError`] when the description gives no model of three segments, or no state of rest.
pub fn at_rest(
    model: &Description,
    start: &Start,
) -> Result<(Crane<f64, 3>, SimulatedState), PlantError> {
    let crane = model.crane::<3>()?;
    let state = crane.at_rest(start).map_err(BuildError::from)?;
    Ok((crane, state))
}

impl SimulationTask {
    /// A simulated crane at rest, pump pre-loaded.
    ///
    /// # Errors
    ///
    /// [`PlantError`] when the description gives no model of three segments, or no state of rest.
    pub fn new(model: &Description, start: &Start) -> Result<Self, PlantError> {
        let (crane, state) = at_rest(model, start)?;
        let step = model.numbers.simulation_period;
        let simulation = Simulation::new(crane, state, Scheme::Published, step)
            .map_err(PlantError::Simulation)?;
        let mut task = Self { simulation, simulated: Simulated::default() };
        task.look();
        Ok(task)
    }

    /// One step with the given pump speed \[rev/s\].
    pub fn step(&mut self, pump_speed: f64) {
        if self.simulated.failed {
            return;
        }
        match self.simulation.advance(&Input { pump_speed, holding_valve: 1.0 }, 1) {
            Ok(()) => {
                self.simulated.steps += 1;
                self.look();
            }
            Err(_) => self.simulated.failed = true,
        }
    }

    /// Goes on from another state, also after it has failed. A state that is not valid is left out.
    pub fn synchronise(&mut self, state: SimulatedState) {
        if self.simulation.set_state(state).is_ok() {
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
        self.simulated.seen = Seen {
            stroke: cylinder.stroke,
            velocity: cylinder.velocity(&crane.boom, &state.boom.angular_velocity),
            load_pressure: crane.cylinder.load_pressure(p.a, p.b),
        };
        self.simulated.angle = state.boom.angle;
    }

    /// What it shows now.
    pub fn simulated(&self) -> Simulated {
        self.simulated
    }
}
