//! A model in a machine's place: told what the machine is told, as late as the machine hears it, and read as the machine is.

use crate::late_motor::LateMotor;
use crate::{LabError, Plant, plant};
use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::AxisSignals;
use hydroboom_description::Description;
use hydroboom_model::{Input, Outputs, Scheme, SimulationError};
use hydroboom_plant::SideBySide;

/// A model that stands in for a machine, without noise.
pub(crate) struct StandIn {
    model: Description,
    plant: Box<dyn Plant>,
    motor: LateMotor,
}

impl Clone for StandIn {
    fn clone(&self) -> Self {
        Self { model: self.model.clone(), plant: self.plant.copied(), motor: self.motor.clone() }
    }
}

impl StandIn {
    /// The model as late as its `estimator.drive_lag_ms`, at rest with the piston at `stroke` \[m\].
    ///
    /// The published scheme chatters at the load-holding valves and loses oil by it where that is soft, up to 0.7 % of what is pumped: implicit steps do
    /// not.
    ///
    /// # Errors
    ///
    /// [`LabError`] when it has no rest there.
    pub(crate) fn new(model: &Description, stroke: f64) -> Result<Self, LabError> {
        let motor = LateMotor::new(&model.numbers);
        let plant = plant(model, &model.start(stroke), Scheme::Implicit, motor.period())?;
        Ok(Self { model: model.clone(), plant, motor })
    }

    /// The same with a motor that from now on has the lag of its drive, and no dead time.
    pub(crate) fn without_dead_time(self) -> Self {
        Self { motor: self.motor.without_dead_time(), ..self }
    }

    /// Its motor.
    pub(crate) fn motor(&self) -> &LateMotor {
        &self.motor
    }

    /// What would be read of it.
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
        let pump_speed = self.motor.told(command.motor_speed);
        self.plant.advance(&Input { pump_speed, holding_valve: command.holding_valve }, 1)
    }
}

/// Several of them side by side in SIMD lanes: each goes where it would alone.
pub(crate) struct StandIns<const W: usize> {
    plants: SideBySide<W>,
    motors: [LateMotor; W],
}

impl<const W: usize> StandIns<W> {
    /// All at rest with the piston at `stroke` \[m\]. None where they differ in more than numbers, or are too finely divided: then they can only go one by
    /// one.
    ///
    /// # Errors
    ///
    /// [`LabError`] when one of them has no rest there.
    pub(crate) fn new(models: &[Description; W], stroke: f64) -> Result<Option<Self>, LabError> {
        let motors = models.each_ref().map(|model| LateMotor::new(&model.numbers));
        let starts = models.each_ref().map(|model| model.start(stroke));
        let plants = SideBySide::new(models, &starts, motors[0].period())?;
        Ok(plants.map(|plants| Self { plants, motors }))
    }

    /// All of them copies of one. None where it is too finely divided.
    ///
    /// # Errors
    ///
    /// [`LabError`] when there is no such model.
    pub(crate) fn copies(one: &StandIn) -> Result<Option<Self>, LabError> {
        let plants = SideBySide::copies(&one.model, one.plant.as_ref())?;
        let motors = std::array::from_fn(|_| one.motor.clone());
        Ok(plants.map(|plants| Self { plants, motors }))
    }

    /// What can be seen of each.
    pub(crate) fn outputs(&self) -> [Outputs<f64>; W] {
        self.plants.outputs()
    }

    /// Why one of them could not go on: it stays where it was.
    pub(crate) fn stopped(&self, lane: usize) -> Option<SimulationError> {
        self.plants.stopped(lane)
    }

    /// A control period, each under its own command.
    pub(crate) fn advance(&mut self, commands: &[AxisCommand<f64>; W]) {
        let input = |lane: usize| Input {
            pump_speed: self.motors[lane].told(commands[lane].motor_speed),
            holding_valve: commands[lane].holding_valve,
        };
        let inputs = std::array::from_fn(input);
        self.plants.advance(&inputs);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Up and down in turn, with leaps that no motor follows.
    fn command(k: usize, speed: f64) -> AxisCommand<f64> {
        let motor_speed = if k % 200 < 100 { speed } else { -speed };
        AxisCommand { motor_speed, holding_valve: 1.0 }
    }

    /// To the last digit.
    fn assert_together<const W: usize>(
        mut together: StandIns<W>,
        mut alone: [StandIn; W],
        speeds: [f64; W],
    ) {
        for k in 0..400 {
            let commands = speeds.map(|speed| command(k, speed));
            together.advance(&commands);
            let each = alone.iter_mut().zip(&commands);
            each.for_each(|(one, command)| one.advance(command).unwrap());
            let seen = alone.each_ref().map(|one| one.plant.outputs());
            assert_eq!(together.outputs(), seen, "period {k}");
        }
        assert!(alone[0].signals().stroke != alone[1].signals().stroke);
    }

    #[test]
    fn models_go_side_by_side_where_each_goes_alone() {
        let models = [0.9, 1.0].map(|flow_gain| {
            let mut model = Description::uia_single_boom().unwrap();
            model.numbers.flow_gain = flow_gain;
            model.numbers.tuning.estimator_drive_lag *= flow_gain;
            model
        });
        let together = StandIns::new(&models, 0.2).unwrap().unwrap();
        let alone = models.each_ref().map(|model| StandIn::new(model, 0.2).unwrap());
        assert_together(together, alone, [20.0, 20.0]);
    }

    #[test]
    fn copies_of_a_model_in_motion_go_on_as_it_does() {
        let model = Description::uia_single_boom().unwrap();
        let mut one = StandIn::new(&model, 0.2).unwrap();
        (0..150).for_each(|k| one.advance(&command(k, 30.0)).unwrap());
        let together = StandIns::copies(&one).unwrap().unwrap();
        assert_together(together, [one.clone(), one], [20.0, 19.0]);
    }
}
