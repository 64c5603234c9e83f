//! Who looks on while a machine runs: writes the log, sums the courses up, asks for the next one.

use crate::origin::origin;
use crate::output;
use hydroboom_control::reference::trajectory::Trajectory;
use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::limits::MachineStatus;
use hydroboom_control::supervision::oscillation_detector::OscillationState;
use hydroboom_control::supervision::supervisor::{Decision, State};
use hydroboom_control::supervision::waiting::Waiting;
use hydroboom_dashboard::{self as dashboard, Choice, Dashboard, Demand};
use hydroboom_lab::closed_loop::metrics::{REACHED, SustainedOscillation, TrackingError};
use hydroboom_realtime::control_task::{Fallback, Record};
use hydroboom_realtime::desk::{Desk, Generation};
use hydroboom_realtime::failure::Failure;
use hydroboom_realtime::log::{LogError, LogWriter};
use hydroboom_realtime::readiness::start_waits_for;
use hydroboom_realtime::session::{Attendant, Hung, Order, Session};
use hydroboom_realtime::trouble::Tampering;
use hydroboom_virtual_crane::Truth;
use miette::{IntoDiagnostic, Result};
use serde::Serialize;
use serde_json::json;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// What a course came to.
#[derive(Clone, Debug, Serialize)]
pub struct CourseResult {
    /// Name of its path.
    pub course: String,
    /// The strategy it began with.
    pub strategy: &'static str,
    /// The one it ended with, if it was another.
    pub then: Option<&'static str>,
    /// When it began.
    pub begun_s: f64,
    /// Tracking error, the way to the course's beginning left out; no true one of a machine in another process.
    #[serde(flatten)]
    pub error: TrackingError,
    /// Whether the loop came to rest where its reference rested: false in a sustained oscillation, and where a fault ended the course.
    pub stable: bool,
    /// Whether it ended in half-cycles that had not died out, too few to tell a sustained oscillation: the load was held then.
    pub may_oscillate: bool,
    /// That oscillation, the largest that the supervisor found.
    pub sustained_oscillation: Option<SustainedOscillation>,
    /// Code of the fault that ended it.
    pub fault: Option<&'static str>,
    /// Whether the benchmark had to take over.
    pub fallback: bool,
    /// Why it last had to.
    pub fallback_cause: Option<&'static str>,
    /// Memory that the program had at its end.
    pub memory_mb: Option<f64>,
}

/// A path to be run, with a name and what is hung on meanwhile.
#[derive(Clone)]
pub struct Wanted {
    /// Name.
    pub name: String,
    /// Where the piston shall be.
    pub path: Arc<dyn Trajectory>,
    /// Payloads.
    pub hung: Vec<Hung>,
}

/// Which strategy when.
#[derive(Clone, Copy)]
pub struct Switch {
    /// At first.
    pub first: Strategy,
    /// Later.
    pub then: Strategy,
    /// From this time of the course on \[s\].
    pub at: f64,
}

impl Switch {
    fn at_time(&self, course_time: Option<f64>) -> Strategy {
        if course_time.is_some_and(|time| time >= self.at) { self.then } else { self.first }
    }
}

/// The course that runs.
struct Running {
    strategy: Strategy,
    then: Strategy,
    begun: f64,
    measured: Errors,
    truth: Errors,
    fallback: Option<Fallback>,
    oscillation: Option<SustainedOscillation>,
    /// Largest command in it \[rev/s\].
    largest_command: f64,
    /// The same detector, for what begins as the course ends.
    detector: OscillationState<f64>,
    /// Time of the last error \[s\].
    at: f64,
}

/// How often a course shall be run by itself.
#[derive(Clone, Copy)]
pub struct Plan {
    /// Courses that are still to be begun.
    pub left: u32,
    /// Whether faults are reset.
    pub carry_on: bool,
    /// Whether the first one waits for somebody.
    pub waits: bool,
}

