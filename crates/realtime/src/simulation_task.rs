//! Simulation of the crane beside the machine, in steps of 50 us.

use crate::command_delay::CommandDelay;
use crate::conditions::Conditions;
use hydroboom_control::controller::{AxisState, SimulatedState};
use hydroboom_description::{BuildError, Description};
use hydroboom_model::{Crane, CraneState, Input, Scheme, Simulation};
use hydroboom_plant::PlantError;

/// State of rest of a crane model with three segments, to which the simulation is synchronised.
#[derive(Clone, Copy, Debug)]
pub struct AtRest {
    conditions: Conditions,
    crane: Crane<f64, 3>,
    state: CraneState<f64, 3>,
}

impl AtRest {
    /// Rest state of the model under given conditions with the piston at a position \[m\] and the pump
    /// pre-loaded. The computation takes milliseconds: not for the real-time cycle.
    ///
    /// # Errors
    ///
    /// [`PlantError`] if the description gives no model of three segments, or no state of rest.
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

/// State of the simulated crane, as published for controllers and observers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Simulated {
    /// Number of executed integration steps.
    pub steps: u64,
    /// Number of synchronisations with the machine since the start.
    pub epoch: u64,
    /// State that the controllers use: piston position \[m\] and velocity \[m/s\], and load pressure \[Pa\] of each
    /// axis.
    pub state: SimulatedState,
    /// Absolute angle of each boom segment \[rad\].
    pub angle: [f64; 3],
    /// Whether the state left the range of validity of the model. The simulation is then frozen.
    pub failed: bool,
}

impl Simulated {
    /// State of the simulated axis.
    pub fn axis(&self) -> &AxisState<f64> {
        &self.state.axes[0]
    }
}

/// Simulation of a crane of three segments beside the machine, by the published integration scheme.
#[derive(Clone)]
pub struct SimulationTask {
    model: Description,
    /// Present conditions, and those that they approach.
    conditions: Conditions,
    wanted: Conditions,
    simulation: Simulation<3>,
    simulated: Simulated,
    command_delay: CommandDelay,
    /// Integration steps of a control period.
    steps_per_period: usize,
}

impl SimulationTask {
    /// Simulation of the described crane, at rest with its piston at a position \[m\] and its pump pre-loaded.
    ///
    /// # Errors
    ///
    /// [`PlantError`] if the description gives no model of three segments, or no state of rest.
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
            command_delay: CommandDelay::default(),
            // the period is a multiple of the step, as the description checks
            steps_per_period: (model.numbers.control_period / step).round() as usize,
        };
        task.look();
        Ok(task)
    }

    /// Executes one integration step with the newest command of the pump's speed \[rev/s\], which acts after the delay
    /// that is set. A step that fails sets [`Simulated::failed`]. Further ones then have no effect until
    /// [`synchronise`](Self::synchronise).
    pub fn step(&mut self, pump_speed: f64) {
        if self.simulated.failed {
            return;
        }
        if self.conditions.differ(&self.wanted) {
            self.take_on();
        }
        let pump_speed = self.command_delay.push(pump_speed);
        match self.simulation.advance(&Input { pump_speed, holding_valve: 1.0 }, 1) {
            Ok(()) => {
                self.simulated.steps += 1;
                self.look();
            }
            Err(_) => self.simulated.failed = true,
        }
    }

    /// Sets the payload and the oil that the simulated crane approaches while it moves.
    pub fn set_conditions(&mut self, now: &Conditions) {
        self.wanted = *now;
    }

    /// Sets the delay from command to actuation at the machine \[control periods\], so that the simulated crane is in step
    /// with the machine. A delay of more than 400 integration steps (20 periods of 20 steps) counts as 400.
    pub fn set_command_delay(&mut self, periods: usize) {
        self.command_delay.set(periods.saturating_mul(self.steps_per_period));
    }

    /// Moves the conditions one step towards those set. It takes 0.1 us.
    fn take_on(&mut self) {
        self.conditions = self.conditions.towards(&self.wanted, self.simulation.step());
        // only numbers change, not the type of crane, so that building it succeeds
        if let Ok(crane) = self.model.crane_over(&self.conditions.numbers(&self.model.numbers)) {
            self.simulation.set_crane(crane);
        }
    }

    /// Restarts from a state of rest, also after a failure. An invalid state is ignored.
    pub fn synchronise(&mut self, at: &AtRest) {
        if self.simulation.set_state(at.state).is_ok() {
            self.simulation.set_crane(at.crane);
            self.conditions = at.conditions;
            self.command_delay.clear();
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

    /// Present state of the simulated crane.
    pub fn simulated(&self) -> Simulated {
        self.simulated
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_delayed_simulation_equals_one_with_the_commands_of_the_delay_before() {
        let model = Description::uia_single_boom().unwrap();
        let mut prompt = SimulationTask::new(&model, 0.2).unwrap();
        let mut delayed = prompt.clone();
        delayed.set_command_delay(2);
        let speed = |step: usize| if step < 200 { 3.0 } else { 3.0 - 1e-3 * (step - 200) as f64 };
        let steps = 2 * delayed.steps_per_period;
        let mut strokes = Vec::new();
        for step in 0..2000 {
            // the first command acts from the start on, so that both begin alike
            prompt.step(speed(step));
            delayed.step(speed(step));
            strokes.push([prompt.simulated().axis().stroke, delayed.simulated().axis().stroke]);
        }
        assert_eq!(strokes[199], [strokes[199][0]; 2]);
        let moved = strokes[1999][0] - strokes[1999][1];
        assert!(moved.abs() > 1e-6, "{moved}");
        // stepped with the commands of two periods before, it is the same to the last bit
        let mut late = SimulationTask::new(&model, 0.2).unwrap();
        for (step, stroke) in strokes.iter().enumerate() {
            late.step(speed(step.saturating_sub(steps)));
            assert_eq!(late.simulated().axis().stroke, stroke[1]);
        }
    }
}
