//! Start of courses, by the plan of a run or at the request of an operator at the dashboard.

use super::RunAttendant;
use crate::output;
use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::supervisor::State;
use hydroboom_dashboard::{Choice, Demand};
use hydroboom_realtime::desk::{Desk, Generation};
use hydroboom_realtime::readiness::start_waits_for;
use hydroboom_realtime::session::Order;
use hydroboom_realtime::trouble::Tampering;
use miette::{IntoDiagnostic, Result};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// Time after which a start request that was not accepted has been dropped \[s\].
const REQUEST_LIFETIME: f64 = Desk::START_WITHIN + 0.1;
/// Pause after a course or a fault \[s\].
const PAUSE: f64 = 1.0;

/// Start of a course that is prepared, and requested in the next turn.
pub(super) struct PreparedStart {
    /// Operator's generation at the request: a start is void if the operator changed since.
    generation: Generation,
    /// Time of the request, from which its validity of [`Desk::START_WITHIN`] counts.
    requested_at: Instant,
    strategy: Strategy,
}

impl RunAttendant {
    /// Starts the next course of the plan, or ends it.
    pub(super) fn follow_plan(&mut self) {
        let (Some(plan), Some(since)) = (self.plan, self.resting) else { return };
        let Some(last) = self.session.last().copied() else { return };
        let is_due = last.time - since >= PAUSE || self.results.is_empty();
        let is_waiting = plan.waits_for_operator && !self.released.load(Ordering::Relaxed);
        if !is_due || self.has_requested_start() || is_waiting {
            return;
        }
        let is_fault = last.decision.state == State::Fault;
        if self.desk.is_closing() || (is_fault && !plan.resets_faults) {
            self.desk.close();
        } else if is_fault {
            output::note(&format!("{:8.3} s  reset, as --carry-on requests", last.time));
            self.desk.reset();
            self.resting = None;
        } else if plan.remaining == 0 {
            self.desk.close();
        } else if self.session.is_ready() {
            self.prepare_start(PreparedStart {
                generation: self.desk.generation(),
                requested_at: Instant::now(),
                strategy: self.desk.strategy(),
            });
        }
    }

    /// Requests the start of the prepared course, and reports a request that was refused.
    pub(super) fn request_start(&mut self) {
        let Some(last) = self.session.last() else { return };
        let (now, state) = (last.time, last.decision.state);
        if let Some(start) = self.start.take() {
            let within = Desk::START_WITHIN - start.requested_at.elapsed().as_secs_f64();
            if within <= 0.0 {
                self.notify("no start: the preparation took longer than a second; start again");
            } else if self.desk.start_in(start.generation, within) {
                self.desk.choose(start.strategy);
                self.start_requested = Some(now);
            } else {
                self.notify(
                    "no start: after the request the operator changed or an emergency stop came",
                );
            }
        }
        if self.start_requested.is_some_and(|since| now - since > REQUEST_LIFETIME) {
            self.start_requested = None;
            let name = state.name();
            self.notify(&format!("no start: it was not accepted in {name} within a second"));
        }
    }

    /// Executes the requests of the dashboard's viewers: starts, and faults of a virtual machine.
    pub(super) fn execute_dashboard_requests(&mut self) {
        let Some((dashboard, _)) = &mut self.dashboard else { return };
        for demand in dashboard.demands() {
            match demand {
                Demand::Start { choice, generation, asked } => {
                    self.start_requested_course(&choice, generation, asked);
                }
                Demand::Fault(fault) => self.orders.push(Order::Tamper(Tampering::Fault(fault))),
                Demand::Mend => self.orders.push(Order::Tamper(Tampering::Mend)),
            }
        }
    }

    /// Prepares the course requested by an operator, if it can start now.
    fn start_requested_course(
        &mut self,
        choice: &Choice,
        generation: Generation,
        requested_at: Instant,
    ) {
        let Some((_, course)) = &self.dashboard else { return };
        let Some(last) = self.session.last() else {
            return self.notify("no start: there is no measurement of the machine yet");
        };
        if !self.session.is_ready() || self.has_requested_start() {
            let waits = start_waits_for(&last.decision, self.desk.is_attended());
            let waits = waits.unwrap_or("an earlier start request");
            let state = last.decision.state.name();
            return self
                .notify(&format!("no start: the machine is in {state} and waits for {waits}"));
        }
        match course(&choice.course) {
            Ok(course) => {
                self.course = course;
                let strategy = choice.strategy;
                self.prepare_start(PreparedStart { generation, requested_at, strategy });
            }
            Err(error) => self.notify(&format!("no start: {error}")),
        }
    }

    /// Whether a start is prepared, or requested and not yet accepted.
    fn has_requested_start(&self) -> bool {
        self.start.is_some() || self.start_requested.is_some()
    }

    /// Prepares the requested course, which is started after its orders have been passed on.
    fn prepare_start(&mut self, start: PreparedStart) {
        match self.prepare_course() {
            Ok(()) => self.start = Some(start),
            Err(error) => self.notify(&format!("no start: {error}")),
        }
    }

    /// Orders the requested course from the tasks.
    ///
    /// # Errors
    ///
    /// If the model has no state of rest at the start of the course.
    fn prepare_course(&mut self) -> Result<()> {
        let (path, payload_changes) =
            (Arc::clone(&self.course.path), self.course.payload_changes.clone());
        self.orders.extend(self.session.prepare(path, payload_changes).into_diagnostic()?);
        Ok(())
    }
}
