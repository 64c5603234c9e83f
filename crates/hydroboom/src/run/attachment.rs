//! Attachment of a machine: in another process on the local interface, or as devices on a bus.

use super::bus;
use crate::output;
use hydroboom_description::Description;
use hydroboom_fieldbus::bus_task::BusReport as FieldbusReport;
use hydroboom_fieldbus::bus_task::BusThread as FieldbusThread;
use hydroboom_realtime::bus_task::{BusReport, BusTask, BusThread};
use hydroboom_realtime::control_task::ControlTask;
use hydroboom_realtime::desk::Desk;
use hydroboom_realtime::executive::{self, Placement, RealTime, Tasks};
use hydroboom_realtime::local_lockstep::LocalLockstep;
use hydroboom_realtime::local_machine::LocalMachine;
use hydroboom_realtime::lockstep::{self, Pace};
use hydroboom_realtime::machine::Machine;
use hydroboom_realtime::session::Lookout;
use hydroboom_realtime::simulation_task::SimulationTask;
use miette::{IntoDiagnostic, Result, miette};
use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// Interval of the check for the end of the wait \[ns\].
const POLL_INTERVAL: u64 = 100_000_000;
/// Time after which the wait is reported.
const REPORT_AFTER: Duration = Duration::from_millis(300);

/// Opens the port for a model's control period.
pub fn open(port: u16, model: &Description) -> Result<(BusTask, LocalMachine)> {
    BusTask::open(port, model.numbers.control_period).into_diagnostic()
}

/// Waits until a machine has begun a session, and prints its address; false if the wait was ended by the
/// operator.
pub fn wait_for_machine(bus: &mut BusTask, desk: &Desk) -> Result<bool> {
    let (begun, port) = (Instant::now(), bus.port());
    let mut is_said = false;
    while !bus.endpoint.has_begun() {
        bus.wait(POLL_INTERVAL);
        // the clock is not used before the session begins
        bus.receive(0);
        if let Some(difference) = bus.endpoint.difference() {
            return Err(miette!("no session: {difference}"));
        }
        if desk.is_closing() {
            return Ok(false);
        }
        if !is_said && begun.elapsed() > REPORT_AFTER {
            is_said = true;
            output::note(&format!(
                "waiting for a machine at UDP port {port} of 127.0.0.1: start it (docs/reference/machine-interface.md has examples); Ctrl-C ends"
            ));
        }
    }
    if let Some((address, peer)) = bus.endpoint.machine() {
        output::note(&format!("a {} at {address} has begun a session", peer.name()));
    }
    Ok(true)
}

/// A machine that is there, with the control task's side.
pub enum Attached {
    /// In simulated time: both ends take turns.
    InLockstep(Box<BusTask>, LocalMachine),
    /// In real time: a thread of its own answers the machine.
    InRealTime(BusThread, Box<dyn Machine>),
    /// Devices on a bus, with which a thread of its own exchanges frames.
    OnFieldbus(FieldbusThread, Box<dyn Machine>),
}

/// Result of an attachment.
pub enum AttachmentResult {
    /// The local interface.
    Local(BusReport),
    /// A bus.
    Fieldbus(Box<FieldbusReport>),
}

/// Deadlines, in real time, and result of the attachment.
type Ran = Result<(Option<RealTime>, Option<AttachmentResult>)>;

impl Attached {
    /// With the controller's end.
    pub fn begin(bus: BusTask, side: LocalMachine, is_in_simulated_time: bool) -> Self {
        match is_in_simulated_time {
            true => Self::InLockstep(Box::new(bus), side),
            false => {
                let thread = bus.spawn(Placement::default().control_core);
                Self::InRealTime(thread, Box::new(side))
            }
        }
    }

    /// Runs until the session is over.
    pub fn run(
        self,
        model: &Description,
        tasks: (ControlTask, SimulationTask),
        lookout: Lookout<'_>,
        pace: Pace,
    ) -> Ran {
        let n = &model.numbers;
        let periods = (n.simulation_period, n.control_period);
        let in_real_time = |tasks: (ControlTask, SimulationTask), machine, lookout| {
            let ((control, simulation), placement) = (tasks, Placement::default());
            let tasks = Tasks { control, simulation, machine, periods, placement };
            executive::run(tasks, lookout, &mut |_| ()).into_diagnostic()
        };
        match self {
            Self::InLockstep(bus, side) => {
                let mut run = LocalLockstep::new(tasks, (*bus, side), periods);
                let Ok(_) = lockstep::attend(&mut run, lookout, pace);
                let came = BusReport::of(&run.bus.endpoint, Vec::new());
                Ok((None, Some(AttachmentResult::Local(came))))
            }
            Self::InRealTime(bus, machine) => {
                let real_time = in_real_time(tasks, machine, lookout)?;
                Ok((Some(real_time), bus.end().map(AttachmentResult::Local)))
            }
            Self::OnFieldbus(bus, machine) => {
                let real_time = in_real_time(tasks, machine, lookout)?;
                Ok((Some(real_time), bus.end().map(Box::new).map(AttachmentResult::Fieldbus)))
            }
        }
    }
}

impl AttachmentResult {
    /// Report as JSON.
    pub fn json(&self) -> Value {
        match self {
            Self::Local(report) => json(report),
            Self::Fieldbus(report) => bus::json(report),
        }
    }

    /// Report as text.
    pub fn text(&self) -> String {
        match self {
            Self::Local(report) => text(report),
            Self::Fieldbus(report) => bus::text(report),
        }
    }

    /// The frames of a bus before its fault, as pcapng.
    pub fn frames(&self) -> Option<&[u8]> {
        match self {
            Self::Local(_) => None,
            Self::Fieldbus(report) => report.frames.as_deref(),
        }
    }

    /// The bus's own fault, in a sentence with what to do.
    pub fn fault(&self) -> Option<&str> {
        match self {
            Self::Local(_) => None,
            Self::Fieldbus(report) => report.fault.as_ref().map(|(_, sentence)| sentence.as_str()),
        }
    }
}

fn json(report: &BusReport) -> Value {
    let BusReport { counters, refused, link, remarks } = report;
    json!({
        "accepted": counters.accepted, "lost": counters.lost, "malformed": counters.malformed,
        "check_sum": counters.check_sum, "not_finite": counters.not_finite, "session": counters.session,
        "sequence": counters.sequence, "refused": refused,
        "delay_cycles": link.delay.map(|delay| delay.total),
        "measurement_delay_cycles": link.delay.map(|delay| delay.measurement),
        "remarks": remarks,
    })
}

fn text(report: &BusReport) -> String {
    let BusReport { counters, refused, link, remarks } = report;
    let mut said = format!(
        "Local interface: {} measurements accepted, {} lost",
        counters.accepted, counters.lost
    );
    let dropped = [
        ("malformed", counters.malformed),
        ("with a wrong check sum", counters.check_sum),
        ("not finite", counters.not_finite),
        ("of another session", counters.session),
        ("old or repeated", counters.sequence),
        ("of another sender", *refused),
    ];
    for (why, count) in dropped.iter().filter(|(_, count)| *count > 0) {
        said += &format!(", {count} dropped as {why}");
    }
    match link.delay {
        Some(delay) => said += &format!("; from sampling to actuation {:.2} cycles", delay.total),
        None => said += "; no command has acted",
    }
    remarks.iter().for_each(|remark| said += &format!("\n{remark}"));
    said
}
