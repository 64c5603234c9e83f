//! Model following on a virtual crane: the simulated crane beside it, and the controller.

use crate::closed_loop::simulated_crane::axis_state;
use crate::{LabError, Plant, plant};
use hydroboom_control::command::AxisCommand;
use hydroboom_control::deviation::Watched;
use hydroboom_control::feedback::benchmark::BenchmarkInput;
use hydroboom_control::follower::Follower;
use hydroboom_control::learner::{Conditions, Learner};
use hydroboom_control::measurement::AxisSignals;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_description::Description;
use hydroboom_design::{balances, schedule, under};
use hydroboom_model::{Input, Scheme, SimulationError};

/// Control periods between two looks at what was learned, of which the simulated crane takes some on.
const LOOK_EVERY: u64 = 20;

/// A controller with its simulated crane.
pub(crate) struct Following {
    description: Description,
    simulated: Box<dyn Plant>,
    follower: Follower,
    /// What the simulated crane is.
    taken: Conditions,
    /// Speed that the machine's motor was told \[rev/s\].
    told: f64,
    /// Steps of the simulation in a control period.
    count: u32,
    period: f64,
    periods: u64,
}

impl Following {
    /// At rest beside a machine, of which the model and what it reads are known.
    pub(crate) fn new(
        model: &Description,
        reading: &AxisSignals<f64>,
        start: f64,
    ) -> Result<Self, LabError> {
        let schedule = schedule(model)?;
        let balances = balances(model, &schedule);
        let follower = Follower::start(&schedule, &balances, reading, &measured(model, reading));
        Self::begun(model, follower, reading, start)
    }

    /// The same with what was learned before.
    pub(crate) fn resumed(
        model: &Description,
        learner: &Learner,
        reading: &AxisSignals<f64>,
        start: f64,
    ) -> Result<Self, LabError> {
        Self::begun(model, Follower::new(*learner), reading, start)
    }

    fn begun(
        model: &Description,
        mut follower: Follower,
        reading: &AxisSignals<f64>,
        start: f64,
    ) -> Result<Self, LabError> {
        let taken = follower.known().conditions();
        let mut description = model.clone();
        description.numbers = under(&taken, &model.numbers);
        let step = model.numbers.simulation_period;
        let simulated = plant(&description, &description.start(start), Scheme::Published, step)?;
        follower.begin(
            &Watched::of(&measured(model, reading), reading.motor_speed),
            &axis_state(simulated.as_ref()),
        );
        let count = (model.numbers.control_period / step).round() as u32;
        Ok(Self {
            description,
            simulated,
            follower,
            taken,
            told: 0.0,
            count,
            period: model.numbers.control_period,
            periods: 0,
        })
    }

    /// All that was learned, to go on with.
    pub(crate) fn learner(&self) -> &Learner {
        self.follower.learner()
    }

    /// The command for the coming period; the simulated crane moves on with it. `ahead` is where the reference is so many seconds from now, `speed`
    /// its largest \[m/s\].
    pub(crate) fn command(
        &mut self,
        ahead: &dyn Fn(f64) -> SetPoint<f64>,
        speed: f64,
        reading: &AxisSignals<f64>,
    ) -> Result<AxisCommand<f64>, LabError> {
        let seen = axis_state(self.simulated.as_ref());
        let measured = measured(&self.description, reading);
        let reference = self.follower.foreseen(ahead, speed);
        let [simulated, speed] =
            self.follower.period(self.told, &reference, &seen, reading, &measured);
        self.told = speed;
        self.periods += 1;
        let now = self.follower.known().conditions();
        if self.periods.is_multiple_of(LOOK_EVERY) && self.taken.differ(&now) {
            let time = LOOK_EVERY as f64 * self.period;
            self.taken = self.taken.towards(&now, time);
            self.description.numbers = under(&self.taken, &self.description.numbers);
            self.simulated.set_parameters(&self.description)?;
        }
        let input = Input { pump_speed: simulated, holding_valve: 1.0 };
        let stopped: fn(SimulationError) -> LabError =
            |error| LabError::during("the simulated crane")(error);
        self.simulated.advance(&input, self.count).map_err(stopped)?;
        Ok(AxisCommand { motor_speed: speed, holding_valve: 1.0 })
    }
}

/// What is measured of a machine that has the cylinder of the model.
fn measured(model: &Description, signals: &AxisSignals<f64>) -> BenchmarkInput<f64> {
    BenchmarkInput::of(signals, model.cylinder().area_ratio())
}
