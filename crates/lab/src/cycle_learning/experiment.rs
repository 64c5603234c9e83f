//! The learning experiment: one closed-loop cycle under the scheduled LQR, identification from it, and the tracking errors of feedforward and of iterative
//! learning control.

use super::delayed_drive::{with_fieldbus, without_fieldbus};
use super::identification::{identified, overrides};
use super::iterative_learning_control::{Convergence, IterativeLearning, LearningSettings};
use super::offline_feedforward::feedforward;
use super::record::Record;
use crate::LabError;
use crate::closed_loop::metrics::SustainedOscillation;
use crate::closed_loop::scenario::{Course, CourseChoice};
use crate::closed_loop::simulation::{Loop, Now};
use crate::interruptible::as_long_as;
use hydroboom_control::command::AxisCommand;
use hydroboom_control::supervision::oscillation_detector::OscillationState;
use hydroboom_description::{Description, RangeSource};
use hydroboom_design::scheduled_lqr::{known_delay, scheduled_lqr_controller};
use hydroboom_virtual_crane::VirtualCrane;
use serde::Serialize;

/// Cycles of learning after which errors are shown.
pub const SHOWN_CYCLES: [usize; 3] = [1, 3, 10];

/// How the motor speed of a cycle is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Scheduled LQR with feedback: the cycle that the machine is identified from.
    ClosedLoop,
    /// Feedforward from the model as described.
    NominalModel,
    /// Feedforward from the model with the state estimator's payload and transition pressure (means over the second half of the cycle) and drive lag (at its end).
    OnLineEstimates,
    /// Feedforward from the model that is identified from the whole cycle.
    IdentifiedModel,
    /// Commands of the closed-loop cycle, corrected by iterative learning control.
    IterativeLearning,
    /// The very motor speed of the closed-loop cycle.
    Replay,
}

impl Method {
    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::ClosedLoop => "closed loop (scheduled LQR)",
            Self::NominalModel => "feedforward, nominal model",
            Self::OnLineEstimates => "feedforward, on-line estimates",
            Self::IdentifiedModel => "feedforward, identified model",
            Self::IterativeLearning => "iterative learning control",
            Self::Replay => "replay of the closed loop",
        }
    }
}

/// What a cycle comes to by one method.
#[derive(Clone, Debug, Serialize)]
pub struct MethodError {
    /// The method.
    pub method: Method,
    /// Cycles of learning; none of other methods.
    pub cycles: Option<usize>,
    /// Whether the machine begins at the rest that the first cycle began from; otherwise the oil's state is what the cycle before has left.
    pub reset: bool,
    /// RMS tracking error, true; none where the cycle could not be run.
    pub rms_true_mm: Option<f64>,
    /// RMS tracking error as measured.
    pub rms_measured_mm: Option<f64>,
}

/// What a cycle of one course tells of one machine.
#[derive(Clone, Debug, Serialize)]
pub struct CycleReport {
    /// Name of the machine.
    pub crane: String,
    /// The course.
    pub course: String,
    /// Whether the closed loop came to rest where its reference rested: not in a sustained oscillation, and not where the cycle could not be run.
    pub stable: bool,
    /// That oscillation.
    pub sustained_oscillation: Option<SustainedOscillation>,
    /// Tracking errors.
    pub methods: Vec<MethodError>,
    /// Whether learning converges.
    pub convergence: Option<Convergence>,
    /// What was identified, as overrides of the model's crane file.
    pub identified: Vec<String>,
    /// What is to be said of it.
    pub remarks: Vec<String>,
}

/// Tracking errors of a cycle \[m\].
#[derive(Clone, Debug, Default)]
struct Errors {
    true_error: Vec<f64>,
    measured: Vec<f64>,
}

impl Errors {
    fn push(&mut self, machine: &VirtualCrane, reference: f64) {
        self.true_error.push(machine.truth().outputs.stroke - reference);
        self.measured.push(machine.signals().stroke - reference);
    }
}

/// Root of the mean square.
fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|e| e * e).sum::<f64>() / errors.len().max(1) as f64).sqrt()
}

/// A cycle under the scheduled LQR.
struct Cycle {
    /// The model with mean payload and transition pressure of the second half, and the drive's lag at the end, as estimated.
    estimated: Description,
    record: Record,
    errors: Errors,
    /// The machine at the end of the cycle.
    machine: VirtualCrane,
}

