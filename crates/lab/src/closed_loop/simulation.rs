//! Closed-loop simulation of strategies and baselines on virtual cranes, one by one or vectorised.

use crate::LabError;
use crate::closed_loop::controller_choice::ControllerChoice;
use crate::closed_loop::sample::Sample;
use crate::closed_loop::scenario::{Course, due};
use crate::closed_loop::simulated_crane::SimulatedCrane;
use hydroboom_control::command::{AxisCommand, Command};
use hydroboom_control::controller::Controller;
use hydroboom_control::measurement::Measurement;
use hydroboom_control::reference::preview::Preview;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_description::Description;
use hydroboom_design::scheduled_lqr::known_delay;
use hydroboom_virtual_crane::{Fleet, Truth, VirtualCrane};

/// Number of cranes that are simulated together in vector instructions.
pub const WIDTH: usize = 4;

/// Controller with its preview of the reference, and the simulated crane if it uses one.
pub(crate) struct Loop<C: ?Sized = dyn Controller> {
    /// Controller under test.
    pub controller: Box<C>,
    preview: Preview<f64>,
    simulated: Option<SimulatedCrane>,
}

/// Control period of a course.
#[derive(Clone, Copy)]
pub(crate) struct Now<'a> {
    /// Course of the reference and the load.
    pub course: &'a dyn Course,
    /// Control period \[s\].
    pub period: f64,
    /// Number of the control period since the start of the course, from 0.
    pub number: u64,
}

impl Now<'_> {
    /// Time of the course \[s\].
    fn time(&self) -> f64 {
        self.number as f64 * self.period
    }

    /// Set point at a time `after` \[s\] from now. For a whole number of periods it is bit-identical to
    /// that period's own set point.
    fn set_point(&self, after: f64) -> SetPoint<f64> {
        let periods = after / self.period;
        let whole = periods.round();
        self.course.reference(match (periods - whole).abs() < 1e-6 {
            true => (self.number as f64 + whole) * self.period,
            false => self.time() + after,
        })
    }
}

impl<C: Controller + ?Sized> Loop<C> {
    /// Starts with a machine at rest at the start of a course. The delays of measurement and command by the
    /// fieldbus \[cycles\] are those known to the controller.
    pub(crate) fn start(
        model: &Description,
        mut controller: Box<C>,
        delay_cycles: u32,
        course: &dyn Course,
        measurement: &Measurement,
    ) -> Result<Self, LabError> {
        let begin = Now { course, period: model.numbers.control_period, number: 0 };
        controller.start(measurement, delay_cycles);
        let simulated = match controller.status().simulated_motor_speeds {
            Some(_) => Some(SimulatedCrane::new(model, begin.set_point(0.0).position)?),
            None => None,
        };
        let preview = match course.is_known_ahead() {
            true => Preview::new(begin.period, |after| begin.set_point(after)),
            false => Preview::at_rest(begin.period, begin.set_point(0.0).position),
        };
        Ok(Self { controller, preview, simulated })
    }

    /// Computes the command for the coming period and advances the simulated crane by it.
    pub(crate) fn command(
        &mut self,
        now: Now<'_>,
        measurement: &Measurement,
    ) -> Result<Command, LabError> {
        let Self { controller, preview, simulated } = self;
        match now.course.is_known_ahead() {
            _ if now.number == 0 => {}
            true => preview.advance(|after| now.set_point(after)),
            false => preview.advance_without_preview(now.set_point(0.0)),
        }
        let state = simulated.as_ref().map(SimulatedCrane::state);
        let command = controller.update(measurement, preview, state.as_ref());
        let speeds = controller.status().simulated_motor_speeds;
        if let (Some(crane), Some([motor_speed])) = (simulated, speeds) {
            crane.advance(motor_speed)?;
        }
        Ok(command)
    }

    /// The control period after its command was computed; `truth` is the machine's state.
    fn sample(
        &self,
        now: Now<'_>,
        measurement: &Measurement,
        truth: Truth,
        load_changed: bool,
        command: AxisCommand<f64>,
    ) -> Sample {
        let time = now.time();
        Sample {
            time,
            reference: now.course.reference(time),
            signals: measurement.axes[0].signals,
            load_changed,
            truth,
            command,
            periods_without_solution: self.controller.status().periods_without_solution,
        }
    }
}

