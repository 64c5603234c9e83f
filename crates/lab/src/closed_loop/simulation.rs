//! A strategy, or what it is compared with, at work on virtual cranes, one by one or side by side.

use crate::baselines::{Shown, Steers, baseline};
use crate::closed_loop::controller_choice::ControllerChoice;
use crate::closed_loop::sample::Sample;
use crate::closed_loop::scenario::{Course, due};
use crate::following::Following;
use crate::{LabError, Plant, plant};
use hydroboom_control::command::AxisCommand;
use hydroboom_control::feedback::benchmark::{Benchmark, BenchmarkInput, BenchmarkMemory};
use hydroboom_control::measurement::AxisSignals;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_model::{Input, Scheme, SimulationError};
use hydroboom_virtual_crane::{Fleet, VirtualCrane};

/// Cranes that are simulated side by side.
pub const WIDTH: usize = 4;

/// What drives the motor before anything has been measured. It knows the model and the course only,
/// and so is the same for every crane.
pub(crate) struct Feedforward {
    controller: Benchmark<f64>,
    simulated: Option<Simulated>,
}

/// The simulated crane beside the machine, under the benchmark controller.
struct Simulated {
    plant: Box<dyn Plant>,
    memory: BenchmarkMemory<f64>,
    motor: f64,
    /// Steps in a control period.
    count: u32,
}

impl Feedforward {
    pub(crate) fn new(
        model: &Description,
        strategy: Strategy,
        start: f64,
    ) -> Result<Self, LabError> {
        let controller = model.benchmark();
        let simulated = match strategy.simulates() {
            true => {
                let step = model.numbers.simulation_period;
                let plant = plant(model, &model.start(start), Scheme::Published, step)?;
                let count = (controller.period / step).round() as u32;
                let memory = controller.start(&measured(plant.as_ref()));
                Some(Simulated { plant, memory, motor: 0.0, count })
            }
            false => None,
        };
        Ok(Self { controller, simulated })
    }

    /// What the simulated crane shows now; none where there is none.
    pub(crate) fn simulated(&self) -> Option<BenchmarkInput<f64>> {
        self.simulated.as_ref().map(|crane| measured(crane.plant.as_ref()))
    }

    /// Motor speed \[rev/s\] for the coming period; the simulated crane moves on with it.
    pub(crate) fn speed(&mut self, reference: &SetPoint<f64>) -> Result<f64, SimulationError> {
        let controller = &self.controller;
        let velocity_feedforward = controller.velocity_feedforward(reference);
        let Some(crane) = &mut self.simulated else { return Ok(velocity_feedforward) };
        let seen = measured(crane.plant.as_ref());
        let wanted = controller.update(&mut crane.memory, reference, &seen, velocity_feedforward);
        crane.motor = controller.limits.follow(crane.motor, wanted, controller.period);
        let input = Input { pump_speed: crane.motor, holding_valve: 1.0 };
        crane.plant.advance(&input, crane.count)?;
        Ok(crane.motor)
    }
}

fn measured(plant: &dyn Plant) -> BenchmarkInput<f64> {
    BenchmarkInput { stroke: plant.outputs().stroke, load_pressure: plant.load_pressure() }
}

/// What is added once the machine has been looked at.
pub(crate) struct Feedback {
    controller: Benchmark<f64>,
    memory: BenchmarkMemory<f64>,
    measures: bool,
}

impl Feedback {
    pub(crate) fn new(model: &Description, strategy: Strategy, seen: &BenchmarkInput<f64>) -> Self {
        let controller = model.benchmark();
        let memory = controller.start(seen);
        Self { controller, memory, measures: strategy.measures() }
    }

    pub(crate) fn command(
        &mut self,
        reference: &SetPoint<f64>,
        seen: &BenchmarkInput<f64>,
        feedforward: f64,
    ) -> AxisCommand<f64> {
        let motor_speed = match self.measures {
            true => self.controller.update(&mut self.memory, reference, seen, feedforward),
            false => feedforward,
        };
        AxisCommand { motor_speed, holding_valve: 1.0 }
    }
}

/// Rod-side area over piston area of a description's cylinder.
pub(crate) fn area_ratio(model: &Description) -> f64 {
    let cylinder = model.cylinder();
    cylinder.rod_side_area / cylinder.piston_area
}

/// A controller that closes the loop.
enum Controller {
    Published(Box<(Feedforward, Feedback)>),
    Following(Box<Following>),
    Baseline(Box<dyn Steers>),
}