impl Cycle {
    fn run(
        model: &Description,
        crane: &Description,
        course: &dyn Course,
    ) -> Result<Self, LabError> {
        let mut machine = at_rest(crane, course)?;
        let controller = Box::new(scheduled_lqr_controller(model)?);
        let mut controlled =
            Loop::start(model, controller, known_delay(model), course, &machine.measurement())?;
        let period = model.numbers.control_period;
        let periods = (course.duration() / period).round() as u64;
        let (mut record, mut errors) = (Record::new(period), Errors::default());
        let mut estimated = model.clone();
        let [mut payload, mut transition, mut count] = [0.0; 3];
        for number in 0..periods {
            let measurement = machine.measurement();
            errors.push(&machine, course.reference(number as f64 * period).position);
            let now = Now { course, period, number };
            let [command] = controlled.command(now, &measurement)?.axes;
            machine.advance(&command).map_err(LabError::during("the closed-loop cycle"))?;
            record.push(command, measurement.axes[0].signals);
            if let (Some(of), true) = (controlled.controller.estimated(), 2 * number >= periods) {
                payload += of.filter.estimate.payload;
                transition += of.filter.estimate.transition_pressure;
                count += 1.0;
                estimated.numbers.tuning.estimator_drive_lag = of.drive.time_constant(period);
            }
        }
        if count > 0.0 {
            estimated.numbers.payload = payload / count;
            estimated.numbers.transition = transition / count;
        }
        Ok(Self { estimated, record, errors, machine })
    }
}

/// A crane that has long been at rest where a course begins.
pub(crate) fn at_rest(crane: &Description, course: &dyn Course) -> Result<VirtualCrane, LabError> {
    Ok(VirtualCrane::new(crane, &crane.start(course.reference(0.0).position))?)
}

/// A cycle under commands without feedback: what was recorded, and tracking errors.
fn replayed(
    commands: &[AxisCommand<f64>],
    machine: &mut VirtualCrane,
    course: &dyn Course,
) -> Result<(Record, Errors), LabError> {
    let period = machine.period();
    let (mut record, mut errors) = (Record::new(period), Errors::default());
    for (k, command) in commands.iter().enumerate() {
        errors.push(machine, course.reference(k as f64 * period).position);
        record.push(*command, machine.signals());
        machine.advance(command).map_err(LabError::during("a cycle without feedback"))?;
    }
    Ok((record, errors))
}

