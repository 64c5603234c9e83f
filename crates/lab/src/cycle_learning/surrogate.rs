//! Surrogate of a machine: the identified model behind a delayed drive, with ideal sensors.

use super::delayed_drive::DelayedDrive;
use super::record::Record;
use crate::{LabError, Plant, plant};
use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::AxisSignals;
use hydroboom_description::Description;
use hydroboom_model::{Input, Scheme, SimulationError};

/// A model with its drive, without noise.
pub(crate) struct Surrogate {
    plant: Box<dyn Plant>,
    motor: DelayedDrive,
}

impl Clone for Surrogate {
    fn clone(&self) -> Self {
        Self { plant: self.plant.copied(), motor: self.motor.clone() }
    }
}

impl Surrogate {
    /// At rest with the piston at `stroke` \[m\]; its drive's total delay is `estimator.drive_lag_ms`.
    ///
    /// The published scheme chatters at the load-holding valves and loses oil by it where that is soft, up to 0.7 % of what is pumped: implicit steps do
    /// not.
    ///
    /// # Errors
    ///
    /// [`LabError`] when it has no rest there.
    pub(crate) fn new(model: &Description, stroke: f64) -> Result<Self, LabError> {
        let motor = DelayedDrive::new(&model.numbers);
        let plant = plant(model, &model.start(stroke), Scheme::Implicit, motor.period())?;
        Ok(Self { plant, motor })
    }

    /// The same without the drive's dead time from now on; its lag stays.
    pub(crate) fn without_dead_time(self) -> Self {
        Self { motor: self.motor.without_dead_time(), ..self }
    }

    /// Its motor.
    pub(crate) fn motor(&self) -> &DelayedDrive {
        &self.motor
    }

    /// Its signals.
    pub(crate) fn signals(&self) -> AxisSignals<f64> {
        let outputs = self.plant.outputs();
        AxisSignals {
            stroke: outputs.stroke,
            pressure_pump_a: outputs.pressure_pump_a,
            pressure_a: outputs.pressure_a,
            pressure_b: outputs.pressure_b,
            pressure_pump_b: outputs.pressure_pump_b,
            pressure_accumulator: outputs.pressure_accumulator,
            motor_speed: self.motor.speed(),
        }
    }

    /// A control period under a command.
    ///
    /// # Errors
    ///
    /// [`SimulationError`] when it leaves what the model holds for.
    pub(crate) fn advance(&mut self, command: &AxisCommand<f64>) -> Result<(), SimulationError> {
        let pump_speed = self.motor.advance(command.motor_speed);
        self.plant.advance(&Input { pump_speed, holding_valve: command.holding_valve }, 1)
    }

    /// Runs a cycle under commands; what it did.
    ///
    /// # Errors
    ///
    /// [`LabError`] when it leaves what the model holds for.
    pub(crate) fn run(mut self, commands: &[AxisCommand<f64>]) -> Result<Record, LabError> {
        let mut record = Record::new(self.motor.period());
        for command in commands {
            record.push(*command, self.signals());
            self.advance(command).map_err(LabError::during("the cycle on the identified model"))?;
        }
        Ok(record)
    }
}
