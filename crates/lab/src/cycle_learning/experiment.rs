//! Learning experiment: one closed-loop cycle under the scheduled LQR, identification from it, and tracking
//! errors with feedforward and iterative learning control.

use super::closed_loop_cycle::{Cycle, oscillation};
use super::drive_delay::with_drive;
use super::identification::{identified, overrides};
use super::identified_payload::IdentifiedPayload;
use super::iterative_learning_control::{Convergence, IterativeLearning};
use super::offline_feedforward::{feedforward, within_margins};
use super::record::Record;
use super::replay::{Errors, at_rest, replayed, rms};
use super::saturation::saturations;
use super::stages::Stages;
use super::usability::{beyond_ranges, outside_range, worse_than_nominal};
use crate::LabError;
use crate::closed_loop::controller_choice::ControllerChoice;
use crate::closed_loop::metrics::SustainedOscillation;
use crate::closed_loop::scenario::{Course, CourseChoice};
use crate::interruptible::as_long_as;
use hydroboom_control::command::AxisCommand;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_identify::Window;
use hydroboom_virtual_crane::{VirtualCrane, surrogate};
use serde::Serialize;
use std::sync::atomic::{AtomicU64, Ordering};

/// Numbers of learning cycles after which errors are reported, besides the last one (`learning.cycles`).
pub const SHOWN_CYCLES: [usize; 3] = [1, 3, 10];

/// Method that computes the motor speed of a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Scheduled LQR with feedback: the cycle from which the machine is identified.
    ClosedLoop,
    /// Feedforward from the model of the crane file.
    NominalModel,
    /// Feedforward from the model with the state estimator's results: payload and transition pressure
    /// (means over the second half of the cycle) and drive lag (at its end).
    OnLineEstimates,
    /// Feedforward from the model identified from the whole cycle.
    IdentifiedModel,
    /// Commands of the closed-loop cycle corrected by iterative learning control.
    IterativeLearning,
    /// Repetition of the closed-loop cycle's motor speed.
    Replay,
}

impl Method {
    /// Name in tables.
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

/// RMS tracking error of a cycle under one method.
#[derive(Clone, Debug, Serialize)]
pub struct MethodError {
    /// Method that computed the motor speed of the cycle.
    pub method: Method,
    /// Number of learning cycles before this one; none for methods without learning.
    pub cycles: Option<usize>,
    /// Whether the cycle starts from the same rest as the first one. Otherwise it starts from the state of the oil
    /// that the previous cycle left.
    pub reset: bool,
    /// RMS true tracking error \[mm\]; none if the cycle could not be run.
    pub rms_true_mm: Option<f64>,
    /// RMS measured tracking error \[mm\]; none if the cycle could not be run.
    pub rms_measured_mm: Option<f64>,
}

/// Results of one course on one machine.
#[derive(Clone, Debug, Serialize)]
pub struct CycleReport {
    /// Name of the machine.
    pub crane: String,
    /// Name of the course.
    pub course: String,
    /// Whether all methods were run; false for an experiment that was stopped.
    pub whole: bool,
    /// Whether the closed loop came to rest where its reference rested. False for a sustained oscillation,
    /// and if the cycle could not be run; none if it was not judged.
    pub stable: Option<bool>,
    /// Whether the linearised loop on the machine is stable over the stroke; none if it cannot be computed.
    pub has_stable_loops: Option<bool>,
    /// Sustained oscillation of the piston in the closed-loop cycle; none without one.
    pub sustained_oscillation: Option<SustainedOscillation>,
    /// RMS tracking errors of each method.
    pub methods: Vec<MethodError>,
    /// Contraction of iterative learning control per cycle; none if it was not computed.
    pub convergence: Option<Convergence>,
    /// Identified parameters, each as an override `section.key=value` of the model's crane file.
    pub identified: Vec<String>,
    /// Identified payload; none if it was not identified.
    pub payload: Option<IdentifiedPayload>,
    /// Whether the identified parameters may be used as overrides for other commands.
    pub usable: bool,
    /// Reason why the identified parameters may not be used as overrides; none if they may.
    pub unusable_because: Option<String>,
    /// Proposed commands, one per control period, by feedforward from a log's model. None if the machine does not come
    /// from a log, if learning would not converge or diverged, or if the nominal model's feedforward has the smaller
    /// error.
    #[serde(skip)]
    pub proposal: Option<Vec<AxisCommand<f64>>>,
    /// Remarks on the results, a sentence each.
    pub remarks: Vec<String>,
}

/// Learning experiment on each crane along each course: a closed-loop cycle, identification from it, and the tracking
/// errors of all methods. It runs on all cores. `go_on` receives the share done and returns whether to continue.
/// Otherwise the results so far are returned, and an incomplete report is marked.
///
/// # Errors
///
/// [`LabError::Scenario`] if a course has an unknown name. A cycle that cannot be run is no error: its tracking errors
/// are none.
pub fn learning_experiment(
    model: &Description,
    cranes: &[(String, Description)],
    courses: &[CourseChoice],
    go_on: &(dyn Fn(f64) -> bool + Sync),
) -> Result<Vec<CycleReport>, LabError> {
    let each =
        cranes.iter().map(|(name, crane)| Subject { name, crane, identified: None, payload: None });
    reports(model, &each.collect::<Vec<_>>(), courses, go_on)
}

/// Machine of an experiment.
#[derive(Clone, Copy)]
pub(crate) struct Subject<'a> {
    /// Name of the machine.
    pub name: &'a str,
    /// Virtual crane that represents the machine.
    pub crane: &'a Description,
    /// Model identified from a log; if none, the model is identified from the closed-loop cycle.
    pub identified: Option<&'a Description>,
    /// Payload of the model identified from a log; none if it was not identified.
    pub payload: Option<IdentifiedPayload>,
}

