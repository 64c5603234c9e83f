//! Consistency of the state estimator on virtual cranes: whether its innovations and errors agree with its
//! covariance.
//!
//! The estimator is that of the scheduled LQR, designed for the model's crane file alone. It runs beside
//! any controller that moves a crane of the family in closed loop. Its inputs are the measurements and the
//! commands. Its estimates are compared with the true state at the time of the measurement, which the
//! crane's fieldbus delays by some control periods. Outputs that are not states get their standard
//! deviation from the covariance P by first-order propagation, σ² = ∇h P ∇hᵀ. The derivatives are exact
//! (dual numbers).

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

/// Window of the innovations \[s\].
const WINDOW: f64 = 1.0;
/// Lags of the autocorrelation \[s\].
const LAGS: [f64; 2] = [0.02, 0.2];
/// Interval between two evaluations of the errors \[s\]: in general, and within [`LOAD_CHANGE`] after a
/// load change.
const INSTANTS: [f64; 2] = [0.5, 0.05];
/// Time after a load change with separate rows \[s\].
const LOAD_CHANGE: f64 = 0.5;
/// Time after a load change until the end of the recovery phase \[s\].
const RECOVERY: f64 = 2.0;
/// Time after a start, stop or reversal of the reference with separate rows \[s\].
const START: f64 = 0.5;

/// Measured signals in the order of the filter.
pub const MEASURED: [&str; 2] = ["position", "load pressure"];

/// Estimated quantity that has a true value.
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
    /// Friction minus the unknown force, A (f + p_v w − d): the filter estimates a deviation from the
    /// friction model as an unknown force.
    FrictionAndUnknownForce,
    /// Bulk modulus of the oil on the piston side, at its pressure.
    BulkModulus,
}

impl Quantity {
    /// All quantities.
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

    /// Whether it is a nonlinear function of parameters, which is judged by its coverage alone. Its
    /// first-order standard deviation vanishes where the function saturates, as the bulk modulus of
    /// compressed oil does. NEES has no meaning there.
    pub fn is_effect_of_parameter(self) -> bool {
        matches!(self, Self::Friction | Self::FrictionAndUnknownForce | Self::BulkModulus)
    }

    /// Unit of its errors in tables and JSON, and that unit in SI units.
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

/// Phase of the course at an instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The half second after a load change.
    AfterLoadChange,
    /// From 0.5 s to 2 s after a load change.
    Recovery,
    /// The half second after the reference starts, stops or reverses.
    AfterStart,
    /// The reference moves.
    Motion,
    /// The reference rests.
    Rest,
}

impl Phase {
    /// All phases.
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

/// Statistics of the estimator along a course of a crane.
#[derive(Clone, Debug)]
struct Run {
    innovations: [Innovations; 2],
    /// Longest time for which the innovations were inconsistent \[s\].
    longest_inconsistent: f64,
    errors: ErrorTable,
}

/// All quantities of a state at a motor speed \[rev/s\].
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

/// Estimates of all quantities with their standard deviations.
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

/// Records the statistics of an estimator that runs beside another controller.
struct ConsistencyRecorder<'a> {
    controller: ScheduledLqrController,
    crane: &'a Description,
    course: &'a dyn Course,
    /// Control period \[s\].
    period: f64,
    /// Motor speed commanded in the previous period \[rev/s\].
    command: f64,
    /// True samples of the measurement delay and of now, newest last.
    past: VecDeque<Sample>,
    delay: usize,
    /// Number of control periods so far.
    number: usize,
    /// Direction of the reference, and the time of its last change \[s\].
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

    /// Processes a control period.
    fn record(&mut self, sample: &Sample) {
        self.number += 1;
        let measurement = Measurement::new(self.number as u64, sample.time, [sample.signals]);
        let has_begun = self.controller.estimated().is_some();
        self.controller.observe(&measurement, self.command);
        self.command = sample.command.motor_speed;
        self.past.push_back(*sample);
        // the estimator has no measurement before the delay has passed
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

    /// Compares the estimate with the true state at the time of the measurement; `motor_speed` is the
    /// measured one \[rev/s\].
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

/// Innovations of one measured signal.
#[derive(Clone, Debug, Serialize)]
pub struct InnovationRow {
    /// Name of the measured signal.
    pub measured: &'static str,
    /// Course; none for all courses together.
    pub course: Option<String>,
    /// Summary of its innovations.
    #[serde(flatten)]
    pub summary: InnovationSummary,
    /// Lag of the largest autocorrelation.
    pub largest_at_lag_ms: f64,
    /// Whether the summary meets the requirements.
    pub is_consistent: bool,
}

/// Errors of one quantity.
#[derive(Clone, Debug, Serialize)]
pub struct ErrorRow {
    /// Estimated quantity.
    pub quantity: Quantity,
    /// Unit of its errors.
    pub unit: &'static str,
    /// Course; none for all courses together.
    pub course: Option<String>,
    /// Phase of the course; none for all phases except the 0.5 s after a load change.
    pub phase: Option<&'static str>,
    /// Summary of its errors.
    #[serde(flatten)]
    pub summary: ErrorSummary,
    /// Whether the summary meets the requirements; none for too few instants.
    pub is_consistent: Option<bool>,
}

/// Time of inconsistent innovations along a course.
#[derive(Clone, Debug, Serialize)]
pub struct InconsistentTime {
    /// The course.
    pub course: String,
    /// Longest time over all cranes \[s\].
    pub longest_s: f64,
}

/// Result of the consistency study.
#[derive(Clone, Debug, Serialize)]
pub struct Consistency {
    /// Numbers of the cranes that completed all courses.
    pub cranes: Vec<u64>,
    /// Courses that a crane could not complete; they do not count.
    pub failed: Vec<String>,
    /// Longest time by course for which the mean NIS exceeded `estimator.nis_inconsistent`.
    /// `estimator.divergence_time_s` must be longer.
    pub inconsistent: Vec<InconsistentTime>,
    /// Innovations: over all courses, then by course.
    pub innovations: Vec<InnovationRow>,
    /// Errors: over all courses, by phase, and by course.
    pub errors: Vec<ErrorRow>,
}

/// Runs the estimator beside a controller on cranes of a family along all courses. `go_on` receives the
/// share done and returns whether to continue; otherwise the cranes completed so far count.
///
/// # Errors
///
/// [`LabError`] if a crane cannot be built or the estimator cannot be designed for the model.
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
        // only cranes that completed all courses
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

/// One course on up to [`WIDTH`] cranes. Returns the statistics of each, or the reason of its failure.
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

    /// Quantities as functions of the states and, after them, the consider parameters.
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

    /// Standard deviations of the outputs compared with central differences of the outputs.
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
            // step of 0.01 standard deviations: neither curvature nor rounding matters
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
                // plus the uncertainty of the load's moment arm, in proportion to the payload
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

    /// The estimate is compared with the true state at the time of the measurement. One period of error
    /// would shift the position by 0.12 mm at 120 mm/s.
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
            // 0.05 bar of sensor noise, and 0.08 bar of unmodelled pressure
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
        // three changes with ten instants each; directly after a change the payload error is its size
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