/// Looks on.
pub struct Watch {
    session: Session,
    desk: Arc<Desk>,
    wanted: Wanted,
    switch: Option<Switch>,
    plan: Option<Plan>,
    log: Option<LogWriter>,
    /// Why the log was given up.
    lost_log: Option<LogError>,
    speaks: bool,
    state: Option<State>,
    /// State that the machine reported last.
    status: Option<MachineStatus>,
    /// What it was said last that the machine waits for.
    waiting: Option<Waiting>,
    /// Whether the loop was in sustained oscillation in the period before.
    oscillates: bool,
    running: Option<Running>,
    /// Records of the last course, from the request to the load held.
    pub records: Vec<Record>,
    /// Courses that are over.
    pub results: Vec<CourseResult>,
    /// Since when nothing moves \[s\].
    resting: Option<f64>,
    /// What is to be handed over.
    orders: Vec<Order>,
    /// A start that is asked for once these orders are handed over.
    start: Option<Start>,
    /// Since when a start is asked for that has not been taken up \[s\].
    asked: Option<f64>,
    /// Where the piston is in the period to come \[m\], where that is known.
    truth: Option<f64>,
    dashboard: Option<(Dashboard, Courses)>,
    /// Whether somebody has let the plan begin.
    started: Arc<AtomicBool>,
}

/// Finds the path of a course that somebody at the dashboard wants.
pub type Courses = Box<dyn Fn(&dashboard::Course) -> Result<Wanted>>;

/// A start that somebody asked for.
struct Start {
    generation: Generation,
    asked: Instant,
    strategy: Strategy,
}

/// A start that is not taken up within this time and a moment more was dropped \[s\].
const TAKEN_UP: f64 = Desk::START_WITHIN + 0.1;
/// A state that waits is silent for so long \[s\].
const SILENT: f64 = 2.0;
/// After a course, or a fault, so long until the next one \[s\].
const PAUSE: f64 = 1.0;
/// More records of one course are not kept: twenty minutes.
const MOST_RECORDS: usize = 1_200_000;

impl Watch {
    /// A watch over a session with a path wanted.
    pub fn new(session: Session, desk: Arc<Desk>, wanted: Wanted) -> Self {
        Self {
            session,
            desk,
            wanted,
            switch: None,
            plan: None,
            log: None,
            lost_log: None,
            speaks: false,
            state: None,
            status: None,
            waiting: None,
            oscillates: false,
            running: None,
            records: Vec::with_capacity(40_000),
            results: Vec::new(),
            resting: None,
            orders: Vec::new(),
            start: None,
            asked: None,
            truth: None,
            dashboard: None,
            started: Arc::new(AtomicBool::new(false)),
        }
    }

    /// Shows all to a dashboard, and does what is asked for there.
    pub fn with_dashboard(mut self, dashboard: Dashboard, courses: Courses) -> Self {
        self.dashboard = Some((dashboard, courses));
        self
    }

    /// Writes a log.
    pub fn with_log(mut self, log: Option<LogWriter>) -> Self {
        self.log = log;
        self
    }

    /// Changes the strategy on the way.
    pub fn with_switch(mut self, switch: Switch) -> Self {
        self.switch = Some(switch);
        self
    }

    /// Says on the screen what the machine does.
    pub fn speaking(mut self) -> Self {
        self.speaks = true;
        self
    }

    /// Runs the path so often, then closes the desk.
    pub fn with_plan(mut self, plan: Plan) -> Self {
        self.plan = Some(plan);
        self
    }

    /// Prepares the wanted path as the first course.
    ///
    /// # Errors
    ///
    /// When the model has no state of rest there.
    pub fn prepare(&mut self) -> Result<()> {
        let (path, hung) = (Arc::clone(&self.wanted.path), self.wanted.hung.clone());
        self.orders.extend(self.session.prepare(path, hung).into_diagnostic()?);
        Ok(())
    }

    /// What lets a plan begin that waits.
    pub fn starter(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.started)
    }

    /// What the session knows.
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// Ends the log; says why it is not whole.
    pub fn close_log(&mut self) -> Option<LogError> {
        let ended = self.log.take().and_then(|log| log.finish().err());
        self.lost_log.take().or(ended)
    }
}