impl Controller {
    fn new(
        model: &Description,
        choice: ControllerChoice,
        start: f64,
        reading: &AxisSignals<f64>,
        measured: &BenchmarkInput<f64>,
    ) -> Result<Self, LabError> {
        let strategy = match choice {
            ControllerChoice::Strategy(strategy) => strategy,
            ControllerChoice::Baseline(which) => {
                let baseline = baseline(which, model, measured)?;
                return Ok(Self::Baseline(baseline));
            }
        };
        Ok(match strategy.follows() {
            true => Self::Following(Box::new(Following::new(model, reading, start)?)),
            false => Self::Published(Box::new((
                Feedforward::new(model, strategy, start)?,
                Feedback::new(model, strategy, measured),
            ))),
        })
    }

    /// The command for the coming period.
    fn command(&mut self, shown: &Shown<'_>) -> Result<AxisCommand<f64>, LabError> {
        let Shown { reference, ahead, speed, reading, measured } = shown;
        match self {
            Self::Following(following) => following.command(ahead, *speed, reading),
            Self::Baseline(baseline) => {
                Ok(AxisCommand { motor_speed: baseline.speed(shown), holding_valve: 1.0 })
            }
            Self::Published(pair) => {
                let (feedforward, feedback) = pair.as_mut();
                let speed = feedforward
                    .speed(reference)
                    .map_err(LabError::during("the simulated crane"))?;
                Ok(feedback.command(reference, measured, speed))
            }
        }
    }
}

/// One controller on one crane along a course, each control period shown to `observe`, which may stop
/// it.
///
/// # Errors
///
/// [`LabError`] when either crane cannot be built or leaves what the model holds for, or from
/// `observe`.
pub fn simulate_closed_loop(
    model: &Description,
    crane: &Description,
    choice: impl Into<ControllerChoice>,
    course: &dyn Course,
    mut observe: impl FnMut(&Sample) -> Result<(), LabError>,
) -> Result<(), LabError> {
    let choice = choice.into();
    let start = course.reference(0.0).position;
    let mut crane = VirtualCrane::new(crane, &crane.start(start))?;
    let area_ratio = area_ratio(model);
    let of = |signals: &AxisSignals<f64>| BenchmarkInput::of(signals, area_ratio);
    let signals = crane.signals();
    let mut controller = Controller::new(model, choice, start, &signals, &of(&signals))?;
    let period = model.numbers.control_period;
    let periods = (course.duration() / period).round() as u64;
    let mut loads = course.loads();
    let during = format!("{}, {}", choice.name(), course.name());

    for k in 0..=periods {
        let time = k as f64 * period;
        if let Some(mass) = due(&mut loads, time) {
            crane.set_payload(mass)?;
        }
        let reference = course.reference(time);
        let ahead = |after: f64| course.reference(time + after);
        let reading = crane.signals();
        let measured = of(&reading);
        let speed = course.speed();
        let shown = Shown { reference, ahead: &ahead, speed, reading, measured };
        let command = controller.command(&shown)?;
        let truth = crane.truth();
        observe(&Sample { time, reference, reading, truth, command })?;
        if k < periods {
            crane.advance(&command).map_err(LabError::during(&during))?;
        }
    }
    Ok(())
}

/// A crane under a controller along a course.
#[derive(Clone, Copy)]
pub struct Case<'a> {
    /// The crane.
    pub crane: &'a Description,
    /// The controller.
    pub controller: ControllerChoice,
    /// The course; all that run together have the same reference, and each its own loads.
    pub course: &'a (dyn Course + 'a),
}

