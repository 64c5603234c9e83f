//! Consistency of the state estimator on virtual cranes: are its innovations and its errors of the size that its covariance says?
//!
//! The estimator is that of the scheduled LQR, designed for the model's crane file alone. It looks on while any controller moves a crane of the family in closed
//! loop: its inputs are what is measured, and what is commanded. What it says is compared with the crane itself at the time of the measurement, which
//! is as many control periods old as the crane's fieldbus delays it. Outputs that are no states have their standard deviation from the covariance P by
//! first-order propagation, σ² = ∇h P ∇hᵀ, with exact derivatives (dual numbers).

use crate::LabError;
use crate::closed_loop::consistency_statistics::{
    ErrorSummary, Errors, InnovationSummary, Innovations,
};
use crate::closed_loop::controller_choice::ControllerChoice;
use crate::closed_loop::monte_carlo::{Member, member};
use crate::closed_loop::sample::Sample;
use crate::closed_loop::scenario::{Course, CourseChoice};
use crate::closed_loop::simulation::{Case, WIDTH, simulate_cases};
use crate::interruptible::as_long_as;
use hydroboom_control::estimation::error_covariance::{ERRORS, as_variables, output_deviation};
use hydroboom_control::estimation::extended_kalman_filter::{EstimatorState, ExtendedKalmanFilter};
use hydroboom_control::estimation::reduced_model::{MachineState, ReducedModel};
use hydroboom_control::feedback::scheduled_lqr_controller::ScheduledLqrController;
use hydroboom_control::measurement::Measurement;
use hydroboom_description::Description;
use hydroboom_design::scheduled_lqr::scheduled_lqr_controller;
use hydroboom_math::{Dual, Real};
use hydroboom_model::hydraulics::Oil;
use serde::{Serialize, Serializer};
use std::collections::VecDeque;
use std::ops::Range;

/// Length of a window of innovations \[s\].
const WINDOW: f64 = 1.0;
/// Lags of the autocorrelation \[s\].
const LAGS: [f64; 2] = [0.02, 0.2];
/// Time between two instants at which errors are taken \[s\], and within the time after a load change.
const INSTANTS: [f64; 2] = [0.5, 0.05];
/// For so long after it a load change has rows of its own \[s\].
const LOAD_CHANGE: f64 = 0.5;
/// Until so long after it the filter recovers from it \[s\].
const RECOVERY: f64 = 2.0;
/// For so long after it a start, stop or reversal of the reference has rows of its own \[s\].
const START: f64 = 0.5;

/// What is measured, in the order of the filter.
pub const MEASURED: [&str; 2] = ["position", "load pressure"];

/// What is estimated, and has a true value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Piston position, y + γ p.
    Position,
    /// Piston velocity.
    Velocity,
    /// Load pressure.
    LoadPressure,
    /// Payload.
    Payload,
    /// Friction of the cylinder: pre-sliding and viscous, A (f + p_v w).
    Friction,
    /// Friction less the unknown force, A (f + p_v w − d): friction that differs from the model's is an unknown force to the filter.
    FrictionAndUnknownForce,
    /// Bulk modulus of the oil on the piston side, at its pressure.
    BulkModulus,
}

impl Quantity {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Position,
        Self::Velocity,
        Self::LoadPressure,
        Self::Payload,
        Self::Friction,
        Self::FrictionAndUnknownForce,
        Self::BulkModulus,
    ];

    /// Name in tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Position => "piston position",
            Self::Velocity => "piston velocity",
            Self::LoadPressure => "load pressure",
            Self::Payload => "payload",
            Self::Friction => "friction",
            Self::FrictionAndUnknownForce => "friction less unknown force",
            Self::BulkModulus => "bulk modulus",
        }
    }

    /// Whether it is the effect of a parameter, which is judged by its coverage alone: its standard deviation to first order vanishes where the effect saturates, as
    /// the bulk modulus of compressed oil does, and NEES has no meaning there.
    pub fn is_effect_of_parameter(self) -> bool {
        matches!(self, Self::Friction | Self::FrictionAndUnknownForce | Self::BulkModulus)
    }

    /// Unit of its errors in tables and JSON, and that in SI units.
    pub fn unit(self) -> (&'static str, f64) {
        match self {
            Self::Position => ("mm", 1e-3),
            Self::Velocity => ("mm/s", 1e-3),
            Self::LoadPressure => ("bar", 1e5),
            Self::Payload => ("kg", 1.0),
            Self::Friction | Self::FrictionAndUnknownForce => ("N", 1.0),
            Self::BulkModulus => ("MPa", 1e6),
        }
    }
}