impl Attendant for Watch {
    fn see(&mut self, record: &Record) {
        self.session.see(record);
        self.write(record);
        let (before, now) = (self.state, record.decision.state);
        if before != Some(now) {
            self.changed(before, record);
        }
        if let Some(switch) = &self.switch {
            self.desk.choose(switch.at_time(record.course_time));
        }
        self.say_status(record);
        self.say_waiting(&record.decision);
        self.say_oscillation(record.decision.oscillation);
        if record.decision.releasing && self.running.is_none() {
            self.begin(record);
        }
        let truth = self.truth.take();
        if let (Some(running), Some(error)) = (&mut self.running, record.error()) {
            running.add(record, error * 1e3);
            if let Some(stroke) = truth {
                running.truth.add((stroke - record.reference.position) * 1e3);
            }
        }
        if self.running.is_some() && self.records.len() < MOST_RECORDS {
            self.records.push(*record);
        }
        let rests = matches!(now, State::Holding | State::Fault)
            && record.decision.is_at_rest()
            && !record.decision.releasing;
        self.resting = if rests { self.resting.or(Some(record.time)) } else { None };
        if let Some((dashboard, _)) = &mut self.dashboard {
            dashboard.see(record);
        }
    }

    fn see_truth(&mut self, truth: &Truth) {
        self.truth = Some(truth.outputs.stroke);
    }

    fn orders(&mut self) -> Vec<Order> {
        self.ask();
        self.follow_plan();
        self.follow_demands();
        let mut orders = std::mem::take(&mut self.orders);
        orders.extend(self.session.orders());
        orders
    }

    fn failed(&mut self, failure: &Failure) {
        self.say(&failure.to_string());
        // no reset brings the control task back; who looks at a dashboard ends the session himself
        if matches!(failure, Failure::Control(_)) && self.dashboard.is_none() {
            self.desk.close();
        }
    }
}

impl Running {
    fn add(&mut self, record: &Record, error_mm: f64) {
        if self.measured.count == 0 {
            self.strategy = record.strategy;
        }
        self.then = record.strategy;
        self.measured.add(error_mm);
        let (rests, elapsed) = (record.reference.velocity == 0.0, record.time - self.at);
        self.at = record.time;
        // found is what the supervisor finds; this one is asked at the end
        let _ = SustainedOscillation::after(&mut self.detector, -1e-3 * error_mm, rests, elapsed);
        self.fallback = record.fallback.or(self.fallback);
        if let Some([amplitude, frequency_hz]) = record.decision.oscillation {
            let now = SustainedOscillation {
                amplitude_mm: amplitude * 1e3,
                frequency_hz,
                motor_at_limit: false,
            };
            self.largest_command =
                self.largest_command.max(record.decision.command.motor_speed.abs());
            let is_larger =
                self.oscillation.is_none_or(|before| now.amplitude_mm > before.amplitude_mm);
            self.oscillation = if is_larger { Some(now) } else { self.oscillation };
        }
    }
}

/// Errors along a course.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    /// Sum of squares \[mm²\].
    sum: f64,
    count: u32,
    /// That of largest magnitude \[mm\].
    peak: f64,
}

impl Errors {
    fn add(&mut self, mm: f64) {
        self.sum += mm * mm;
        self.count += 1;
        if mm.abs() > self.peak.abs() {
            self.peak = mm;
        }
    }

    /// RMS and peak \[mm\]; none where there was none of them.
    fn rms_and_peak(&self) -> Option<[f64; 2]> {
        (self.count > 0).then(|| [(self.sum / f64::from(self.count)).sqrt(), self.peak])
    }
}

impl Watch {
    /// Adds a record to the log; a log that cannot be written is given up, and the run goes on.
    fn write(&mut self, record: &Record) {
        let Some(mut writer) = self.log.take() else { return };
        let Err(error) = writer.add(record) else {
            self.log = Some(writer);
            return;
        };
        match writer.leave() {
            Ok(kept) => self.say(&format!(
                "the log ends here, what was written is in {}: {error}",
                kept.display()
            )),
            Err(lost) => self.say(&format!("the log ends here, and is lost: {error}; {lost}")),
        }
        self.lost_log = Some(error);
    }

    fn say(&mut self, text: &str) {
        output::note(text);
        if let Some((dashboard, _)) = &mut self.dashboard {
            dashboard.say(text);
        }
    }