/// Closed loops of any number of cases, [`WIDTH`] of them side by side at a time; how each ended.
pub fn simulate_cases(
    model: &Description,
    cases: &[Case<'_>],
    mut observe: impl FnMut(usize, &Sample),
) -> Vec<Result<(), LabError>> {
    let mut ends = Vec::with_capacity(cases.len());
    for group in cases.chunks(WIDTH) {
        let done = ends.len();
        match <&[Case<'_>; WIDTH]>::try_from(group) {
            Ok(whole) => {
                ends.extend(simulate_side_by_side(model, whole, |k, sample| {
                    observe(done + k, sample)
                }));
            }
            Err(_) => ends.extend(group.iter().enumerate().map(|(k, lane)| {
                simulate_closed_loop(model, lane.crane, lane.controller, lane.course, |sample| {
                    observe(done + k, sample);
                    Ok(())
                })
            })),
        }
    }
    ends
}

/// Closed loops side by side, each control period of each shown to `observe`; how each ended. They
/// do what each would do alone, which is also how they are run if they are of different make.
pub fn simulate_side_by_side(
    model: &Description,
    cases: &[Case<'_>; WIDTH],
    mut observe: impl FnMut(usize, &Sample),
) -> [Result<(), LabError>; WIDTH] {
    match side_by_side(model, cases, &mut observe) {
        Some(ends) => ends,
        None => {
            let mut lane = 0..;
            cases.map(|Case { crane, controller, course }| {
                let lane = lane.next().unwrap_or_default();
                simulate_closed_loop(model, crane, controller, course, |sample| {
                    observe(lane, sample);
                    Ok(())
                })
            })
        }
    }
}

/// How each ended; none where they cannot be run side by side.
fn side_by_side(
    model: &Description,
    cases: &[Case<'_>; WIDTH],
    observe: &mut dyn FnMut(usize, &Sample),
) -> Option<[Result<(), LabError>; WIDTH]> {
    let begins = cases.map(|lane| lane.course.reference(0.0).position);
    let cranes = cases.each_ref().map(|lane| lane.crane.clone());
    let starts = std::array::from_fn(|lane| cranes[lane].start(begins[lane]));
    // what is wrong with one of them is said where it is run alone
    let mut fleet = Fleet::new(&cranes, &starts).ok().flatten()?;
    let mut controllers = Vec::with_capacity(WIDTH);
    let area_ratio = area_ratio(model);
    let of = |signals: &AxisSignals<f64>| BenchmarkInput::of(signals, area_ratio);
    for (k, lane) in cases.iter().enumerate() {
        let reading = fleet.signals(k);
        let measured = of(&reading);
        controllers
            .push(Controller::new(model, lane.controller, begins[k], &reading, &measured).ok()?);
    }
    let period = model.numbers.control_period;
    let periods = cases.map(|lane| (lane.course.duration() / period).round() as u64);
    let last = periods.into_iter().max().unwrap_or_default();
    let mut loads = cases.map(|lane| lane.course.loads());
    let mut ends: [Result<(), LabError>; WIDTH] = std::array::from_fn(|_| Ok(()));

    for k in 0..=last {
        let time = k as f64 * period;
        let commands = std::array::from_fn(|lane| {
            if let Some(mass) = due(&mut loads[lane], time)
                && let Err(error) = fleet.set_payload(lane, mass)
                && ends[lane].is_ok()
            {
                ends[lane] = Err(error.into());
            }
            let reading = fleet.signals(lane);
            let measured = of(&reading);
            let still = AxisCommand { motor_speed: 0.0, holding_valve: 1.0 };
            let course = cases[lane].course;
            let reference = course.reference(time);
            let goes_on = ends[lane].is_ok() && k <= periods[lane];
            let command = match goes_on {
                true => {
                    let ahead = |after: f64| course.reference(time + after);
                    let speed = course.speed();
                    let shown = Shown { reference, ahead: &ahead, speed, reading, measured };
                    controllers[lane].command(&shown).unwrap_or_else(|error| {
                        ends[lane] = Err(error);
                        still
                    })
                }
                false => still,
            };
            if goes_on && ends[lane].is_ok() {
                let truth = fleet.truth(lane);
                observe(lane, &Sample { time, reference, reading, truth, command });
            }
            command
        });
        if k < last {
            fleet.advance(&commands);
            for (lane, end) in ends.iter_mut().enumerate() {
                let goes_on = k < periods[lane];
                if let (Some(error), Ok(()), true) = (fleet.stopped(lane), &end, goes_on) {
                    let Case { controller, course, .. } = cases[lane];
                    let during = format!("{}, {}", controller.name(), course.name());
                    *end = Err(LabError::during(&during)(error));
                }
            }
        }
    }
    Some(ends)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::closed_loop::scenario::CourseChoice;
    use hydroboom_control::strategy::Strategy;

    /// Courses of other shape and duration, each begun, led and ended as it is alone.
    #[test]
    fn each_crane_side_by_side_goes_its_own_course() {
        let model = Description::uia_single_boom().unwrap();
        let crane = Description::uia_virtual().unwrap();
        let courses = ["reversal", "small-moves", "reversal", "start-stop"]
            .map(|name| CourseChoice::Scenario(name.into()).of(&crane).unwrap());
        let controller = ControllerChoice::from(Strategy::BenchmarkClosedLoop);
        let cases =
            courses.each_ref().map(|c| Case { crane: &crane, controller, course: c.as_ref() });
        let mut together = [const { Vec::new() }; WIDTH];
        for end in
            simulate_cases(&model, &cases, |lane, sample| together[lane].push(sample.reading))
        {
            end.unwrap();
        }
        for (course, together) in courses.iter().zip(&together) {
            let mut alone = Vec::new();
            simulate_closed_loop(&model, &crane, controller, course.as_ref(), |sample| {
                alone.push(sample.reading);
                Ok(())
            })
            .unwrap();
            assert!(alone == *together, "{}", course.name());
        }
    }
}