impl Serialize for Quantity {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(self.name())
    }
}

/// What happens to the crane at an instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The half second after a load change.
    AfterLoadChange,
    /// From then on until two seconds after it.
    Recovery,
    /// The half second after the reference starts, stops or reverses.
    AfterStart,
    /// The reference moves.
    Motion,
    /// The reference rests.
    Rest,
}

impl Phase {
    /// All of them.
    pub const ALL: [Self; 5] =
        [Self::AfterLoadChange, Self::Recovery, Self::AfterStart, Self::Motion, Self::Rest];

    /// Name in tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::AfterLoadChange => "0.5 s after a load change",
            Self::Recovery => "0.5 to 2 s after a load change",
            Self::AfterStart => "0.5 s after a start, stop or reversal",
            Self::Motion => "in motion",
            Self::Rest => "at rest",
        }
    }
}

/// Errors by phase, then by quantity.
type ErrorTable = [[Errors; Quantity::ALL.len()]; Phase::ALL.len()];

/// What a crane's course tells of the estimator.
#[derive(Clone, Debug)]
struct Run {
    innovations: [Innovations; 2],
    /// Longest time for which the innovations were inconsistent \[s\].
    longest_inconsistent: f64,
    errors: ErrorTable,
}

/// All quantities of a state, with the motor turning at a speed \[rev/s\].
fn quantities<T: Real>(
    model: &ReducedModel<T>,
    z: &MachineState<T>,
    motor_speed: T,
    rod_side_term: T,
) -> [T; Quantity::ALL.len()] {
    let friction = model.piston_area * model.viscous.mul_add(z.velocity, z.friction);
    Quantity::ALL.map(|quantity| match quantity {
        Quantity::Position => model.piston(z),
        Quantity::Velocity => model.piston_velocity(z, motor_speed, rod_side_term),
        Quantity::LoadPressure => z.load_pressure,
        Quantity::Payload => z.payload,
        Quantity::Friction => friction,
        Quantity::FrictionAndUnknownForce => friction - model.piston_area * z.disturbance,
        Quantity::BulkModulus => {
            model.bulk_modulus(z.load_pressure, z.transition_pressure, rod_side_term)
        }
    })
}

/// Estimates of all quantities, each with its standard deviation.
fn estimates(
    filter: &ExtendedKalmanFilter<f64>,
    state: &EstimatorState<f64>,
    motor_speed: f64,
    rod_side_term: f64,
) -> [(f64, f64); Quantity::ALL.len()] {
    let constant = Dual::<f64, ERRORS>::constant;
    let (model, z) = as_variables(&filter.model, &state.estimate);
    let mut found = quantities(&model, &z, constant(motor_speed), constant(rod_side_term))
        .map(|h| (h.value, output_deviation(&state.errors, &h.slope)));
    found[Quantity::Payload as usize].1 = filter.payload_deviation(state);
    found
}

/// An estimator that looks on at a crane, and what is compared with it.
struct ConsistencyRecorder<'a> {
    controller: ScheduledLqrController,
    crane: &'a Description,
    course: &'a dyn Course,
    /// Control period \[s\].
    period: f64,
    /// Motor speed that was commanded in the period before \[rev/s\].
    command: f64,
    /// What the crane was when it was measured, newest last: as many periods as the fieldbus delays a measurement, and now.
    past: VecDeque<Sample>,
    delay: usize,
    /// Control periods so far.
    number: usize,
    /// Direction of the reference, and the time at which it changed last \[s\].
    direction: (f64, f64),
    run: Run,
}

