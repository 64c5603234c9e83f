//! A model in a machine's place: told what the machine is told, as late as the machine hears it, and read as the machine is.

use crate::{LabError, Plant, plant};
use hydroboom_control::{Command, Measured, Reading};
use hydroboom_description::Description;
use hydroboom_model::{Input, Scheme, SimulationError};

/// A model that stands in for a machine, without noise.
pub(crate) struct StandIn {
    plant: Box<dyn Plant>,
    /// Control period \[s\].
    period: f64,
    /// Motor speeds that it was told \[rev/s\], before the first period for as long as it is late, too.
    told: Vec<f64>,
    /// How late its motor is, in whole control periods and a part of one.
    late: (usize, f64),
}

impl Clone for StandIn {
    fn clone(&self) -> Self {
        Self { plant: self.plant.copied(), told: self.told.clone(), ..*self }
    }
}

impl StandIn {
    /// The model as late as its `following.lead_ms`, at rest with the piston at `stroke` \[m\].
    ///
    /// The published scheme chatters at the load-holding valves and loses oil by it where that is soft, up to 0.7 % of what is pumped: implicit steps do
    /// not.
    ///
    /// # Errors
    ///
    /// [`LabError`] when it has no rest there.
    pub(crate) fn new(model: &Description, stroke: f64) -> Result<Self, LabError> {
        let period = model.numbers.control_period;
        let plant = plant(model, &model.start(stroke), Scheme::Implicit, period)?;
        let prompt = Self { plant, period, told: Vec::new(), late: (0, 0.0) };
        Ok(prompt.late_by(model.numbers.following_lead))
    }

    /// The same with a motor that from now on is late by so much \[s\].
    pub(crate) fn late_by(mut self, late: f64) -> Self {
        let late = late / self.period;
        self.late = (late as usize, late.fract());
        let missing = (self.late.0 + 2).saturating_sub(self.told.len());
        self.told.splice(0..0, std::iter::repeat_n(0.0, missing));
        self
    }

    /// Motor speed \[rev/s\] by now.
    fn motor_speed(&self) -> f64 {
        let (whole, part) = self.late;
        let last = self.told.len() - 1 - whole;
        let [after, before] = [self.told[last], self.told[last - 1]];
        after + part * (before - after)
    }

    /// What would be read of it.
    pub(crate) fn reading(&self) -> Reading<f64> {
        let outputs = self.plant.outputs();
        Reading {
            stroke: outputs.stroke,
            pressure_pump_a: outputs.pressure_pump_a,
            pressure_a: outputs.pressure_a,
            pressure_b: outputs.pressure_b,
            pressure_pump_b: outputs.pressure_pump_b,
            pressure_accumulator: outputs.pressure_accumulator,
            motor_speed: self.motor_speed(),
        }
    }

    /// What the benchmark controller would make of it.
    pub(crate) fn measured(&self) -> Measured<f64> {
        Measured { stroke: self.plant.outputs().stroke, load_pressure: self.plant.load_pressure() }
    }

    /// A control period under a command.
    ///
    /// # Errors
    ///
    /// [`SimulationError`] when it leaves what the model holds for.
    pub(crate) fn advance(&mut self, command: &Command<f64>) -> Result<(), SimulationError> {
        self.told.push(command.motor_speed);
        let input = Input { pump_speed: self.motor_speed(), holding_valve: command.holding_valve };
        self.plant.advance(&input, 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_turns_as_late_as_it_is_said_to_be() {
        let mut model = Description::uia_single_boom().unwrap();
        model.numbers.following_lead = 2.25 * model.numbers.control_period;
        let mut stand_in = StandIn::new(&model, 0.2).unwrap();
        let mut turned = Vec::new();
        for k in 0..10 {
            let command = Command { motor_speed: f64::from(k), holding_valve: 1.0 };
            stand_in.advance(&command).unwrap();
            turned.push(stand_in.reading().motor_speed);
        }
        for (k, turned) in turned.into_iter().enumerate() {
            let expected = (k as f64 - 2.25).max(0.0);
            assert!((turned - expected).abs() < 1e-12, "period {k}: {turned} for {expected}");
        }
        // told 9 last: what it turns at is what it was told then, whether that was by a later motor or not
        let later = stand_in.late_by(4.0 * model.numbers.control_period);
        assert!((later.reading().motor_speed - 5.0).abs() < 1e-12);
        let prompt = later.late_by(0.5 * model.numbers.control_period);
        assert!((prompt.reading().motor_speed - 8.5).abs() < 1e-12);
    }
}