/// One cycle of each course on each crane, then all methods, on all cores. `go_on` is told of each and says whether to: if not, what is done by
/// then is all there is.
///
/// # Errors
///
/// [`LabError`] when a crane cannot be built.
pub fn learning_experiment(
    model: &Description,
    cranes: &[(String, Description)],
    courses: &[CourseChoice],
    go_on: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<CycleReport>, LabError> {
    let jobs: Vec<_> =
        cranes.iter().flat_map(|crane| courses.iter().map(move |course| (crane, course))).collect();
    let one = |((name, crane), choice): &(&(String, Description), &CourseChoice)| {
        cycle_report(model, crane, name, choice.of(crane)?.as_ref())
    };
    as_long_as(&jobs, &|_| go_on(), one).into_iter().flatten().collect()
}

fn cycle_report(
    model: &Description,
    crane: &Description,
    name: &str,
    course: &dyn Course,
) -> Result<CycleReport, LabError> {
    let mut report = CycleReport {
        crane: name.into(),
        course: course.name(),
        stable: false,
        sustained_oscillation: None,
        methods: Vec::new(),
        convergence: None,
        identified: Vec::new(),
        remarks: Vec::new(),
    };
    let start = course.reference(0.0).position;
    let nominal = feedforward(&with_fieldbus(model), course, &[], start)
        .and_then(|commands| replayed(&commands, &mut at_rest(crane, course)?, course));
    let cycle = Cycle::run(model, crane, course);
    report.add(Method::ClosedLoop, true, cycle.as_ref().map(|cycle| &cycle.errors));
    report.add(Method::NominalModel, true, nominal.as_ref().map(|(_, errors)| errors));
    let Ok(Cycle { estimated, record, errors, machine }) = cycle else { return Ok(report) };
    report.sustained_oscillation = oscillation(&errors.measured, record.period, course);
    report.stable = report.sustained_oscillation.is_none();
    let saturated = saturated_share(&record, model.numbers.motor_speed);
    if saturated > 0.0 {
        report.remarks.push(format!(
            "the motor's speed was at its limit in {:.1} % of the cycle: what it lacks there no correction makes up for",
            1e2 * saturated
        ));
    }
    let stroke = record.readings.first().map_or(start, |reading| reading.stroke);
    let from_rest = |model: &Description| {
        let commands = feedforward(model, course, &[], stroke)?;
        replayed(&commands, &mut at_rest(crane, course)?, course)
    };
    let estimated = with_fieldbus(&estimated);
    let on_line = from_rest(&estimated);
    report.add(Method::OnLineEstimates, true, on_line.as_ref().map(|(_, errors)| errors));
    let identified = match identified(&estimated, &record) {
        Ok(identified) => identified,
        Err(error) => {
            report.remarks.push(format!("nothing was identified, nor learned: {error}"));
            return Ok(report);
        }
    };
    report.identified = overrides(model, &without_fieldbus(&identified));
    for key in outside_range(model, &report.identified) {
        report.remarks.push(format!(
            "{key} is outside the crane file's range of it: widen the range there before it is used"
        ));
    }
    let fitted = from_rest(&identified);
    report.add(Method::IdentifiedModel, true, fitted.as_ref().map(|(_, errors)| errors));
    if let (Ok((_, nominal)), Ok((_, fitted))) = (&nominal, &fitted)
        && rms(&fitted.measured) > rms(&nominal.measured)
    {
        report.remarks.push(format!(
            "what was identified is not to be used: feedforward from it errs by {:.2} mm RMS as measured, from the nominal model by {:.2} mm",
            1e3 * rms(&fitted.measured),
            1e3 * rms(&nominal.measured)
        ));
    }
    let periods = record.commands.len();
    let settings = LearningSettings::default();
    let law = IterativeLearning::new(&identified, course, periods, settings);
    match law.and_then(|law| Ok((law.convergence(&identified, course, periods)?, law))) {
        Err(error) => report.remarks.push(format!("nothing was learned: {error}")),
        Ok((convergence, law)) => {
            if convergence.is_contraction() {
                for start in [Start::Rest(crane), Start::AsLeft(Box::new(machine.clone()))] {
                    report.learn(&law, &record, course, start);
                }
            } else {
                report.remarks.push(format!(
                    "learning is not applied: a cycle may enlarge the error at {} (by a factor of {:.2}; below 1 is needed)",
                    convergence.worst_case, convergence.worst
                ));
            }
            report.convergence = Some(convergence);
        }
    }
    // from the oil's state that the cycle has left
    let mut here = machine.clone();
    let on = feedforward(&identified, course, &record.commands, here.signals().stroke)
        .and_then(|commands| replayed(&commands, &mut here, course));
    report.add(Method::IdentifiedModel, false, on.as_ref().map(|(_, errors)| errors));
    let mut here = machine;
    let again = replayed(&record.commands, &mut here, course);
    report.add(Method::Replay, false, again.as_ref().map(|(_, errors)| errors));
    Ok(report)
}

impl CycleReport {
    /// Adds what a method comes to.
    fn add(&mut self, method: Method, reset: bool, errors: Result<&Errors, &LabError>) {
        if let Err(error) = errors {
            self.remarks.push(format!("{} could not be run: {error}", method.name()));
        }
        self.add_cycles(method, None, reset, errors.ok());
    }

    fn add_cycles(
        &mut self,
        method: Method,
        cycles: Option<usize>,
        reset: bool,
        errors: Option<&Errors>,
    ) {
        self.methods.push(MethodError {
            method,
            cycles,
            reset,
            rms_true_mm: errors.map(|errors| 1e3 * rms(&errors.true_error)),
            rms_measured_mm: errors.map(|errors| 1e3 * rms(&errors.measured)),
        });
    }

    /// Iterative learning control from the closed-loop cycle on.
    fn learn(
        &mut self,
        law: &IterativeLearning,
        first: &Record,
        course: &dyn Course,
        mut start: Start<'_>,
    ) {
        let reset = matches!(start, Start::Rest(_));
        let mut correction = law.learn(&law.no_correction(), &first.readings, course);
        let mut after_one = f64::INFINITY;
        for cycle in 1..=SHOWN_CYCLES[SHOWN_CYCLES.len() - 1] {
            let commands = law.corrected(&first.commands, &correction);
            let (record, errors) = match start.replayed(&commands, course, cycle) {
                Ok(found) => found,
                Err(error) => {
                    self.remarks.push(format!("cycle {cycle} of learning ended early: {error}"));
                    return;
                }
            };
            if SHOWN_CYCLES.contains(&cycle) {
                self.add_cycles(Method::IterativeLearning, Some(cycle), reset, Some(&errors));
            }
            let measured = rms(&errors.measured);
            after_one = if cycle == 1 { measured } else { after_one };
            if measured.is_nan() || measured > DIVERGING * after_one {
                self.remarks.push(format!(
                    "learning {} diverges: {:.2} mm RMS as measured after cycle {cycle}, {:.2} mm after the first; it is ended",
                    if reset { "from the same rest" } else { "without reset" },
                    1e3 * measured,
                    1e3 * after_one
                ));
                return;
            }
            correction = law.learn(&correction, &record.readings, course);
        }
    }
}

/// Learning is ended where a cycle errs by this many times what the first one did.
const DIVERGING: f64 = 2.0;

/// What a cycle of learning begins from.
enum Start<'a> {
    /// A crane of this description at rest where the course begins.
    Rest(&'a Description),
    /// The state that the cycle before has left.
    AsLeft(Box<VirtualCrane>),
}

impl Start<'_> {
    fn replayed(
        &mut self,
        commands: &[AxisCommand<f64>],
        course: &dyn Course,
        cycle: usize,
    ) -> Result<(Record, Errors), LabError> {
        match self {
            Self::Rest(crane) => {
                // the same crane, the noise of its sensors drawn anew
                let mut crane = (*crane).clone();
                crane.numbers.seed += cycle as f64;
                replayed(commands, &mut at_rest(&crane, course)?, course)
            }
            Self::AsLeft(machine) => replayed(commands, machine, course),
        }
    }
}