impl<'a> ConsistencyRecorder<'a> {
    fn new(
        controller: ScheduledLqrController,
        period: f64,
        crane: &'a Description,
        course: &'a dyn Course,
    ) -> Self {
        let samples = |time: f64| (time / period).round() as usize;
        let [first, last] = LAGS.map(samples);
        let innovations = Innovations::new(samples(WINDOW), first..=last);
        Self {
            controller,
            crane,
            course,
            period,
            command: 0.0,
            past: VecDeque::new(),
            delay: crane.numbers.fieldbus_delay.round() as usize,
            number: 0,
            direction: (0.0, f64::NEG_INFINITY),
            run: Run {
                innovations: [innovations.clone(), innovations],
                longest_inconsistent: 0.0,
                errors: ErrorTable::default(),
            },
        }
    }

    /// One more control period.
    fn record(&mut self, sample: &Sample) {
        self.number += 1;
        let measurement = Measurement::new(self.number as u64, sample.time, [sample.signals]);
        let has_begun = self.controller.estimated().is_some();
        self.controller.observe(&measurement, self.command);
        self.command = sample.command.motor_speed;
        self.past.push_back(*sample);
        // what is measured before the first measurement has arrived is that of the start
        if self.past.len() <= self.delay {
            return;
        }
        let Some(measured) = self.past.pop_front() else { return };
        self.follow_reference(&measured);
        if has_begun {
            self.compare(&measured, sample.signals.motor_speed);
        }
    }

    fn follow_reference(&mut self, measured: &Sample) {
        let velocity = measured.reference.velocity;
        let direction = if velocity == 0.0 { 0.0 } else { velocity.signum() };
        if direction != self.direction.0 {
            self.direction = (direction, measured.time);
        }
    }

    /// Compares the estimate with the crane as it was when it was measured, and motor speed as it was read \[rev/s\].
    fn compare(&mut self, measured: &Sample, motor_speed: f64) {
        let Some(estimated) = self.controller.estimated() else { return };
        let filter = &estimated.filter;
        self.run.longest_inconsistent = self.run.longest_inconsistent.max(filter.inconsistent_time);
        let phase = self.phase(measured.time);
        let is_load_change = phase == Phase::AfterLoadChange;
        for (k, innovations) in self.run.innovations.iter_mut().enumerate() {
            let normalised = filter.nis[k].max(0.0).sqrt().copysign(filter.innovation[k]);
            innovations.add((!is_load_change).then_some(normalised));
        }
        let periods = (INSTANTS[usize::from(is_load_change)] / self.period).round() as usize;
        let number = (measured.time / self.period).round() as usize;
        if !number.is_multiple_of(periods.max(1)) {
            return;
        }
        let settings = &self.controller.estimator().filter;
        let found = estimates(settings, filter, motor_speed, estimated.rod_side_term);
        let truth = self.truth(measured);
        let errors = &mut self.run.errors[phase as usize];
        for ((errors, (value, deviation)), truth) in errors.iter_mut().zip(found).zip(truth) {
            errors.add(value - truth, deviation);
        }
    }

    fn phase(&self, time: f64) -> Phase {
        let mut loads = self.course.loads().iter();
        let since_load =
            loads.rfind(|load| load.time < time).map_or(f64::INFINITY, |load| time - load.time);
        let (direction, changed) = self.direction;
        if since_load <= LOAD_CHANGE {
            Phase::AfterLoadChange
        } else if since_load <= RECOVERY {
            Phase::Recovery
        } else if time - changed <= START {
            Phase::AfterStart
        } else if direction != 0.0 {
            Phase::Motion
        } else {
            Phase::Rest
        }
    }