    /// Says what the machine reports of itself, when that changes.
    fn say_status(&mut self, record: &Record) {
        if record.status == self.status {
            return;
        }
        self.status = record.status;
        let Some(status) = record.status.filter(|_| self.speaks) else { return };
        let fault = match status {
            MachineStatus::Fault { code } => {
                format!(" of code {code:#06x}: it is reset at the machine, by a person")
            }
            _ => String::new(),
        };
        self.say(&format!("{:8.3} s  the machine reports: {}{fault}", record.time, status.name()));
    }

    /// Says what the machine waits for once it has waited for a while; a held load may wait for a start.
    fn say_waiting(&mut self, decision: &Decision) {
        let usual = matches!(
            decision.waiting,
            Waiting::Start | Waiting::CourseEnd | Waiting::Lift | Waiting::Enable | Waiting::Reset
        );
        if !self.speaks
            || usual
            || decision.waited < SILENT
            || self.waiting == Some(decision.waiting)
        {
            return;
        }
        self.waiting = Some(decision.waiting);
        let (state, text) = (decision.state.name(), decision.waiting.text());
        self.say(&format!("{state} waits for {text}, since {:.0} s", decision.waited));
    }

    /// Says that the loop is in sustained oscillation, once in a course.
    fn say_oscillation(&mut self, oscillation: Option<[f64; 2]>) {
        let is_new = oscillation.is_some() && !self.oscillates;
        self.oscillates = oscillation.is_some();
        if let (Some([amplitude, frequency]), true) = (oscillation, is_new && self.speaks) {
            self.say(&format!(
                "the loop is in sustained oscillation: {:.1} mm at {frequency:.2} Hz",
                amplitude * 1e3
            ));
        }
    }

    fn begin(&mut self, record: &Record) {
        self.asked = None;
        if let Some(plan) = &mut self.plan {
            plan.left = plan.left.saturating_sub(1);
        }
        self.records.clear();
        self.running = Some(Running {
            strategy: record.strategy,
            then: record.strategy,
            begun: record.time,
            measured: Errors::default(),
            truth: Errors::default(),
            fallback: None,
            oscillation: None,
            largest_command: 0.0,
            detector: OscillationState::default(),
            at: record.time,
        });
    }

    fn changed(&mut self, before: Option<State>, record: &Record) {
        let now = record.decision.state;
        self.state = Some(now);
        self.waiting = None;
        if self.speaks {
            match record.decision.cause {
                Some(cause) if now == State::Fault => {
                    let (code, advice) = (cause.code(), cause.advice());
                    output::note(&format!("{:8.3} s  Fault: {code}: {advice}", record.time));
                }
                _ => output::note(&format!("{:8.3} s  {}", record.time, now.name())),
            }
        }
        let is_over = match before {
            Some(State::Stopping) => now == State::Holding,
            _ => now == State::Fault,
        };
        if is_over && let Some(running) = self.running.take() {
            self.end(&running, record);
        }
        if now == State::Fault
            && let (Some((dashboard, _)), Some(fault)) = (&mut self.dashboard, self.session.fault())
        {
            dashboard.alarm(fault);
        }
    }

    fn end(&mut self, running: &Running, record: &Record) {
        let [rms_measured_mm, peak_measured_mm] =
            running.measured.rms_and_peak().unwrap_or_default();
        let [rms_true_mm, peak_true_mm] = running.truth.rms_and_peak().unwrap_or([f64::NAN; 2]);
        let result = CourseResult {
            course: self.wanted.name.clone(),
            strategy: running.strategy.name(),
            then: (running.then != running.strategy).then(|| running.then.name()),
            begun_s: running.begun,
            // a course that a fault ended was not followed to its end: its errors are no result
            error: match record.decision.cause {
                Some(_) => TrackingError::UNFINISHED,
                None => {
                    TrackingError { rms_true_mm, rms_measured_mm, peak_true_mm, peak_measured_mm }
                }
            },
            stable: running.oscillation.is_none() && record.decision.cause.is_none(),
            may_oscillate: running.oscillation.is_none()
                && record.decision.cause.is_none()
                && running.detector.half_cycles > 0.5,
            sustained_oscillation: running.oscillation.map(|found| SustainedOscillation {
                motor_at_limit: running.largest_command
                    >= REACHED * self.session.model().numbers.motor_speed,
                ..found
            }),
            fault: record.decision.cause.map(|cause| cause.code()),
            fallback: running.fallback.is_some(),
            fallback_cause: running.fallback.map(Fallback::name),
            memory_mb: memory_mb(),
        };
        if let Some((dashboard, _)) = &mut self.dashboard {
            dashboard.result(&json!(result));
            match super::page::course_page(&result, &self.records) {
                Ok(page) => dashboard.set_report(page.html(&origin(None))),
                Err(error) => dashboard.say(&format!("no report: {error}")),
            }
        }
        self.results.push(result);
    }

