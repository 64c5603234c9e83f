//! Attendant of a run's session: writes the log, evaluates the courses, starts the next one, reports the state.

mod course_start;
mod state_report;

use super::bus_log::BusLog;
use super::course_plan::{CoursePlan, StrategyChange};
use super::course_result::{CourseEvaluation, CourseResult};
use super::page::course_page;
use super::requested_course::{CourseConstructor, RequestedCourse};
use crate::origin::origin;
use course_start::PreparedStart;
use hydroboom_control::supervision::supervisor::State;
use hydroboom_dashboard::Dashboard;
use hydroboom_realtime::control_task::Record;
use hydroboom_realtime::desk::Desk;
use hydroboom_realtime::failure::Failure;
use hydroboom_realtime::log::{LogError, LogWriter};
use hydroboom_realtime::session::{Attendant, Order, Session};
use hydroboom_virtual_crane::Truth;
use serde_json::json;
use state_report::ReportedState;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Attendant of a run's session.
pub struct RunAttendant {
    session: Session,
    desk: Arc<Desk>,
    /// Course of the next start, and of the present one.
    course: RequestedCourse,
    change: Option<StrategyChange>,
    plan: Option<CoursePlan>,
    log: Option<LogWriter>,
    /// Log of a bus.
    bus_log: Option<BusLog>,
    /// Error after which the log was abandoned.
    lost_log: Option<LogError>,
    /// State of the supervisor in the last control period.
    state: Option<State>,
    reported: ReportedState,
    evaluation: Option<CourseEvaluation>,
    /// Records of the last course, from the request to the held load; the first twenty minutes of it.
    pub records: Vec<Record>,
    /// Results of the courses so far, in their order.
    pub results: Vec<CourseResult>,
    /// Time since which nothing moves \[s\].
    resting: Option<f64>,
    /// Orders to pass on.
    orders: Vec<Order>,
    /// Start to request after these orders have been passed on.
    start: Option<PreparedStart>,
    /// Time since which a start is requested and not accepted \[s\].
    start_requested: Option<f64>,
    /// True piston position in the coming period \[m\], if known.
    true_stroke: Option<f64>,
    dashboard: Option<(Dashboard, CourseConstructor)>,
    /// Whether the operator has released the plan.
    released: Arc<AtomicBool>,
}

/// Largest number of records of a course that are stored: twenty minutes.
const MOST_RECORDS: usize = 1_200_000;

impl RunAttendant {
    /// Attendant of a session with the course of the first start.
    pub fn new(session: Session, desk: Arc<Desk>, course: RequestedCourse) -> Self {
        Self {
            session,
            desk,
            course,
            change: None,
            plan: None,
            log: None,
            bus_log: None,
            lost_log: None,
            state: None,
            reported: ReportedState::default(),
            evaluation: None,
            records: Vec::with_capacity(40_000),
            results: Vec::new(),
            resting: None,
            orders: Vec::new(),
            start: None,
            start_requested: None,
            true_stroke: None,
            dashboard: None,
            released: Arc::new(AtomicBool::new(false)),
        }
    }

    /// Connects a dashboard, whose requests are executed.
    pub fn with_dashboard(mut self, dashboard: Dashboard, courses: CourseConstructor) -> Self {
        self.dashboard = Some((dashboard, courses));
        self
    }

    /// Writes a log, if one was begun.
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
    pub fn with_strategy_change(mut self, change: StrategyChange) -> Self {
        self.change = Some(change);
        self
    }

    /// Prints states, waiting conditions and oscillations; advice on a fault depends on whether this computer simulates
    /// the machine in real time.
    pub fn with_state_report(mut self, is_simulated_here: bool) -> Self {
        self.reported.is_printed = true;
        self.reported.is_simulated_here = is_simulated_here;
        self
    }

    /// Runs the course as planned, then closes the desk.
    pub fn with_plan(mut self, plan: CoursePlan) -> Self {
        self.plan = Some(plan);
        self
    }