/// Reports of each course on each machine.
pub(crate) fn reports(
    model: &Description,
    subjects: &[Subject<'_>],
    courses: &[CourseChoice],
    go_on: &(dyn Fn(f64) -> bool + Sync),
) -> Result<Vec<CycleReport>, LabError> {
    let jobs: Vec<_> = subjects
        .iter()
        .flat_map(|subject| courses.iter().map(move |course| (subject, course)))
        .enumerate()
        .collect();
    let shares: Vec<AtomicU64> = jobs.iter().map(|_| AtomicU64::new(0)).collect();
    let all = || {
        let done: f64 = shares.iter().map(|s| f64::from_bits(s.load(Ordering::Relaxed))).sum();
        go_on(done / jobs.len().max(1) as f64)
    };
    let told = |job: usize, share: f64| {
        shares[job].store(share.to_bits(), Ordering::Relaxed);
        all()
    };
    let one = |(job, (subject, choice)): &(usize, (&Subject<'_>, &CourseChoice))| {
        let within = |share: f64| told(*job, share);
        let course = choice.of(subject.crane)?;
        let cycles = model.numbers.learning_cycles.round() as usize;
        let stages = Stages::new(USUAL_RUNS + 4 * cycles, &within);
        let report = CycleReport::of(model, **subject, course.as_ref(), &stages);
        within(1.0);
        report
    };
    as_long_as(&jobs, &|_| all(), one).into_iter().flatten().flat_map(Result::transpose).collect()
}

/// Number of simulations in a report without those of learning; the identification counts as
/// [`IDENTIFICATION`] of them.
const USUAL_RUNS: usize = 44;
/// Number of simulations that an identification counts as.
const IDENTIFICATION: f64 = 10.0;

/// Separates the request to stop from other errors.
fn unless_stopped<T>(found: Result<T, LabError>) -> Result<Result<T, LabError>, LabError> {
    match found {
        Err(LabError::Stopped) => Err(LabError::Stopped),
        found => Ok(found),
    }
}

impl CycleReport {
    /// Whether the closed loop is marked: its loop is unstable, or it was in sustained oscillation or could
    /// not be run.
    pub fn is_marked(&self) -> bool {
        self.stable == Some(false) || self.has_stable_loops == Some(false)
    }

    /// All methods on one machine; none if stopped before the closed-loop cycle was complete.
    fn of(
        model: &Description,
        subject: Subject<'_>,
        course: &dyn Course,
        stages: &Stages<'_>,
    ) -> Result<Option<Self>, LabError> {
        let mut report = Self {
            crane: subject.name.into(),
            course: course.name(),
            whole: true,
            stable: None,
            has_stable_loops: None,
            sustained_oscillation: None,
            methods: Vec::new(),
            convergence: None,
            identified: Vec::new(),
            payload: None,
            usable: false,
            unusable_because: Some("the machine was not identified".into()),
            proposal: None,
            remarks: Vec::new(),
        };
        match report.fill(model, subject, course, stages) {
            Err(LabError::Stopped) => report.whole = false,
            filled => filled?,
        }
        Ok(Some(report).filter(|report| !report.methods.is_empty()))
    }

    fn fill(
        &mut self,
        model: &Description,
        subject: Subject<'_>,
        course: &dyn Course,
        stages: &Stages<'_>,
    ) -> Result<(), LabError> {
        let crane = subject.crane;
        let closed_loop = ControllerChoice::from(Strategy::ScheduledLqr);
        self.has_stable_loops = closed_loop.has_stable_loops(model, crane);
        stages.within(0.0)?;
        let start = course.reference(0.0).position;
        let described = with_drive(model);
        let cycle = unless_stopped(Cycle::run(model, crane, course, stages))?;
        // judged at once, so that an interruption later on does not leave it open
        self.sustained_oscillation = cycle
            .as_ref()
            .ok()
            .and_then(|cycle| oscillation(&cycle.errors.measured, cycle.record.period, course));
        self.stable = Some(cycle.is_ok() && self.sustained_oscillation.is_none());
        self.add(Method::ClosedLoop, true, cycle.as_ref().map(|cycle| &cycle.errors));
        let run_from_rest = |model: &Description, stroke: f64| {
            let commands = feedforward(model, course, &[], stroke, stages)?;
            let (_, errors) = replayed(&commands, &mut at_rest(crane, course)?, course, stages)?;
            Ok((commands, errors))
        };
        let nominal = unless_stopped(run_from_rest(&described, start))?.map(|(_, errors)| errors);
        self.add(Method::NominalModel, true, nominal.as_ref());
        let Ok(Cycle { estimated, record, machine, .. }) = cycle else { return Ok(()) };
        let stroke = record.readings.first().map_or(start, |reading| reading.stroke);
        let on_line = unless_stopped(run_from_rest(&estimated, stroke))?.map(|(_, errors)| errors);
        self.add(Method::OnLineEstimates, true, on_line.as_ref());
        let Some((identified, payload)) = self.identify(subject, &estimated, &record, stages)?
        else {
            return Ok(());
        };
        stages.done(IDENTIFICATION);
        (self.identified, self.payload) = (overrides(model, &identified), payload);
        self.judge_use(Some("it was interrupted before feedforward from it was run".into()));
        let outside = outside_range(model, &self.identified);
        for key in &outside {
            self.remarks.push(format!(
                "{key} is outside the crane file's range: widen the range there before it is used"
            ));
        }
        let asked: Vec<f64> = record.commands.iter().map(|command| command.motor_speed).collect();
        self.remarks.extend(saturations(&identified, &asked, record.period));
        let fitted = unless_stopped(run_from_rest(&identified, stroke))?;
        self.add(Method::IdentifiedModel, true, fitted.as_ref().map(|(_, errors)| errors));
        let fitted_mm = fitted.as_ref().map(|(_, errors)| 1e3 * rms(&errors.measured));
        let nominal_mm = nominal.as_ref().map(|errors| 1e3 * rms(&errors.measured));
        let worse = worse_than_nominal(fitted_mm.ok(), nominal_mm.ok());
        let is_better = worse.is_none();
        self.judge_use(match fitted.is_ok() {
            true => worse.or_else(|| beyond_ranges(&outside)),
            false => Some("feedforward from it could not be run".into()),
        });
        let converged =
            self.learn_if_convergent(&identified, &record, course, crane, &machine, stages)?;
        let may_propose = is_better && converged && subject.identified.is_some();
        self.proposal = fitted.ok().map(|(commands, _)| commands).filter(|_| may_propose);
        self.run_as_left(&identified, &record, course, machine, stages)
    }

    /// Model of the machine and its payload: known from a log, or identified from the closed-loop cycle; none if that
    /// failed.
    fn identify(
        &mut self,
        subject: Subject<'_>,
        estimated: &Description,
        record: &Record,
        stages: &Stages<'_>,
    ) -> Result<Option<(Description, Option<IdentifiedPayload>)>, LabError> {
        if let Some(known) = subject.identified {
            return Ok(Some((known.clone(), subject.payload)));
        }
        let (log, signals) = record.log();
        let found = identified(estimated, (&log, &signals), Window::default(), stages);
        Ok(match unless_stopped(found)? {
            Ok(found) => Some((found.model, found.payload)),
            Err(error) => {
                self.remarks.push(format!(
                    "the identification failed, and no correction was learned: {error}"
                ));
                None
            }
        })
    }

    /// Iterative learning control from the same rest and without a reset, if its law contracts; whether learning from
    /// rest did not diverge.
    fn learn_if_convergent(
        &mut self,
        identified: &Description,
        first: &Record,
        course: &dyn Course,
        crane: &Description,
        machine: &VirtualCrane,
        stages: &Stages<'_>,
    ) -> Result<bool, LabError> {
        let periods = first.commands.len();
        let law = IterativeLearning::new(identified, course, periods);
        let checked =
            law.and_then(|law| Ok((law.convergence(identified, course, periods, stages)?, law)));
        let (convergence, law) = match unless_stopped(checked)? {
            Ok(found) => found,
            Err(error) => {
                self.remarks.push(format!("no correction was learned: {error}"));
                return Ok(false);
            }
        };
        let mut converged = convergence.is_contraction();
        if converged {
            for start in [Start::Rest(crane), Start::AsLeft(Box::new(machine.clone()))] {
                let from_rest = matches!(start, Start::Rest(_));
                let diverged = self.learn((&law, identified), first, course, start, stages)?;
                converged &= !(from_rest && diverged);
            }
        } else {
            self.remarks.push(format!(
                "learning is not applied: the correction need not converge at {} (its contraction is {:.2}; below 1 is needed)",
                convergence.worst_case, convergence.worst
            ));
        }
        self.convergence = Some(convergence);
        Ok(converged)
    }

    /// Feedforward and replay from the state of the oil that the closed-loop cycle left.
    fn run_as_left(
        &mut self,
        identified: &Description,
        record: &Record,
        course: &dyn Course,
        mut machine: VirtualCrane,
        stages: &Stages<'_>,
    ) -> Result<(), LabError> {
        let mut here = machine.clone();
        let stroke = here.signals().stroke;
        let on = feedforward(identified, course, &record.commands, stroke, stages)
            .and_then(|commands| replayed(&commands, &mut here, course, stages));
        let on = unless_stopped(on)?;
        self.add(Method::IdentifiedModel, false, on.as_ref().map(|(_, errors)| errors));
        let again = unless_stopped(replayed(&record.commands, &mut machine, course, stages))?;
        self.add(Method::Replay, false, again.as_ref().map(|(_, errors)| errors));
        Ok(())
    }

    /// Notes whether the identified parameters may be used, given a reason why not.
    fn judge_use(&mut self, unusable_because: Option<String>) {
        self.usable = unusable_because.is_none();
        self.unusable_because = unusable_because;
    }

    /// Adds the result of a method.
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

    /// Iterative learning control, starting with the closed-loop cycle; whether it diverged.
    fn learn(
        &mut self,
        (law, model): (&IterativeLearning, &Description),
        first: &Record,
        course: &dyn Course,
        mut start: Start<'_>,
        stages: &Stages<'_>,
    ) -> Result<bool, LabError> {
        let reset = matches!(start, Start::Rest(_));
        let mut correction = law.learn(&law.no_correction(), &first.readings, course);
        let mut after_one = f64::INFINITY;
        let last = model.numbers.learning_cycles.round() as usize;
        for cycle in 1..=last {
            let commands = law.corrected(&first.commands, &correction);
            // commands are tested on the model before they are applied to the machine
            let margins = at_rest(&surrogate(model), course)
                .and_then(|machine| within_margins(model, &commands, machine, course, stages));
            let cycled = margins.and_then(|()| start.replayed(&commands, course, cycle, stages));
            let (record, errors) = match unless_stopped(cycled)? {
                Ok(found) => found,
                Err(error) => {
                    self.remarks.push(format!("cycle {cycle} of learning ended early: {error}"));
                    return Ok(false);
                }
            };
            if SHOWN_CYCLES.contains(&cycle) || cycle == last {
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
                return Ok(true);
            }
            correction = law.learn(&correction, &record.readings, course);
        }
        Ok(false)
    }
}

/// Ratio to the first cycle's error above which learning is stopped.
const DIVERGING: f64 = 2.0;

/// Initial state of a learning cycle.
enum Start<'a> {
    /// Crane of this description, at rest at the start of the course.
    Rest(&'a Description),
    /// State that the previous cycle left.
    AsLeft(Box<VirtualCrane>),
}

impl Start<'_> {
    fn replayed(
        &mut self,
        commands: &[AxisCommand<f64>],
        course: &dyn Course,
        cycle: usize,
        stages: &Stages<'_>,
    ) -> Result<(Record, Errors), LabError> {
        match self {
            Self::Rest(crane) => {
                // the same crane with another realisation of the sensor noise
                let mut crane = (*crane).clone();
                crane.numbers.seed += cycle as f64;
                replayed(commands, &mut at_rest(&crane, course)?, course, stages)
            }
            Self::AsLeft(machine) => replayed(commands, machine, course, stages),
        }
    }
}