/// Loop with the selected controller, which takes the fieldbus delay from its own crane file.
fn chosen(
    model: &Description,
    choice: ControllerChoice,
    course: &dyn Course,
    measurement: &Measurement,
) -> Result<Loop, LabError> {
    Loop::start(model, choice.controller(model)?, known_delay(model), course, measurement)
}

/// Simulates one controller, designed for `model`, on a virtual crane along a course. `observe` receives each control
/// period; an error of it stops the simulation.
///
/// # Errors
///
/// - [`LabError::Plant`] if either crane has no state of rest, or cannot take the payload of a load change;
/// - [`LabError::Design`], [`LabError::NoBaseline`] or [`LabError::NoOscillation`] if the controller cannot be
///   designed: a reduced model, a Riccati equation or the shaper's mode has no solution;
/// - [`LabError::Simulation`] if a state leaves the model's range of validity;
/// - any error of `observe`.
pub fn simulate_closed_loop(
    model: &Description,
    crane: &Description,
    choice: impl Into<ControllerChoice>,
    course: &dyn Course,
    observe: impl FnMut(&Sample) -> Result<(), LabError>,
) -> Result<(), LabError> {
    let choice = choice.into();
    let controller = choice.controller(model)?;
    simulate_controller(model, crane, (choice.name(), controller), course, observe)
}

/// Simulates any [`Controller`], with its name for messages, on a virtual crane along a course. It is called once per
/// control period of the model's crane file, and knows the fieldbus delay of that file.
///
/// # Errors
///
/// See [`simulate_closed_loop`].
pub fn simulate_controller(
    model: &Description,
    crane: &Description,
    (name, controller): (&str, Box<dyn Controller>),
    course: &dyn Course,
    mut observe: impl FnMut(&Sample) -> Result<(), LabError>,
) -> Result<(), LabError> {
    let start = course.reference(0.0).position;
    let mut crane = VirtualCrane::new(crane, &crane.start(start))?;
    let delay = known_delay(model);
    let mut controlled = Loop::start(model, controller, delay, course, &crane.measurement())?;
    let period = model.numbers.control_period;
    let periods = (course.duration() / period).round() as u64;
    let mut loads = course.loads();
    let during = format!("{name}, {}", course.name());

    for number in 0..=periods {
        let now = Now { course, period, number };
        let load = due(&mut loads, now.time());
        if let Some(mass) = load {
            crane.set_payload(mass)?;
        }
        let measurement = crane.measurement();
        let [command] = controlled.command(now, &measurement)?.axes;
        let load_changed = load.is_some();
        observe(&controlled.sample(now, &measurement, crane.truth(), load_changed, command))?;
        if number < periods {
            crane.advance(&command).map_err(LabError::during(&during))?;
        }
    }
    Ok(())
}

/// One closed-loop simulation: virtual crane, controller and course.
#[derive(Clone, Copy)]
pub struct Case<'a> {
    /// Virtual crane that is controlled.
    pub crane: &'a Description,
    /// Controller under test.
    pub controller: ControllerChoice,
    /// Course. Cases that run together share the reference and have their own load changes.
    pub course: &'a (dyn Course + 'a),
}

/// Simulates closed loops, [`WIDTH`] at a time. `observe` receives the index of the case and each of its control
/// periods. Returns for each case success, or the error that ended it.
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

/// Simulates [`WIDTH`] closed loops together. `observe` receives the index of the case and each of its control
/// periods. The results equal those of single runs; cases that cannot be vectorised are run singly. Returns for each
/// case success, or the error that ended it.
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

