//! Attendant of a run: writes the log, summarises the courses, and starts the next one.

use super::bus_log::BusLog;
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
use hydroboom_realtime::session::{Attendant, Order, PayloadChange, Session};
use hydroboom_realtime::trouble::Tampering;
use hydroboom_virtual_crane::Truth;
use miette::{IntoDiagnostic, Result};
use serde::Serialize;
use serde_json::json;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Result of a course.
#[derive(Clone, Debug, Serialize)]
pub struct CourseResult {
    /// Name of the trajectory.
    pub course: String,
    /// Strategy at its start.
    pub strategy: &'static str,
    /// Strategy at its end, if another.
    pub then: Option<&'static str>,
    /// Time of its start.
    pub begun_s: f64,
    /// Tracking error without the approach to the course's start. The true error is unknown for a machine
    /// in another process.
    #[serde(flatten)]
    pub error: TrackingError,
    /// Whether the loop came to rest where its reference rested: false for a sustained oscillation, and if
    /// a fault ended the course.
    pub stable: bool,
    /// Whether the last half-cycles had not decayed but were too few for a sustained oscillation when the
    /// load was held.
    pub may_oscillate: bool,
    /// Largest sustained oscillation found by the supervisor, if any.
    pub sustained_oscillation: Option<SustainedOscillation>,
    /// Code of the fault that ended it, if any.
    pub fault: Option<&'static str>,
    /// Whether the benchmark controller took over.
    pub fallback: bool,
    /// Last reason for that.
    pub fallback_cause: Option<&'static str>,
    /// Memory of the program at its end.
    pub memory_mb: Option<f64>,
}

/// Requested trajectory with its name and payload changes.
#[derive(Clone)]
pub struct RequestedCourse {
    /// Name.
    pub name: String,
    /// Trajectory of the piston.
    pub path: Arc<dyn Trajectory>,
    /// Payload changes.
    pub payload_changes: Vec<PayloadChange>,
}

/// Change of strategy during a course.
#[derive(Clone, Copy)]
pub struct Switch {
    /// First strategy.
    pub first: Strategy,
    /// Second strategy.
    pub then: Strategy,
    /// Time of the course at the change \[s\].
    pub at: f64,
}

impl Switch {
    fn at_time(&self, course_time: Option<f64>) -> Strategy {
        if course_time.is_some_and(|time| time >= self.at) { self.then } else { self.first }
    }
}

/// Present course.
struct Running {
    strategy: Strategy,
    then: Strategy,
    begun: f64,
    measured: Errors,
    truth: Errors,
    fallback: Option<Fallback>,
    oscillation: Option<SustainedOscillation>,
    /// Largest command of the course \[rev/s\].
    largest_command: f64,
    /// Detector of an oscillation that begins at the end of the course.
    detector: OscillationState<f64>,
    /// Time of the last error \[s\].
    at: f64,
}

/// Plan of automatic courses.
#[derive(Clone, Copy)]
pub struct Plan {
    /// Courses that remain.
    pub left: u32,
    /// Whether faults are reset.
    pub carry_on: bool,
    /// Whether the first course waits for the operator.
    pub waits: bool,
}

/// Attendant of a run.
pub struct Watch {
    session: Session,
    desk: Arc<Desk>,
    wanted: RequestedCourse,
    switch: Option<Switch>,
    plan: Option<Plan>,
    log: Option<LogWriter>,
    /// Log of a bus.
    bus_log: Option<BusLog>,
    /// Error after which the log was abandoned.
    lost_log: Option<LogError>,
    speaks: bool,
    state: Option<State>,
    /// Last state reported by the machine.
    status: Option<MachineStatus>,
    /// Last reported waiting condition.
    waiting: Option<Waiting>,
    /// Whether the loop was in sustained oscillation in the last period.
    oscillates: bool,
    running: Option<Running>,
    /// Records of the last course, from the request to the held load.
    pub records: Vec<Record>,
    /// Completed courses.
    pub results: Vec<CourseResult>,
    /// Time since which nothing moves \[s\].
    resting: Option<f64>,
    /// Orders to pass on.
    orders: Vec<Order>,
    /// Start to request after these orders have been passed on.
    start: Option<Start>,
    /// Time since which a start is requested and not accepted \[s\].
    asked: Option<f64>,
    /// True piston position in the coming period \[m\], if known.
    truth: Option<f64>,
    dashboard: Option<(Dashboard, Courses)>,
    /// Whether the operator has released the plan.
    started: Arc<AtomicBool>,
}

/// Builder of the trajectory of a course requested at the dashboard.
pub type Courses = Box<dyn Fn(&dashboard::Course) -> Result<RequestedCourse>>;

/// Requested start.
struct Start {
    generation: Generation,
    asked: Instant,
    strategy: Strategy,
}

/// Time after which a request that was not accepted has been dropped \[s\].
const TAKEN_UP: f64 = Desk::START_WITHIN + 0.1;
/// Time after which a waiting state is reported \[s\].
const REPORT_AFTER: f64 = 2.0;
/// Pause after a course or a fault \[s\].
const PAUSE: f64 = 1.0;
/// Largest number of records kept of a course: twenty minutes.
const MOST_RECORDS: usize = 1_200_000;

