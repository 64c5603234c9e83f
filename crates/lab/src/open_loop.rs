//! Simulation feedforward in open loop: a simulated crane is led along, and the machine is told its motor speed and not looked at.

use crate::following::seen;
use crate::rehearsal::{Beginning, Rehearsal};
use crate::scenario::Course;
use crate::{LabError, Plant, plant};
use hydroboom_control::{FollowingMemory, Known, Learner, ModelFollowing, Reference};
use hydroboom_description::Description;
use hydroboom_design::{informed, model_following, schedule};
use hydroboom_model::{Input, Scheme};
use hydroboom_virtual_crane::{Command, VirtualCrane};

/// A model, and what is known of the machine beyond it.
pub struct OpenLoop {
    /// The model with that in it.
    informed: Description,
    leads: Leads,
}

/// What leads the simulated crane.
enum Leads {
    StateFeedback(Box<ModelFollowing<f64>>),
    /// All of model following.
    Rehearsal(Box<Beginning>),
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
        let leads = Leads::StateFeedback(Box::new(model_following(&informed)?));
        Ok(Self { informed, leads })
    }

    /// All of model following leads a model of the machine, with what it has learned of the machine itself.
    pub(crate) fn rehearsed(model: &Description, learner: &Learner, machine: Description) -> Self {
        let beginning = Beginning { model: model.clone(), learner: *learner, told: Vec::new() };
        Self { informed: machine, leads: Leads::Rehearsal(Box::new(beginning)) }
    }

    /// The same straight on, for a machine that has been told as much since it rested where the course begins.
    pub(crate) fn straight_on(mut self, told: &[Command<f64>]) -> Self {
        if let Leads::Rehearsal(beginning) = &mut self.leads {
            beginning.told = told.to_vec();
        }
        self
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
        self.errors_from(&mut at_rest(crane, course)?, course)
    }

    /// The same of a machine in whatever state it is.
    ///
    /// # Errors
    ///
    /// [`LabError`] when the simulated crane cannot be built, or either leaves what the model holds for.
    pub fn errors_from(
        &self,
        machine: &mut VirtualCrane,
        course: &dyn Course,
    ) -> Result<Vec<f64>, LabError> {
        let (start, stroke) = (course.reference(0.0).position, machine.reading().stroke);
        let mut simulated = self.simulated(start, stroke)?;
        let period = self.informed.numbers.control_period;
        let periods = (course.duration() / period).round() as u64;
        let mut errors = Vec::with_capacity(periods as usize + 1);
        for k in 0..=periods {
            let ahead = |after: f64| course.reference(k as f64 * period + after);
            errors.push(machine.reading().stroke - ahead(0.0).position);
            let motor_speed = simulated.speed(&ahead, course.speed())?;
            let command = Command { motor_speed, holding_valve: 1.0 };
            machine.advance(&command).map_err(LabError::during("open loop"))?;
        }
        Ok(errors)
    }

    /// The simulated crane of a machine that is read to be at `stroke` \[m\], for a course that begins at `start` \[m\].
    fn simulated(&self, start: f64, stroke: f64) -> Result<Simulated, LabError> {
        Ok(match &self.leads {
            Leads::StateFeedback(law) => {
                Simulated::Led(Box::new(Led::new(&self.informed, law, start)?))
            }
            Leads::Rehearsal(beginning) => {
                let rehearsal = Rehearsal::new(beginning, &self.informed, start, stroke)?;
                Simulated::Rehearsed(Box::new(rehearsal))
            }
        })
    }
}

/// A crane that has long been at rest where a course begins.
pub(crate) fn at_rest(crane: &Description, course: &dyn Course) -> Result<VirtualCrane, LabError> {
    Ok(VirtualCrane::new(crane, &crane.start(course.reference(0.0).position))?)
}

/// The simulated crane in motion.
enum Simulated {
    Led(Box<Led>),
    Rehearsed(Box<Rehearsal>),
}

impl Simulated {
    /// Motor speed \[rev/s\] for the coming period, in which it moves on. `ahead` is where the reference is so many seconds from now,
    /// `fastest` its largest velocity \[m/s\].
    fn speed(
        &mut self,
        ahead: &dyn Fn(f64) -> Reference<f64>,
        fastest: f64,
    ) -> Result<f64, LabError> {
        match self {
            Self::Led(led) => led.speed(ahead, fastest),
            Self::Rehearsed(rehearsal) => rehearsal.speed(ahead, fastest),
        }
    }
}

/// Led by state feedback.
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
        ahead: &dyn Fn(f64) -> Reference<f64>,
        fastest: f64,
    ) -> Result<f64, LabError> {
        let reference = self.law.foreseen(ahead, fastest);
        let pump_speed = self.law.update(&mut self.memory, &reference, &seen(self.plant.as_ref()));
        let input = Input { pump_speed, holding_valve: 1.0 };
        self.plant.advance(&input, 1).map_err(LabError::during("the simulated crane"))?;
        Ok(pump_speed)
    }
}