/// How each case ended; none if they cannot be vectorised together.
fn side_by_side(
    model: &Description,
    cases: &[Case<'_>; WIDTH],
    observe: &mut dyn FnMut(usize, &Sample),
) -> Option<[Result<(), LabError>; WIDTH]> {
    let begins = cases.map(|lane| lane.course.reference(0.0).position);
    let cranes = cases.each_ref().map(|lane| lane.crane.clone());
    let starts = std::array::from_fn(|lane| cranes[lane].start(begins[lane]));
    // an error of one of them is reported by its single run
    let mut fleet = Fleet::new(&cranes, &starts).ok().flatten()?;
    let mut loops = Vec::with_capacity(WIDTH);
    for (k, case) in cases.iter().enumerate() {
        let measurement = fleet.measurement(k);
        let Case { controller, course, .. } = *case;
        loops.push(chosen(model, controller, course, &measurement).ok()?);
    }
    let period = model.numbers.control_period;
    let periods = cases.map(|lane| (lane.course.duration() / period).round() as u64);
    let last = periods.into_iter().max().unwrap_or_default();
    let mut loads = cases.map(|lane| lane.course.loads());
    let mut ends: [Result<(), LabError>; WIDTH] = std::array::from_fn(|_| Ok(()));

    for k in 0..=last {
        let commands = std::array::from_fn(|lane| {
            let now = Now { course: cases[lane].course, period, number: k };
            let load = due(&mut loads[lane], now.time());
            if let Some(mass) = load
                && let Err(error) = fleet.set_payload(lane, mass)
                && ends[lane].is_ok()
            {
                ends[lane] = Err(error.into());
            }
            let measurement = fleet.measurement(lane);
            let still = AxisCommand { motor_speed: 0.0, holding_valve: 1.0 };
            let goes_on = ends[lane].is_ok() && k <= periods[lane];
            let command = match goes_on {
                true => match loops[lane].command(now, &measurement) {
                    Ok(Command { axes: [command] }) => command,
                    Err(error) => {
                        ends[lane] = Err(error);
                        still
                    }
                },
                false => still,
            };
            if goes_on && ends[lane].is_ok() {
                let (truth, load_changed) = (fleet.truth(lane), load.is_some());
                observe(lane, &loops[lane].sample(now, &measurement, truth, load_changed, command));
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
    use hydroboom_control::reference::trajectory::Trajectory;
    use hydroboom_control::strategy::Strategy;

    /// Without preview, commands do not depend on later set points.
    #[test]
    fn a_course_unknown_in_advance_is_followed_without_preview() {
        /// Rests at first; then moves outwards at 0.1 m/s if `goes` is set.
        struct Joystick {
            goes: bool,
            is_known_ahead: bool,
        }
        impl Trajectory for Joystick {
            fn reference(&self, t: f64) -> SetPoint<f64> {
                let after = if self.goes { (t - 0.5).max(0.0) } else { 0.0 };
                let velocity = if after > 0.0 { 0.1 } else { 0.0 };
                SetPoint { position: 0.2 + 0.1 * after, velocity }
            }
            fn duration(&self) -> f64 {
                0.6
            }
            fn speed(&self) -> f64 {
                0.1
            }
        }
        impl Course for Joystick {
            fn name(&self) -> String {
                "joystick".into()
            }
            fn is_known_ahead(&self) -> bool {
                self.is_known_ahead
            }
        }
        let model = Description::uia_single_boom().unwrap();
        let crane = Description::uia_virtual().unwrap();
        let commands = |goes, is_known_ahead| {
            let mut commands = Vec::new();
            let course = Joystick { goes, is_known_ahead };
            simulate_closed_loop(&model, &crane, Strategy::ScheduledLqr, &course, |sample| {
                commands.push(sample.command.motor_speed);
                Ok(())
            })
            .unwrap();
            commands
        };
        let [rests, goes] = [false, true].map(|goes| commands(goes, false));
        assert_eq!(rests[..500], goes[..500]);
        assert!(goes[599] > rests[599] + 1.0, "{} rev/s", goes[599]);
        assert_ne!(commands(true, true)[..500], goes[..500]);
    }

    /// Courses of different shape and duration give the same results together as alone.
    #[test]
    fn cranes_simulated_side_by_side_follow_their_own_courses() {
        let model = Description::uia_single_boom().unwrap();
        let crane = Description::uia_virtual().unwrap();
        let courses = ["reversal", "small-moves", "reversal", "start-stop"]
            .map(|name| CourseChoice::Scenario(name.into()).of(&crane).unwrap());
        let controller = ControllerChoice::from(Strategy::BenchmarkClosedLoop);
        let cases =
            courses.each_ref().map(|c| Case { crane: &crane, controller, course: c.as_ref() });
        let mut together = [const { Vec::new() }; WIDTH];
        for end in
            simulate_cases(&model, &cases, |lane, sample| together[lane].push(sample.signals))
        {
            end.unwrap();
        }
        for (course, together) in courses.iter().zip(&together) {
            let mut alone = Vec::new();
            simulate_closed_loop(&model, &crane, controller, course.as_ref(), |sample| {
                alone.push(sample.signals);
                Ok(())
            })
            .unwrap();
            assert!(alone == *together, "{}", course.name());
        }
    }
}