impl Watch {
    /// Attendant of a session with a requested trajectory.
    pub fn new(session: Session, desk: Arc<Desk>, wanted: RequestedCourse) -> Self {
        Self {
            session,
            desk,
            wanted,
            switch: None,
            plan: None,
            log: None,
            bus_log: None,
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

    /// Connects a dashboard, whose requests are executed.
    pub fn with_dashboard(mut self, dashboard: Dashboard, courses: Courses) -> Self {
        self.dashboard = Some((dashboard, courses));
        self
    }

    /// Writes a log.
    pub fn with_log(mut self, log: Option<LogWriter>) -> Self {
        self.log = log;
        self
    }

    /// Logs the cycles of a bus, too.
    pub fn with_bus_log(mut self, bus_log: Option<BusLog>) -> Self {
        // without a log its cycles would remain in their queue
        self.bus_log = bus_log.filter(|_| self.log.is_some());
        self
    }

    /// Changes the strategy during each course.
    pub fn with_switch(mut self, switch: Switch) -> Self {
        self.switch = Some(switch);
        self
    }

    /// Prints what the machine does.
    pub fn speaking(mut self) -> Self {
        self.speaks = true;
        self
    }

    /// Runs the trajectory as planned, then closes the desk.
    pub fn with_plan(mut self, plan: Plan) -> Self {
        self.plan = Some(plan);
        self
    }

    /// Prepares the requested trajectory as the first course.
    ///
    /// # Errors
    ///
    /// If the model has no state of rest there.
    pub fn prepare(&mut self) -> Result<()> {
        let (path, payload_changes) =
            (Arc::clone(&self.wanted.path), self.wanted.payload_changes.clone());
        self.orders.extend(self.session.prepare(path, payload_changes).into_diagnostic()?);
        Ok(())
    }

    /// Flag that releases a waiting plan.
    pub fn starter(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.started)
    }

    /// Session.
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// Completes the log; returns the error if it is incomplete.
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
        self.request_start();
        self.follow_plan();
        self.apply_demands();
        let mut orders = std::mem::take(&mut self.orders);
        orders.extend(self.session.orders());
        orders
    }

    fn failed(&mut self, failure: &Failure) {
        self.say(&failure.to_string());
        // after a failure of the control task only the end remains; at a dashboard the operator ends the
        // session
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
        // the supervisor reports oscillations; this detector is evaluated at the end
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
    /// Error of largest magnitude \[mm\].
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

    /// RMS and peak \[mm\]; none without samples.
    fn rms_and_peak(&self) -> Option<[f64; 2]> {
        (self.count > 0).then(|| [(self.sum / f64::from(self.count)).sqrt(), self.peak])
    }
}

impl Watch {
    /// Appends a record to the log. A log that cannot be written is abandoned, and the run continues.
    fn write(&mut self, record: &Record) {
        let Some(mut writer) = self.log.take() else { return };
        let cycles = self.bus_log.as_mut().map(|bus| bus.add_until(record, &mut writer));
        let Err(error) = writer.add(record).and(cycles.unwrap_or(Ok(()))) else {
            self.log = Some(writer);
            return;
        };
        match writer.leave() {
            Ok(kept) => self.say(&format!(
                "the log ends here; the part written is in {}: {error}",
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

    /// Prints the state reported by the machine when it changes.
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

    /// Prints the waiting condition after [`REPORT_AFTER`]; waiting for a start with the load held is not
    /// reported.
    fn say_waiting(&mut self, decision: &Decision) {
        let usual = matches!(
            decision.waiting,
            Waiting::Start | Waiting::CourseEnd | Waiting::Lift | Waiting::Enable | Waiting::Reset
        );
        if !self.speaks
            || usual
            || decision.waited < REPORT_AFTER
            || self.waiting == Some(decision.waiting)
        {
            return;
        }
        self.waiting = Some(decision.waiting);
        let (state, text) = (decision.state.name(), decision.waiting.text());
        self.say(&format!("{state} waits for {text}, since {:.0} s", decision.waited));
    }

    /// Prints a sustained oscillation, once per course.
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
            // a course ended by a fault has no error as a result
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

    /// Starts the next course of the plan, or ends it.
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
            output::note(&format!("{:8.3} s  reset, as --carry-on requests", last.time));
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

    /// Prepares the requested course, which is started after its orders have been passed on.
    fn prepare_start(&mut self, start: Start) {
        match self.prepare() {
            Ok(()) => self.start = Some(start),
            Err(error) => self.say(&format!("no start: {error}")),
        }
    }

    /// Requests the start of the prepared course, and reports the fate of the last request.
    fn request_start(&mut self) {
        let Some(last) = self.session.last() else { return };
        let (now, state) = (last.time, last.decision.state);
        if let Some(start) = self.start.take() {
            let within = Desk::START_WITHIN - start.asked.elapsed().as_secs_f64();
            if within <= 0.0 {
                self.say("no start: the preparation took longer than a second; start again");
            } else if self.desk.start_in(start.generation, within) {
                self.desk.choose(start.strategy);
                self.asked = Some(now);
            } else {
                self.say(
                    "no start: after the request the operator changed or an emergency stop came",
                );
            }
        }
        if self.asked.is_some_and(|since| now - since > TAKEN_UP) {
            self.asked = None;
            let name = state.name();
            self.say(&format!("no start: it was not accepted in {name} within a second"));
        }
    }

    fn apply_demands(&mut self) {
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

    /// Prepares the course requested by an operator, if it can start now.
    fn start_as_chosen(&mut self, choice: &Choice, generation: Generation, asked: Instant) {
        let Some((_, courses)) = &self.dashboard else { return };
        let Some(last) = self.session.last() else {
            return self.say("no start: there is no measurement of the machine yet");
        };
        if !self.session.is_ready() || self.start.is_some() || self.asked.is_some() {
            let waits = start_waits_for(&last.decision, self.desk.is_attended());
            let waits = waits.unwrap_or("an earlier start request");
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

/// Resident memory of this process \[MB\].
fn memory_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:"))?;
    line.split_whitespace().nth(1)?.parse::<f64>().ok().map(|kilobytes| kilobytes / 1024.0)
}