/// Overrides that are outside the range that a crane file states.
fn outside_range(model: &Description, identified: &[String]) -> Vec<String> {
    let is_outside = |assignment: &&String| {
        let Some((path, text)) = assignment.split_once('=') else { return false };
        let known = model.own_ranges().find(|(key, ..)| key.path() == path);
        let value: Option<f64> = text.parse().ok();
        known.zip(value).is_some_and(|((_, [low, high], from), value)| {
            from == RangeSource::File && !(low..=high).contains(&value)
        })
    };
    identified.iter().filter(is_outside).cloned().collect()
}

/// Share of the periods in which the commanded speed is at its limit \[rev/s\].
fn saturated_share(record: &Record, limit: f64) -> f64 {
    let at_limit = record.commands.iter().filter(|c| c.motor_speed.abs() >= limit * (1.0 - 1e-9));
    at_limit.count() as f64 / record.commands.len().max(1) as f64
}

/// The largest sustained oscillation of tracking errors \[m\], one each period \[s\], while the reference rests.
fn oscillation(errors: &[f64], period: f64, course: &dyn Course) -> Option<SustainedOscillation> {
    let mut state = OscillationState::default();
    let rests = |k: usize| course.reference(k as f64 * period).velocity == 0.0;
    let each = errors
        .iter()
        .enumerate()
        .filter_map(|(k, error)| SustainedOscillation::after(&mut state, *error, rests(k), period));
    each.max_by(|a, b| a.amplitude_mm.total_cmp(&b.amplitude_mm))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is replayed without a reset rests on it.
    #[test]
    fn the_same_commands_from_the_same_rest_lead_to_the_same_state() {
        let model = Description::uia_single_boom().unwrap();
        let crane = Description::uia_virtual().unwrap();
        let course = CourseChoice::Motion(model.numbers.fast).of(&crane).unwrap();
        let Cycle { record, machine, .. } = Cycle::run(&model, &crane, course.as_ref()).unwrap();
        let mut another = at_rest(&crane, course.as_ref()).unwrap();
        replayed(&record.commands, &mut another, course.as_ref()).unwrap();
        let [one, other] = [&machine, &another].map(|m| (m.truth().outputs, m.signals()));
        assert_eq!(one, other);
    }
}
