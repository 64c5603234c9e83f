//! Simulation feedforward in open loop: a simulated crane is led along, and the machine is told its motor speed and not looked at.

use crate::closed_loop::scenario::Course;
use crate::closed_loop::simulated_crane::axis_state;
use crate::{LabError, Plant, plant};
use hydroboom_control::command::AxisCommand;
use hydroboom_control::learner::Known;
use hydroboom_control::model_following::{FollowingMemory, ModelFollowing};
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_description::Description;
use hydroboom_design::{informed, model_following, schedule};
use hydroboom_model::{Input, Scheme};
use hydroboom_virtual_crane::VirtualCrane;

/// A model, and what is known of the machine beyond it.
pub struct OpenLoop {
    /// The model with that in it.
    informed: Description,
    law: ModelFollowing<f64>,
}

impl OpenLoop {
    /// State feedback leads the simulated crane. It is designed for the model as it is known by now: one that reckons with other friction than the simulated
    /// crane has leads it astray on soft oil, by millimetres.
    ///
    /// # Errors
    ///
    /// [`LabError`] when none can be designed for the model.
    pub fn new(model: &Description, known: &Known) -> Result<Self, LabError> {
        let informed = informed(model, &schedule(model)?, known);
        let law = model_following(&informed)?;
        Ok(Self { informed, law })
    }

    /// The model with what is known of the machine in it: payload, friction, oil, the pump's flow, slip and leakage, how late its motor is.
    pub fn informed(&self) -> &Description {
        &self.informed
    }

    /// Tracking errors \[m\] of a crane along a course from its rest, one each control period.
    ///
    /// # Errors
    ///
    /// [`LabError`] when either crane cannot be built or leaves what the model holds for.
    pub fn errors(&self, crane: &Description, course: &dyn Course) -> Result<Vec<f64>, LabError> {
        let mut machine = at_rest(crane, course)?;
        let mut led = Led::new(&self.informed, &self.law, course.reference(0.0).position)?;
        let period = self.informed.numbers.control_period;
        let periods = (course.duration() / period).round() as u64;
        let mut errors = Vec::with_capacity(periods as usize + 1);
        for k in 0..=periods {
            let ahead = |after: f64| course.reference(k as f64 * period + after);
            errors.push(machine.signals().stroke - ahead(0.0).position);
            let motor_speed = led.speed(&ahead, course.speed())?;
            let command = AxisCommand { motor_speed, holding_valve: 1.0 };
            machine.advance(&command).map_err(LabError::during("open loop"))?;
        }
        Ok(errors)
    }
}

/// A crane that has long been at rest where a course begins.
pub(crate) fn at_rest(crane: &Description, course: &dyn Course) -> Result<VirtualCrane, LabError> {
    Ok(VirtualCrane::new(crane, &crane.start(course.reference(0.0).position))?)
}

/// The simulated crane, led by state feedback.
struct Led {
    law: ModelFollowing<f64>,
    memory: FollowingMemory<f64>,
    plant: Box<dyn Plant>,
}

impl Led {
    fn new(
        informed: &Description,
        law: &ModelFollowing<f64>,
        start: f64,
    ) -> Result<Self, LabError> {
        // the published scheme chatters at the load-holding valves and loses oil by it where that is soft: up to 0.7 % of what is pumped
        let step = informed.numbers.control_period;
        let plant = plant(informed, &informed.start(start), Scheme::Implicit, step)?;
        Ok(Self { law: *law, memory: law.start(), plant })
    }

    /// Motor speed \[rev/s\] for the coming period, in which it moves on. `ahead` is where the reference is so many seconds from now,
    /// `fastest` its largest velocity \[m/s\].
    fn speed(
        &mut self,
        ahead: &dyn Fn(f64) -> SetPoint<f64>,
        fastest: f64,
    ) -> Result<f64, LabError> {
        let reference = self.law.foreseen(ahead, fastest);
        let pump_speed =
            self.law.update(&mut self.memory, &reference, &axis_state(self.plant.as_ref()));
        let input = Input { pump_speed, holding_valve: 1.0 };
        self.plant.advance(&input, 1).map_err(LabError::during("the simulated crane"))?;
        Ok(pump_speed)
    }
}