    fn truth(&self, measured: &Sample) -> [f64; Quantity::ALL.len()] {
        let (truth, o) = (&measured.truth, &measured.truth.outputs);
        let n = &self.crane.numbers;
        let hung = self.course.loads().iter().rfind(|load| load.time < measured.time);
        Quantity::ALL.map(|quantity| match quantity {
            Quantity::Position => o.stroke,
            Quantity::Velocity => o.velocity,
            Quantity::LoadPressure => {
                o.pressure_a - self.crane.cylinder().area_ratio() * o.pressure_b
            }
            Quantity::Payload => hung.map_or(n.payload, |load| load.mass),
            Quantity::Friction | Quantity::FrictionAndUnknownForce => o.friction_force,
            Quantity::BulkModulus => Oil {
                bulk_modulus_max: n.bulk_modulus_max,
                bulk_modulus_min: n.bulk_modulus_min,
                transition_pressure: truth.transition_pressure,
                transition_slope: 1.0 / n.transition_width,
                vapour_pressure: n.vapour_pressure,
            }
            .bulk_modulus(o.pressure_a),
        })
    }
}

/// Innovations of one measured number.
#[derive(Clone, Debug, Serialize)]
pub struct InnovationRow {
    /// What is measured.
    pub measured: &'static str,
    /// The course; all of them where there is none.
    pub course: Option<String>,
    /// Its innovations.
    #[serde(flatten)]
    pub summary: InnovationSummary,
    /// Lag of the largest autocorrelation.
    pub largest_at_lag_ms: f64,
    /// Whether it is as wanted.
    pub is_consistent: bool,
}

/// Errors of one quantity.
#[derive(Clone, Debug, Serialize)]
pub struct ErrorRow {
    /// What is estimated.
    pub quantity: Quantity,
    /// Unit of its errors.
    pub unit: &'static str,
    /// The course; all of them where there is none.
    pub course: Option<String>,
    /// What happens to the crane; all but the half second after a load change where there is nothing.
    pub phase: Option<&'static str>,
    /// Its errors.
    #[serde(flatten)]
    pub summary: ErrorSummary,
    /// Whether it is as wanted; none where there are too few instants to tell.
    pub is_consistent: Option<bool>,
}

/// For how long innovations were inconsistent along a course.
#[derive(Clone, Debug, Serialize)]
pub struct InconsistentTime {
    /// The course.
    pub course: String,
    /// The longest time over its cranes.
    pub longest_s: f64,
}

/// What was found.
#[derive(Clone, Debug, Serialize)]
pub struct Consistency {
    /// Numbers of the cranes that have gone along all courses.
    pub cranes: Vec<u64>,
    /// Courses that a crane could not finish; they do not count.
    pub failed: Vec<String>,
    /// By course: longest time for which the mean NIS was above `estimator.nis_inconsistent`; `estimator.divergence_time_s` is to be longer.
    pub inconsistent: Vec<InconsistentTime>,
    /// Innovations: over all courses, then by course.
    pub innovations: Vec<InnovationRow>,
    /// Errors: over all courses, by phase, and by course.
    pub errors: Vec<ErrorRow>,
}

