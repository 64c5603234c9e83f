//! Simulated crane beside the machine, with the published integration scheme.

use crate::{LabError, Plant, plant};
use hydroboom_control::controller::{AxisState, SimulatedState};
use hydroboom_description::Description;
use hydroboom_model::{Input, Scheme};

/// Simulated crane of the model.
pub(crate) struct SimulatedCrane {
    plant: Box<dyn Plant>,
    /// Integration steps per control period.
    count: u32,
}

impl SimulatedCrane {
    /// Crane at rest with its piston at a position \[m\].
    pub(crate) fn new(model: &Description, start: f64) -> Result<Self, LabError> {
        let step = model.numbers.simulation_period;
        let plant = plant(model, &model.start(start), Scheme::Published, step)?;
        Ok(Self { plant, count: (model.numbers.control_period / step).round() as u32 })
    }

    /// Present state.
    pub(crate) fn state(&self) -> SimulatedState {
        SimulatedState { axes: [axis_state(self.plant.as_ref())] }
    }

    /// Advances by one control period at a motor speed \[rev/s\].
    pub(crate) fn advance(&mut self, motor_speed: f64) -> Result<(), LabError> {
        let input = Input { pump_speed: motor_speed, holding_valve: 1.0 };
        self.plant.advance(&input, self.count).map_err(LabError::during("the simulated crane"))
    }
}

/// State of a simulated axis for the controllers.
pub(crate) fn axis_state(plant: &dyn Plant) -> AxisState<f64> {
    let outputs = plant.outputs();
    AxisState {
        stroke: outputs.stroke,
        velocity: outputs.velocity,
        load_pressure: plant.load_pressure(),
    }
}