    /// Begins the next course of the plan, or ends it.
    fn follow_plan(&mut self) {
        let (Some(plan), Some(since)) = (self.plan, self.resting) else { return };
        let Some(last) = self.session.last().copied() else { return };
        let is_due = last.time - since >= PAUSE || self.results.is_empty();
        let is_asked = self.start.is_some() || self.asked.is_some();
        if !is_due || is_asked || (plan.waits && !self.started.load(Ordering::Relaxed)) {
            return;
        }
        let is_fault = last.decision.state == State::Fault;
        if self.desk.is_closing() || (is_fault && !plan.carry_on) {
            self.desk.close();
        } else if is_fault {
            output::note(&format!("{:8.3} s  reset, because it shall carry on", last.time));
            self.desk.reset();
            self.resting = None;
        } else if plan.left == 0 {
            self.desk.close();
        } else if self.session.is_ready() {
            self.prepare_start(Start {
                generation: self.desk.generation(),
                asked: Instant::now(),
                strategy: self.desk.strategy(),
            });
        }
    }

    /// Prepares what is wanted, to be started once it is handed over.
    fn prepare_start(&mut self, start: Start) {
        match self.prepare() {
            Ok(()) => self.start = Some(start),
            Err(error) => self.say(&format!("no start: {error}")),
        }
    }

    /// Asks for the start whose course has been handed over, and says what became of the last one.
    fn ask(&mut self) {
        let Some(last) = self.session.last() else { return };
        let (now, state) = (last.time, last.decision.state);
        if let Some(start) = self.start.take() {
            let within = Desk::START_WITHIN - start.asked.elapsed().as_secs_f64();
            if within <= 0.0 {
                self.say("no start: it took longer than a second to prepare; ask for it again");
            } else if self.desk.start_in(start.generation, within) {
                self.desk.choose(start.strategy);
                self.asked = Some(now);
            } else {
                self.say("no start: since it was asked for the operator changed, or an emergency stop came");
            }
        }
        if self.asked.is_some_and(|since| now - since > TAKEN_UP) {
            self.asked = None;
            let name = state.name();
            self.say(&format!("no start: in {name} it was not taken up within a second"));
        }
    }

    fn follow_demands(&mut self) {
        let Some((dashboard, _)) = &mut self.dashboard else { return };
        for demand in dashboard.demands() {
            match demand {
                Demand::Start { choice, generation, asked } => {
                    self.start_as_chosen(&choice, generation, asked);
                }
                Demand::Fault(fault) => self.orders.push(Order::Tamper(Tampering::Fault(fault))),
                Demand::Mend => self.orders.push(Order::Tamper(Tampering::Mend)),
            }
        }
    }

    /// Prepares what an operator has asked for, if a course can be begun now.
    fn start_as_chosen(&mut self, choice: &Choice, generation: Generation, asked: Instant) {
        let Some((_, courses)) = &self.dashboard else { return };
        let Some(last) = self.session.last() else {
            return self.say("no start: nothing has been read of the machine yet");
        };
        if !self.session.is_ready() || self.start.is_some() || self.asked.is_some() {
            let waits = start_waits_for(&last.decision, self.desk.is_attended());
            let waits = waits.unwrap_or("a start that was asked for before");
            let state = last.decision.state.name();
            return self.say(&format!("no start: the machine is in {state} and waits for {waits}"));
        }
        match courses(&choice.course) {
            Ok(wanted) => {
                self.wanted = wanted;
                self.prepare_start(Start { generation, asked, strategy: choice.strategy });
            }
            Err(error) => self.say(&format!("no start: {error}")),
        }
    }
}

/// Memory of this process that is in use.
fn memory_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:"))?;
    line.split_whitespace().nth(1)?.parse::<f64>().ok().map(|kilobytes| kilobytes / 1024.0)
}