/// Runs the estimator beside a controller on cranes of a family along all courses. `go_on` is told the share done and says whether to: if not, those cranes
/// that have gone all the way by then are all there is.
///
/// # Errors
///
/// [`LabError`] when a crane cannot be built, or an estimator not be designed for the model.
pub fn consistency(
    model: &Description,
    nominal: &Description,
    controller: ControllerChoice,
    courses: &[CourseChoice],
    (cranes, seed): (Range<u64>, u64),
    go_on: &(dyn Fn(f64) -> bool + Sync),
) -> Result<Consistency, LabError> {
    let names = courses
        .iter()
        .map(|course| course.of(nominal).map(|course| course.name()))
        .collect::<Result<Vec<_>, _>>()?;
    let numbers: Vec<u64> = cranes.collect();
    let members = numbers
        .iter()
        .map(|number| member(nominal, seed, *number))
        .collect::<Result<Vec<_>, _>>()?;
    let estimator = scheduled_lqr_controller(model)?;
    let groups: Vec<&[Member]> = members.chunks(WIDTH).collect();
    let jobs: Vec<_> = groups
        .iter()
        .flat_map(|group| courses.iter().map(move |course| (*group, course)))
        .collect();
    let share = |done: usize| go_on(done as f64 / jobs.len() as f64);
    let one = |(group, course): &(&[Member], &CourseChoice)| {
        together(model, &estimator, controller, group, course)
    };
    let done = as_long_as(&jobs, &share, one)
        .into_iter()
        .map(Option::transpose)
        .collect::<Result<Vec<_>, LabError>>()?;
    let mut by_course: Vec<Vec<Run>> = vec![Vec::new(); courses.len()];
    let (mut finished, mut failed) = (Vec::new(), Vec::new());
    for (group, runs) in numbers.chunks(WIDTH).zip(done.chunks(courses.len())) {
        // only cranes that have gone all the way
        let Some(runs) = runs.iter().cloned().collect::<Option<Vec<_>>>() else { continue };
        finished.extend_from_slice(group);
        for ((runs, name), of_course) in runs.into_iter().zip(&names).zip(&mut by_course) {
            for (run, number) in runs.into_iter().zip(group) {
                match run {
                    Ok(run) => of_course.push(run),
                    Err(error) => failed.push(format!("crane {number}, {name}: {error}")),
                }
            }
        }
    }
    let period = model.numbers.control_period;
    let inconsistent = names
        .iter()
        .zip(&by_course)
        .map(|(name, runs)| InconsistentTime {
            course: name.clone(),
            longest_s: runs.iter().map(|run| run.longest_inconsistent).fold(0.0, f64::max),
        })
        .collect();
    Ok(Consistency {
        inconsistent,
        cranes: finished,
        failed,
        innovations: innovation_rows(&names, &by_course, period),
        errors: error_rows(&names, &by_course),
    })
}

/// One course of up to [`WIDTH`] cranes; what each tells, or why it could not finish.
fn together(
    model: &Description,
    estimator: &ScheduledLqrController,
    controller: ControllerChoice,
    group: &[Member],
    choice: &CourseChoice,
) -> Result<Vec<Result<Run, String>>, LabError> {
    let courses =
        group.iter().map(|member| choice.of(&member.crane)).collect::<Result<Vec<_>, _>>()?;
    let lanes = || group.iter().zip(&courses);
    let cases: Vec<Case<'_>> = lanes()
        .map(|(member, course)| Case { crane: &member.crane, controller, course: course.as_ref() })
        .collect();
    let period = model.numbers.control_period;
    let mut recorders: Vec<ConsistencyRecorder<'_>> = lanes()
        .map(|(member, course)| {
            ConsistencyRecorder::new(*estimator, period, &member.crane, course.as_ref())
        })
        .collect();
    let ends = simulate_cases(model, &cases, |lane, sample| recorders[lane].record(sample));
    Ok(recorders
        .into_iter()
        .zip(ends)
        .map(|(observer, end)| end.map(|()| observer.run).map_err(|error| error.to_string()))
        .collect())
}

fn innovation_rows(names: &[String], by_course: &[Vec<Run>], period: f64) -> Vec<InnovationRow> {
    let row = |k: usize, course: Option<&String>, runs: &mut dyn Iterator<Item = &Run>| {
        let summary = InnovationSummary::of(runs.map(|run| &run.innovations[k]))?;
        Some(InnovationRow {
            measured: MEASURED[k],
            course: course.cloned(),
            largest_at_lag_ms: summary.largest_at_lag as f64 * period * 1e3,
            is_consistent: summary.is_consistent(),
            summary,
        })
    };
    let measured = 0..MEASURED.len();
    let all = measured.clone().filter_map(|k| row(k, None, &mut by_course.iter().flatten()));
    let each = names.iter().zip(by_course).flat_map(|(name, runs)| {
        measured.clone().filter_map(move |k| row(k, Some(name), &mut runs.iter()))
    });
    all.chain(each).collect()
}

