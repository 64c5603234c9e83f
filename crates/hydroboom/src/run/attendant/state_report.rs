//! Reports of the machine's state during a run: states of the supervisor, waiting conditions, oscillations.

use super::RunAttendant;
use crate::output;
use crate::run::fault_advice::fault_advice;
use crate::signals_text::signals_text;
use hydroboom_control::supervision::limits::MachineStatus;
use hydroboom_control::supervision::supervisor::{Decision, State};
use hydroboom_control::supervision::waiting::Waiting;
use hydroboom_realtime::control_task::Record;

/// Time after which a waiting state is reported \[s\].
const REPORT_AFTER: f64 = 2.0;

/// Conditions of the last report, so that each is reported once.
#[derive(Default)]
pub(super) struct ReportedState {
    /// Whether states, waiting conditions and oscillations are printed.
    pub(super) is_printed: bool,
    /// Whether this computer simulates the machine in real time.
    pub(super) is_simulated_here: bool,
    /// Last state reported by the machine.
    status: Option<MachineStatus>,
    /// Last second in which the signals were printed.
    second: f64,
    /// Last reported waiting condition of the present state.
    waiting: Option<Waiting>,
    /// Whether the loop was in sustained oscillation in the last period.
    oscillates: bool,
}

impl RunAttendant {
    /// Prints a notice, and shows it at the dashboard.
    pub(super) fn notify(&mut self, text: &str) {
        output::note(text);
        if let Some((dashboard, _)) = &mut self.dashboard {
            dashboard.say(text);
        }
    }

    /// Prints a new state of the supervisor with the time of the session, and the advice on a fault.
    pub(super) fn report_state(&mut self, record: &Record) {
        self.reported.waiting = None;
        if !self.reported.is_printed {
            return;
        }
        let now = record.decision.state;
        match record.decision.cause {
            Some(cause) if now == State::Fault => {
                let advice = fault_advice(cause, self.reported.is_simulated_here);
                let code = cause.code();
                output::note(&format!("{:8.3} s  Fault: {code}: {advice}", record.time));
            }
            _ => output::note(&format!("{:8.3} s  {}", record.time, now.name())),
        }
    }

    /// While listening, prints the signals once a second, for comparison with gauges.
    pub(super) fn report_signals(&mut self, record: &Record) {
        let second = record.time.floor();
        if !self.desk.listens() || !self.reported.is_printed || second == self.reported.second {
            return;
        }
        self.reported.second = second;
        output::note(&format!("{:8.3} s  {}", record.time, signals_text(record.signals())));
    }

    /// Prints the state reported by the machine when it changes.
    pub(super) fn report_machine_status(&mut self, record: &Record) {
        if record.status == self.reported.status {
            return;
        }
        self.reported.status = record.status;
        let Some(status) = record.status.filter(|_| self.reported.is_printed) else { return };
        let fault = match status {
            MachineStatus::Fault { code } => {
                format!(" of code {code:#06x}: it is reset at the machine, by a person")
            }
            _ => String::new(),
        };
        let name = status.name();
        self.notify(&format!("{:8.3} s  the machine reports: {name}{fault}", record.time));
    }

    /// Prints the waiting condition after [`REPORT_AFTER`]; waiting for a start with the load held is not
    /// reported.
    pub(super) fn report_waiting(&mut self, decision: &Decision) {
        let is_usual = matches!(
            decision.waiting,
            Waiting::Start | Waiting::CourseEnd | Waiting::Lift | Waiting::Enable | Waiting::Reset
        );
        if !self.reported.is_printed
            || is_usual
            || decision.waited < REPORT_AFTER
            || self.reported.waiting == Some(decision.waiting)
        {
            return;
        }
        self.reported.waiting = Some(decision.waiting);
        let (state, text) = (decision.state.name(), decision.waiting.text());
        self.notify(&format!("{state} waits for {text}, since {:.0} s", decision.waited));
    }

    /// Prints a sustained oscillation, amplitude \[m\] and frequency \[Hz\], when it begins.
    pub(super) fn report_oscillation(&mut self, oscillation: Option<[f64; 2]>) {
        let is_new = oscillation.is_some() && !self.reported.oscillates;
        self.reported.oscillates = oscillation.is_some();
        if let (Some([amplitude, frequency]), true) =
            (oscillation, is_new && self.reported.is_printed)
        {
            self.notify(&format!(
                "the loop is in sustained oscillation: {:.1} mm at {frequency:.2} Hz",
                amplitude * 1e3
            ));
        }
    }
}
