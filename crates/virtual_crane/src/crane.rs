//! The virtual crane, one control period at a time.

use crate::equipment::{Equipment, Stepping};
use crate::signals::Truth;
use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::{AxisSignals, Measurement};
use hydroboom_control::supervision::limits::ValveState;
use hydroboom_description::Description;
use hydroboom_model::{Outputs, SimulationError, Start};
use hydroboom_plant::{Plant, PlantError, plant};

/// A crane with all that stands between it and a controller. A copy goes on from the same moment.
pub struct VirtualCrane {
    plant: Box<dyn Plant>,
    /// Of the plant, now.
    outputs: Outputs<f64>,
    /// Steps in a control period.
    steps: u32,
    equipment: Equipment,
}

impl Clone for VirtualCrane {
    fn clone(&self) -> Self {
        Self {
            plant: self.plant.copied(),
            outputs: self.outputs,
            steps: self.steps,
            equipment: self.equipment.clone(),
        }
    }
}

impl VirtualCrane {
    /// A crane at rest at `start`, 3/2 valve energised unless the pump sides have no load at all.
    ///
    /// # Errors
    ///
    /// [`PlantError`] when the description gives no model or its steps do not suit each other.
    pub fn new(description: &Description, start: &Start) -> Result<Self, PlantError> {
        let Stepping { scheme, step, count } = Stepping::of(description);
        let mut plant = plant(&Equipment::warmed(description), start, scheme, step)?;
        let outputs = plant.outputs();
        let equipment = Equipment::new(description, start, &outputs, step);
        if let Some(shift) = equipment.dissolved() {
            plant.set_dissolved_air(shift);
        }
        let outputs = plant.outputs();
        Ok(Self { plant, outputs, steps: count, equipment })
    }

    /// The same from now on without the drive's dead time; its lag stays.
    pub fn without_dead_time(mut self) -> Self {
        self.equipment.remove_dead_time();
        self
    }

    /// What has arrived at the controller.
    pub fn signals(&self) -> AxisSignals<f64> {
        self.equipment.signals()
    }

    /// The same with its number, and the time at which it was sampled.
    pub fn measurement(&self) -> Measurement {
        self.equipment.measurement()
    }

    /// State of the load-holding valve as its position switch shows it; none where there is no switch.
    pub fn valve(&self) -> Option<ValveState> {
        self.equipment.valve_state()
    }

    /// What nobody sees.
    pub fn truth(&self) -> Truth {
        self.equipment.truth(&self.outputs)
    }

    /// The model inside.
    pub fn plant(&self) -> &dyn Plant {
        self.plant.as_ref()
    }

    /// Time since the start \[s\].
    pub fn time(&self) -> f64 {
        self.equipment.time()
    }

    /// Control period \[s\].
    pub fn period(&self) -> f64 {
        self.equipment.period()
    }

    /// Lifts the whole boom by an angle \[rad\] with the oil in both chambers locked in, so that it
    /// will drop onto its cylinder.
    ///
    /// # Errors
    ///
    /// [`SimulationError`] when the lifted state is not valid.
    pub fn lift(&mut self, angle: f64) -> Result<(), SimulationError> {
        self.plant.lift(angle)?;
        self.outputs = self.plant.outputs();
        Ok(())
    }

    /// Hangs another payload \[kg\] on the boom, at the same place.
    ///
    /// # Errors
    ///
    /// [`PlantError`] when there is no crane with such a payload.
    pub fn set_payload(&mut self, mass: f64) -> Result<(), PlantError> {
        let heavier = self.equipment.with_payload(mass);
        self.plant.set_parameters(&heavier)?;
        if let Some(shift) = self.equipment.dissolved() {
            self.plant.set_dissolved_air(shift);
        }
        Ok(())
    }

    /// Goes on as another crane of the same number of segments: after a line burst, say.
    ///
    /// # Errors
    ///
    /// [`PlantError`] when there is no such crane.
    pub fn set_description(&mut self, description: &Description) -> Result<(), PlantError> {
        let changed = self.equipment.with_description(description);
        self.plant.set_parameters(&changed)?;
        if let Some(shift) = self.equipment.dissolved() {
            self.plant.set_dissolved_air(shift);
        }
        Ok(())
    }

    /// One control period under a command.
    ///
    /// # Errors
    ///
    /// [`SimulationError`] when the crane leaves what the model holds for.
    pub fn advance(&mut self, command: &AxisCommand<f64>) -> Result<(), SimulationError> {
        let Some(command) = self.equipment.begin(command) else {
            return Err(SimulationError::Input { time: self.time() });
        };
        if self.equipment.is_steady() {
            self.plant.advance(&self.equipment.input(), self.steps)?;
            self.outputs = self.plant.outputs();
        } else {
            for _ in 0..self.steps {
                let input = self.equipment.step(&command, &self.outputs, self.plant.step());
                self.plant.advance(&input, 1)?;
                self.outputs = self.plant.outputs();
                self.equipment.see(&self.outputs);
            }
        }
        if self.equipment.slow_is_due() {
            let losses = self.plant.power(&self.equipment.input()).losses();
            if let Some(warmer) = self.equipment.warm(losses, &self.outputs) {
                // the number of segments is what it was, and so the type has room for them
                self.plant.set_parameters(&warmer).expect("as many segments as at the start");
            }
            if let Some(shift) = self.equipment.dissolve(&self.outputs) {
                self.plant.set_dissolved_air(shift);
            }
        }
        self.equipment.end(&self.outputs);
        Ok(())
    }
}