fn error_rows(names: &[String], by_course: &[Vec<Run>]) -> Vec<ErrorRow> {
    let without_change = &Phase::ALL[1..];
    let mut rows = Vec::new();
    let mut add = |course: Option<&String>, phase: Option<Phase>, runs: &[&Run]| {
        for quantity in Quantity::ALL {
            let mut errors = Errors::default();
            for run in runs {
                let those = phase.as_ref().map_or(without_change, std::slice::from_ref);
                for phase in those {
                    errors.merge(&run.errors[*phase as usize][quantity as usize]);
                }
            }
            let (unit, size) = quantity.unit();
            rows.extend(errors.summary(size).map(|summary| ErrorRow {
                quantity,
                unit,
                course: course.cloned(),
                phase: phase.map(Phase::name),
                is_consistent: summary.is_consistent(),
                summary,
            }));
        }
    };
    let all: Vec<&Run> = by_course.iter().flatten().collect();
    add(None, None, &all);
    for phase in Phase::ALL {
        add(None, Some(phase), &all);
    }
    for (name, runs) in names.iter().zip(by_course) {
        add(Some(name), None, &runs.iter().collect::<Vec<_>>());
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_control::estimation::extended_kalman_filter::EstimatorInput;
    use hydroboom_control::estimation::reduced_model::STATES;
    use hydroboom_control::strategy::Strategy;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// Quantities of states and, after them, consider parameters.
    fn quantities_of(
        model: &ReducedModel<f64>,
        errors: &[f64; ERRORS],
    ) -> [f64; Quantity::ALL.len()] {
        let mut z = [0.0; STATES];
        z.copy_from_slice(&errors[..STATES]);
        let mut model = *model;
        let mass = errors[STATES + 3];
        (model.coulomb, model.viscous) = (errors[STATES], errors[STATES + 1]);
        model.displacement = errors[STATES + 2];
        model.equivalent_mass = model.equivalent_mass.map(|p| p.map(|c| c * mass));
        model.compliance = model.compliance.map(|p| p.map(|c| c * mass * mass));
        quantities(&model, &MachineState::from_array(z), 3.0, 2e5)
    }

    /// Standard deviations of outputs against central differences of the outputs themselves.
    #[test]
    fn deviations_of_outputs_are_those_of_the_states() {
        let description = Description::uia_single_boom().unwrap();
        let controller = scheduled_lqr_controller(&description).unwrap();
        let filter = controller.estimator().filter;
        let input = EstimatorInput {
            position: 0.25,
            position_is_good: 1.0,
            load_pressure: 60e5,
            load_pressure_is_good: 1.0,
            rod_side_term: 2e5,
            motor_speed: 3.0,
        };
        let mut state = filter.start(&input);
        (0..500).for_each(|_| filter.update(&mut state, &input));
        let found = estimates(&filter, &state, 3.0, 2e5);
        let at = |errors: [f64; ERRORS]| quantities_of(&filter.model, &errors);
        let z = state.estimate.to_array();
        let exact = [
            filter.model.coulomb,
            filter.model.viscous,
            filter.model.displacement,
            1.0,
            filter.sensor_lag,
        ];
        let mean: [f64; ERRORS] =
            std::array::from_fn(|i| if i < STATES { z[i] } else { exact[i - STATES] });
        let slopes: [[f64; Quantity::ALL.len()]; ERRORS] = std::array::from_fn(|i| {
            // a hundredth of a standard deviation: neither curvature nor rounding counts
            let step = 0.01 * state.errors[i][i].sqrt();
            let moved =
                |by: f64| at(std::array::from_fn(|j| mean[j] + if i == j { by } else { 0.0 }));
            let (above, below) = (moved(step), moved(-step));
            std::array::from_fn(|q| (above[q] - below[q]) / (2.0 * step))
        });
        for (q, quantity) in Quantity::ALL.into_iter().enumerate() {
            let mut variance = 0.0;
            for i in 0..ERRORS {
                for j in 0..ERRORS {
                    variance += slopes[i][q] * state.errors[i][j] * slopes[j][q];
                }
            }
            if quantity == Quantity::Payload {
                // by the load's moment arm besides, in proportion to the load
                variance += (filter.payload_arm * z[6]).powi(2);
            }
            let (value, deviation) = found[q];
            assert!((value / at(mean)[q] - 1.0).abs() < 1e-12, "{}", quantity.name());
            assert!(
                (deviation / variance.sqrt() - 1.0).abs() < 0.01,
                "{}: {deviation}",
                quantity.name()
            );
        }
        let of = |quantity: Quantity| found[quantity as usize].1;
        assert_eq!(of(Quantity::Payload), filter.deviation(&state).payload);
    }

    /// The same family, beside the benchmark: what is compared is the crane at the time of the measurement. A period late, the position at 120 mm/s would be
    /// off by 0.12 mm.
    #[test]
    fn estimates_are_compared_with_the_crane_as_it_was_measured() {
        let model = Description::uia_single_boom().unwrap();
        let nominal = Description::uia_virtual().unwrap();
        let beside = |strategy: Strategy| {
            let course = [CourseChoice::Motion(nominal.numbers.fast)];
            consistency(&model, &nominal, strategy.into(), &course, (0..1, 7), &|_| true).unwrap()
        };
        for strategy in [Strategy::BenchmarkClosedLoop, Strategy::ScheduledLqr] {
            let found = beside(strategy);
            assert_eq!((found.cranes.len(), found.failed.len()), (1, 0));
            let row = |quantity: Quantity, phase: Option<Phase>| {
                let name = phase.map(Phase::name);
                let mut rows = found.errors.iter();
                rows.find(|r| r.quantity == quantity && r.phase == name).unwrap().summary
            };
            let position = row(Quantity::Position, Some(Phase::Motion));
            assert!(position.rms_error < 0.05, "{}: {position:?}", strategy.name());
            // its sensors read it with 0.05 bar of noise, and the model leaves out 0.08 bar
            let pressure = row(Quantity::LoadPressure, None);
            assert!(pressure.rms_error < 0.2, "{}: {pressure:?}", strategy.name());
            assert_eq!(position.instants, row(Quantity::Payload, Some(Phase::Motion)).instants);
        }
    }

    #[test]
    fn a_load_change_has_rows_of_its_own() {
        let model = Description::uia_single_boom().unwrap();
        let nominal = Description::uia_virtual().unwrap();
        let course = [CourseChoice::Scenario("payload-change".into())];
        let controller = Strategy::ScheduledLqr.into();
        let found =
            consistency(&model, &nominal, controller, &course, (0..1, 7), &|_| true).unwrap();
        let payload = |phase: Option<Phase>| {
            let name = phase.map(Phase::name);
            let mut rows = found.errors.iter();
            let of = |r: &&ErrorRow| r.quantity == Quantity::Payload && r.phase == name;
            rows.find(of).unwrap().summary
        };
        let after = payload(Some(Phase::AfterLoadChange));
        // three changes, ten instants each; just after it the payload is off by what has changed
        assert_eq!(after.instants, 30);
        assert!(after.rms_error > 2.0 * payload(None).rms_error, "{after:?}");
    }

    #[test]
    fn cranes_of_an_interrupted_evaluation_have_gone_all_the_way() {
        let model = Description::uia_single_boom().unwrap();
        let nominal = Description::uia_virtual().unwrap();
        let courses = ["small-moves", "reversal"].map(|s| CourseChoice::Scenario(s.into()));
        let done = AtomicUsize::new(0);
        let go_on = |_| done.fetch_add(1, Ordering::Relaxed) + 1 < 3;
        let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let controller = Strategy::BenchmarkClosedLoop.into();
        let range = (3..3 + 2 * WIDTH as u64, 1);
        let found = one_thread
            .install(|| consistency(&model, &nominal, controller, &courses, range, &go_on))
            .unwrap();
        assert_eq!(found.cranes, [3, 4, 5, 6]);
    }
}
