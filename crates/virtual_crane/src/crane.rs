//! The virtual crane, advanced one control period at a time.

use crate::equipment::{Equipment, Stepping};
use crate::signals::Truth;
use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::{AxisSignals, Measurement};
use hydroboom_control::supervision::limits::ValveState;
use hydroboom_description::Description;
use hydroboom_model::{Outputs, SimulationError, Start};
use hydroboom_plant::{Plant, PlantError, plant};

/// Virtual crane: a simulated crane with drive, pump, valve, sensors and fieldbus. A clone continues from the same
/// state.
///
/// ```
/// use hydroboom_control::command::AxisCommand;
/// use hydroboom_description::Description;
/// use hydroboom_virtual_crane::VirtualCrane;
///
/// let description = Description::uia_virtual()?;
/// let mut crane = VirtualCrane::new(&description, &description.start(0.25))?;
/// let held = AxisCommand { motor_speed: 0.0, holding_valve: 0.0 };
/// for _ in 0..50 {
///     crane.advance(&held)?;
/// }
/// // with the load-holding valves shut the piston stays within a millimetre
/// assert!((crane.truth().outputs.stroke - 0.25).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct VirtualCrane {
    plant: Box<dyn Plant>,
    /// Current outputs of the plant.
    outputs: Outputs<f64>,
    /// Integration steps in a control period.
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
    /// Virtual crane in equilibrium at `start`. The 3/2 valve is energised unless the pump sides are without preload.
    ///
    /// # Errors
    ///
    /// [`PlantError::Build`] if the description gives no model or no equilibrium. [`PlantError::Stroke`] if the piston
    /// position is outside the stroke. [`PlantError::Simulation`] if the step does not suit the scheme.
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

    /// Removes the drive's dead time from now on; its lag remains.
    pub fn without_dead_time(mut self) -> Self {
        self.equipment.remove_dead_time();
        self
    }

    /// Measured signals in SI units, speeds in rev/s, as they have arrived at the controller over the fieldbus.
    pub fn signals(&self) -> AxisSignals<f64> {
        self.equipment.signals()
    }

    /// Measurement that has arrived at the controller: signals, sequence number and sampling time.
    pub fn measurement(&self) -> Measurement {
        self.equipment.measurement()
    }

    /// State of the load-holding valve by its position switch; `None` without a switch.
    pub fn valve(&self) -> Option<ValveState> {
        self.equipment.valve_state()
    }

    /// True quantities, without sensor errors and delay.
    pub fn truth(&self) -> Truth {
        self.equipment.truth(&self.outputs)
    }

    /// The plant model.
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

    /// Rotates the whole boom upwards by an angle \[rad\] with the oil in both chambers locked in; it then drops onto
    /// its cylinder.
    ///
    /// # Errors
    ///
    /// [`SimulationError::Invalid`] if the lifted state is outside the model's range of validity.
    pub fn lift(&mut self, angle: f64) -> Result<(), SimulationError> {
        self.plant.lift(angle)?;
        self.outputs = self.plant.outputs();
        Ok(())
    }

    /// Replaces the payload \[kg\]; its position on the boom stays.
    ///
    /// # Errors
    ///
    /// [`PlantError::Build`] if no crane can be built with this payload.
    pub fn set_payload(&mut self, mass: f64) -> Result<(), PlantError> {
        let heavier = self.equipment.with_payload(mass);
        self.plant.set_parameters(&heavier)?;
        if let Some(shift) = self.equipment.dissolved() {
            self.plant.set_dissolved_air(shift);
        }
        Ok(())
    }

    /// Replaces the description during the run, for example by one with a burst line. The number of segments must not
    /// change.
    ///
    /// # Errors
    ///
    /// [`PlantError::Build`] if no crane can be built from it.
    pub fn set_description(&mut self, description: &Description) -> Result<(), PlantError> {
        let changed = self.equipment.with_description(description);
        self.plant.set_parameters(&changed)?;
        if let Some(shift) = self.equipment.dissolved() {
            self.plant.set_dissolved_air(shift);
        }
        Ok(())
    }

    /// Simulates one control period under a command.
    ///
    /// # Errors
    ///
    /// [`SimulationError::Input`] if the command that arrives at the crane is not finite.
    /// [`SimulationError::Unsettled`] or [`SimulationError::Step`] if the scheme cannot take a step.
    /// [`SimulationError::Invalid`] if the state leaves the model's range of validity.
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
                // the number of segments is unchanged, so the plant's type fits
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