    /// Flag that releases a plan that waits for the operator.
    pub fn release_flag(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.released)
    }

    /// Session with the last record, and the data of the last fault.
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// Completes the log; returns the error if it is incomplete.
    pub fn close_log(&mut self) -> Option<LogError> {
        let ended = self.log.take().and_then(|log| log.finish().err());
        self.lost_log.take().or(ended)
    }

    /// Appends a record to the log. A log that cannot be written is abandoned, and the run continues.
    fn write(&mut self, record: &Record) {
        let Some(mut writer) = self.log.take() else { return };
        let cycles = self.bus_log.as_mut().map(|bus| bus.add_until(record, &mut writer));
        let Err(error) = writer.add(record).and(cycles.unwrap_or(Ok(()))) else {
            self.log = Some(writer);
            return;
        };
        match writer.leave() {
            Ok(kept) => self.notify(&format!(
                "the log ends here; the part written is in {}: {error}",
                kept.display()
            )),
            Err(lost) => {
                self.notify(&format!("the log ends here, and is lost: {error}; {lost}"));
            }
        }
        self.lost_log = Some(error);
    }

    /// Acts on a change of the supervisor's state: reports it, ends the course, and shows a fault at the dashboard.
    fn change_state(&mut self, before: Option<State>, record: &Record) {
        let now = record.decision.state;
        self.state = Some(now);
        self.report_state(record);
        let is_over = match before {
            Some(State::Stopping) => now == State::Holding,
            _ => now == State::Fault,
        };
        if is_over && let Some(evaluation) = self.evaluation.take() {
            self.end_course(&evaluation, record);
        }
        if now == State::Fault
            && let (Some((dashboard, _)), Some(fault)) = (&mut self.dashboard, self.session.fault())
        {
            dashboard.alarm(fault);
        }
    }

    /// Begins the evaluation of a course with the record in which the load's release began.
    fn begin_course(&mut self, record: &Record) {
        self.start_requested = None;
        if let Some(plan) = &mut self.plan {
            plan.remaining = plan.remaining.saturating_sub(1);
        }
        self.records.clear();
        self.evaluation = Some(CourseEvaluation::begin(record));
    }

    /// Adds a control period to the evaluation of the present course, with the true error where it is known.
    fn evaluate(&mut self, record: &Record) {
        let true_stroke = self.true_stroke.take();
        let Some(evaluation) = &mut self.evaluation else { return };
        if let Some(error) = record.error() {
            evaluation.add(record, error * 1e3);
            if let Some(stroke) = true_stroke {
                evaluation.add_true_error((stroke - record.reference.position) * 1e3);
            }
        }
        if self.records.len() < MOST_RECORDS {
            self.records.push(*record);
        }
    }

    /// Stores the result of a course, and shows it at the dashboard with a report.
    fn end_course(&mut self, evaluation: &CourseEvaluation, record: &Record) {
        let largest_motor_speed = self.session.model().numbers.motor_speed;
        let result = evaluation.result(self.course.name.clone(), record, largest_motor_speed);
        if let Some((dashboard, _)) = &mut self.dashboard {
            dashboard.result(&json!(result));
            match course_page(&result, &self.records) {
                Ok(page) => dashboard.set_report(page.html(&origin(None))),
                Err(error) => dashboard.say(&format!("no report: {error}")),
            }
        }
        self.results.push(result);
    }
}

impl Attendant for RunAttendant {
    fn see(&mut self, record: &Record) {
        self.session.see(record);
        self.write(record);
        let (before, now) = (self.state, record.decision.state);
        if before != Some(now) {
            self.change_state(before, record);
        }
        if let Some(change) = &self.change {
            self.desk.choose(change.at_time(record.course_time));
        }
        self.report_machine_status(record);
        self.report_signals(record);
        self.report_waiting(&record.decision);
        self.report_oscillation(record.decision.oscillation);
        if record.decision.releasing && self.evaluation.is_none() {
            self.begin_course(record);
        }
        self.evaluate(record);
        let rests = matches!(now, State::Holding | State::Fault)
            && record.decision.is_at_rest()
            && !record.decision.releasing;
        self.resting = if rests { self.resting.or(Some(record.time)) } else { None };
        if let Some((dashboard, _)) = &mut self.dashboard {
            dashboard.see(record);
        }
    }

    fn see_truth(&mut self, truth: &Truth) {
        self.true_stroke = Some(truth.outputs.stroke);
    }

    fn orders(&mut self) -> Vec<Order> {
        self.request_start();
        self.follow_plan();
        self.execute_dashboard_requests();
        let mut orders = std::mem::take(&mut self.orders);
        orders.extend(self.session.orders());
        orders
    }

    fn failed(&mut self, failure: &Failure) {
        self.notify(&failure.to_string());
        // after a failure of the control task only the end remains; at a dashboard the operator ends the
        // session
        if matches!(failure, Failure::Control(_)) && self.dashboard.is_none() {
            self.desk.close();
        }
    }
}
