//! Batch simulation of several virtual cranes, with their plants in SIMD lanes.

use crate::equipment::{Equipment, Stepping};
use crate::signals::Truth;
use hydroboom_control::command::AxisCommand;
use hydroboom_control::measurement::{AxisSignals, Measurement};
use hydroboom_description::Description;
use hydroboom_model::{Outputs, Scheme, SimulationError, Start};
use hydroboom_plant::{PlantError, SideBySide};

/// A batch of `W` virtual cranes with the same structure. Each gives the results of a single
/// [`VirtualCrane`](crate::VirtualCrane), to the last bit. A `lane` is the index of a crane, 0 to `W` − 1; a larger
/// one panics.
pub struct Fleet<const W: usize> {
    plants: SideBySide<W>,
    outputs: [Outputs<f64>; W],
    /// Integration steps in a control period.
    steps: u32,
    equipment: [Equipment; W],
    stopped: [Option<SimulationError>; W],
}

impl<const W: usize> Fleet<W> {
    /// Cranes in equilibrium. `None` if they differ in structure or step size, or do not use the implicit scheme; such
    /// cranes must be simulated one by one.
    ///
    /// # Errors
    ///
    /// [`PlantError::Build`] if a description gives no model, or no equilibrium at its start.
    pub fn new(
        descriptions: &[Description; W],
        starts: &[Start; W],
    ) -> Result<Option<Self>, PlantError> {
        let stepping = Stepping::of(&descriptions[0]);
        let alike = |d: &Description| {
            Stepping::of(d) == stepping
                && d.numbers.control_period == descriptions[0].numbers.control_period
        };
        if stepping.scheme != Scheme::Implicit || !descriptions.iter().all(alike) {
            return Ok(None);
        }
        let warmed = descriptions.each_ref().map(Equipment::warmed);
        let Some(mut plants) = SideBySide::new(&warmed, starts, stepping.step)? else {
            return Ok(None);
        };
        let outputs = plants.outputs();
        let equipment: [Equipment; W] = std::array::from_fn(|lane| {
            let (description, start) = (&descriptions[lane], &starts[lane]);
            Equipment::new(description, start, &outputs[lane], stepping.step)
        });
        if !plants.set_dissolved_air(equipment.each_ref().map(Equipment::dissolved)) {
            return Ok(None);
        }
        let outputs = plants.outputs();
        let steps = stepping.count;
        Ok(Some(Self { plants, outputs, steps, equipment, stopped: [None; W] }))
    }

    /// Measured signals of one crane in SI units, speeds in rev/s, as they have arrived at its controller.
    pub fn signals(&self, lane: usize) -> AxisSignals<f64> {
        self.equipment[lane].signals()
    }

    /// Measurement that has arrived at the controller of one crane: signals, sequence number and sampling time.
    pub fn measurement(&self, lane: usize) -> Measurement {
        self.equipment[lane].measurement()
    }

    /// True quantities of one crane, without sensor errors and delay.
    pub fn truth(&self, lane: usize) -> Truth {
        self.equipment[lane].truth(&self.outputs[lane])
    }

    /// Error that has stopped a crane; `None` while it runs. A stopped crane keeps its last valid state.
    pub fn stopped(&self, lane: usize) -> Option<SimulationError> {
        self.stopped[lane].or(self.plants.stopped(lane))
    }

    /// Replaces the payload \[kg\] of one crane; its position on the boom stays.
    ///
    /// # Errors
    ///
    /// [`PlantError::Build`] if no crane can be built with this payload.
    pub fn set_payload(&mut self, lane: usize, mass: f64) -> Result<(), PlantError> {
        let heavier = self.equipment[lane].with_payload(mass);
        self.plants.set_parameters(lane, &heavier, self.equipment[lane].dissolved())
    }

    /// Simulates one control period, each crane under its own command.
    pub fn advance(&mut self, commands: &[AxisCommand<f64>; W]) {
        let still = AxisCommand { motor_speed: 0.0, holding_valve: 0.0 };
        let commands: [AxisCommand<f64>; W] = std::array::from_fn(|lane| {
            let time = self.equipment[lane].time();
            self.equipment[lane].begin(&commands[lane]).unwrap_or_else(|| {
                self.stopped[lane].get_or_insert(SimulationError::Input { time });
                still
            })
        });
        for _ in 0..self.steps {
            let step = self.plants.step();
            let inputs = std::array::from_fn(|lane| {
                self.equipment[lane].step(&commands[lane], &self.outputs[lane], step)
            });
            self.plants.advance(&inputs);
            self.outputs = self.plants.outputs();
            for (equipment, outputs) in self.equipment.iter_mut().zip(&self.outputs) {
                equipment.see(outputs);
            }
        }
        if self.equipment[0].slow_is_due() {
            self.update_slow_states();
        }
        for (equipment, outputs) in self.equipment.iter_mut().zip(&self.outputs) {
            equipment.end(outputs);
        }
    }

    /// Updates the slow states of every crane: oil temperature and dissolved air.
    fn update_slow_states(&mut self) {
        let mut shifts = [None; W];
        for lane in 0..W {
            let (equipment, outputs) = (&mut self.equipment[lane], &self.outputs[lane]);
            let losses = self.plants.losses(lane, &equipment.input());
            let warmer = equipment.warm(losses, outputs);
            shifts[lane] = equipment.dissolve(outputs);
            if let Some(warmer) = warmer {
                // only parameter values have changed, within the range that gave a model before
                self.plants
                    .set_parameters(lane, &warmer, shifts[lane])
                    .expect("as many segments as at the start");
            }
        }
        self.plants.set_dissolved_air(shifts);
    }
}
