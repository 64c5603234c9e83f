//! `hydroboom run`

mod attached_machine;
pub mod attachment;
mod attendant;
pub mod bus;
mod bus_log;
mod control_setup;
mod course_plan;
mod course_result;
mod fault_advice;
mod flow_baseline;
mod operator;
mod page;
mod process;
mod replay;
mod report;
mod requested_course;
mod results;
mod retained_parameters;
mod simulated_course;
mod strategy_check;

use crate::crane_file::CraneFile;
use crate::machine_argument::MachineArgument;
use crate::machine_choice::{MachineChoice, Source};
use crate::number;
use crate::output;
use crate::paths::{InputFile, OutputFile};
use crate::strategy_argument::strategies;
use attached_machine::AttachedMachine;
use attachment::AttachmentResult;
use attendant::RunAttendant;
use clap::Args;
use control_setup::ControlSetup;
use course_plan::{CoursePlan, StrategyChange};
use hydroboom_control::strategy::Strategy;
use hydroboom_dashboard::{self as dashboard, Choice, Dashboard, Setup};
use hydroboom_description::Description;
use hydroboom_lab::closed_loop::scenario::scenarios;
use hydroboom_realtime::desk::Desk;
use hydroboom_realtime::executive::RealTime;
use hydroboom_realtime::lockstep::{self, Pace};
use hydroboom_realtime::log::LogWriter;
use hydroboom_realtime::session::{Ending, Lookout, Session};
use miette::{IntoDiagnostic, Result};
use operator::{handle_ctrl_c, release_at_enter};
use requested_course::{RequestedCourse, speeds_mm_s};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use strategy_check::check_strategies;

/// Run the motion in real time on a machine: the virtual crane in another process, one on the local interface, or
/// devices on EtherCAT.
#[derive(Args)]
#[command(after_help = "Examples:\n  hydroboom run --auto\n  hydroboom run --auto --strategy \
    benchmark-closed-loop --speed-mm-s 25\n  hydroboom run --dashboard\n  hydroboom run --auto --simulated-time\n  \
    hydroboom run --machine udp:8150\n  hydroboom run --machine ethercat:eth1 --bus bus.toml\n  hydroboom run --replay run.mcap\n  hydroboom run --auto --strategy scheduled-lqr\n\n\
    Ctrl-C stops under control, a second Ctrl-C holds the load at once.\n\
    The supervisor is no safety function in the sense of ISO 13849: at a real machine a hardware \
    emergency stop stays.")]
pub struct Run {
    #[command(flatten)]
    crane: CraneFile,
    /// The machine: virtual or virtual:FILE, the virtual crane (of that crane file); udp:PORT, another process that
    /// implements the local interface (docs/reference/machine-interface.md); or ethercat:INTERFACE, devices at that
    /// network interface (docs/reference/ethercat-table.md). A bare FILE is virtual:FILE. Default: the virtual crane of
    /// the crane file (typical drive, valve, sensors and fieldbus where the file has none), without --crane the
    /// paper's.
    #[arg(
        long = "machine", visible_alias = "plant", value_name = "virtual[:FILE]|udp:PORT|ethercat:INTERFACE|FILE",
        value_parser = MachineArgument::parser()
    )]
    machine: Option<MachineArgument>,
    /// With ethercat:INTERFACE: table of the devices on the bus and of their signals
    /// (docs/reference/ethercat-table.md). Default: the table [machine.ethercat] of the crane file.
    #[arg(long, value_name = "FILE")]
    bus: Option<InputFile>,
    /// Record of the machine's commissioning, by `hydroboom commission`. A real machine is not moved without it, nor if
    /// crane file, bus table, devices, firmware or version differ; a machine that says that it is simulated needs none.
    #[arg(long, value_name = "FILE")]
    commissioning: Option<InputFile>,
    /// Log without ever enabling the drives, until Ctrl-C. No record of a commissioning is needed.
    #[arg(
        long, requires = "machine",
        conflicts_with_all = [
            "dashboard", "cycles", "then", "auto", "baseline", "record_baseline", "parameters", "simulated_time",
            "commissioning",
        ]
    )]
    listen: bool,
    /// Control strategy.
    #[arg(long, value_parser = strategies(), default_value = "simulation-feedforward-closed-loop")]
    strategy: Strategy,
    /// Strategy to switch to in the middle of the motion (bumpless transfer).
    #[arg(long, value_parser = strategies(), value_name = "STRATEGY", conflicts_with = "dashboard")]
    then: Option<Strategy>,
    /// Speed of the motion; the model's fast one when not given: 0.1 to 10000 mm/s.
    #[arg(long, value_parser = number::within(number::SPEED, "mm/s"))]
    speed_mm_s: Option<f64>,
    /// Run a scenario; `hydroboom scenarios` lists them.
    #[arg(long, value_name = "NAME", conflicts_with = "speed_mm_s")]
    scenario: Option<String>,
    /// Start at once, without waiting for Enter.
    #[arg(long)]
    auto: bool,
    /// Number of cycles in succession; drift of errors and memory is reported.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u32).range(1..), conflicts_with = "dashboard")]
    cycles: Option<u32>,
    /// With --cycles: reset faults, and continue with the next cycle.
    #[arg(long, requires = "cycles")]
    carry_on: bool,
    /// Serve a dashboard to show and command the run in a browser, until Ctrl-C.
    #[arg(long, num_args = 0..=1, default_missing_value = "127.0.0.1:8140", value_name = "ADDRESS:PORT")]
    dashboard: Option<SocketAddr>,
    /// Accept dashboard connections from other computers, without encryption.
    #[arg(long, requires = "dashboard")]
    allow_remote: bool,
    #[arg(long, value_name = "FILE", hide = true, value_parser = replaced_by_the_estimator)]
    learned: Option<PathBuf>,
    /// Baseline of this machine's delivered flow, recorded by --record-baseline. The flow monitor uses it in place of
    /// the crane file's ranges.
    #[arg(long, value_name = "FILE")]
    baseline: Option<InputFile>,
    /// File for the baseline of this machine's delivered flow, recorded from the last course unless that had a fault.
    #[arg(long, value_name = "FILE")]
    record_baseline: Option<OutputFile>,
    /// Parameters of the state estimator (oil, unknown flow, drive lag) with their covariance: read at the start if the
    /// file exists, and written at the end.
    #[arg(long, value_name = "FILE", conflicts_with = "replay")]
    parameters: Option<OutputFile>,
    /// Log to write, MCAP: Foxglove and PlotJuggler open it, `hydroboom log to-csv` converts it.
    #[arg(long, value_name = "FILE")]
    log: Option<OutputFile>,
    /// Replay the measurements of such a log to controller and supervisor, in simulated time.
    #[arg(
        long, value_name = "FILE",
        conflicts_with_all = [
            "dashboard", "cycles", "log", "scenario", "machine", "bus", "strategy", "then", "report", "baseline",
            "record_baseline", "commissioning", "listen",
        ]
    )]
    replay: Option<InputFile>,
    /// Report to write (HTML); after a fault its last second is written beside it, as CSV.
    #[arg(long, value_name = "FILE")]
    report: Option<OutputFile>,
    /// Simulated time: the same tasks in one thread, as fast as possible (with a dashboard at the rate of the clock),
    /// bit-identical in every repetition.
    #[arg(long)]
    simulated_time: bool,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Run {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If an input is invalid, the machine cannot be attached or simulated, a real machine was not commissioned as it
    /// is now, or a fault ended the run without a dashboard and without `--carry-on`.
    pub fn run(self) -> Result<()> {
        let model = self.crane.read()?;
        if let Some(log) = &self.replay {
            return replay::replay(&model, log, self.json);
        }
        let bus = self.open_bus(&model)?;
        let mut cranes = self.model_and_machine(model)?;
        let is_attached = cranes.source.is_attached();
        let course = RequestedCourse::new(&cranes, self.speed_mm_s, self.scenario.as_deref())?;
        let (first, then) = (self.strategy, self.then.unwrap_or(self.strategy));
        check_strategies(&cranes, &course, [first, then])?;
        let setup = ControlSetup {
            strategy: first,
            limits: self.limits(&cranes.model)?,
            retained: retained_parameters::read(self.parameters.as_deref(), &cranes.model)?,
        };
        let change = StrategyChange { first, then, at: 0.5 * course.path.duration() };
        // only a run in real time on the virtual crane is compared with simulated time
        let simulated = match self.simulated_time || self.dashboard.is_some() || is_attached {
            true => None,
            false => simulated_course::simulate(&cranes, &course, change)?,
        };
        let desk = Arc::new(Desk::new(first));
        if self.listen {
            desk.listen_only();
            output::note("listening: the drives are never enabled; Ctrl-C ends");
        }
        if is_attached && !course.payload_changes.is_empty() {
            output::note("a person at the machine has to make the scenario's payload changes");
        }
        let mut attached = match (&self.machine, bus) {
            (Some(MachineArgument::Udp(port)), _) => {
                let attached = self.attach_local(*port, &cranes, &setup, &desk)?;
                if attached.is_none() {
                    return Ok(());
                }
                attached
            }
            (Some(MachineArgument::EtherCat(interface)), Some(bus)) => {
                Some(self.attach_bus(interface, bus, &cranes, &setup, &desk)?)
            }
            _ => None,
        };
        let mut bus_log = None;
        if let Some(attached) = &mut attached {
            cranes = cranes.reported_as_simulated(attached.is_simulated);
            bus_log = attached.bus_log.take();
        }
        let attendant = self.attendant(&cranes, &desk, course, change)?;
        let mut attendant = attendant.with_bus_log(bus_log);
        let (real_time, attachment) =
            self.run_session(&cranes, attached, &setup, &desk, &mut attendant)?;
        if let (Some(path), Some(lost)) = (&self.log, attendant.close_log()) {
            output::written(path, Err(lost));
        }
        // each output is written even if another one fails
        let recorded = self.record_flow_baseline(&cranes.model, &attendant);
        if let Some(path) = &self.parameters {
            let last = attendant.session().last();
            retained_parameters::write(path, &cranes.model, &attendant.results, last);
        }
        let ended = (real_time.as_ref(), attachment.as_ref());
        let concluded = self.conclude(&cranes, &attendant, simulated.as_ref(), ended);
        recorded.and(concluded)
    }

    /// Model with its machine: attached, or a virtual crane.
    ///
    /// # Errors
    ///
    /// If the crane file of the virtual crane cannot be read, or is not of a self-contained crane.
    fn model_and_machine(&self, model: Description) -> Result<MachineChoice> {
        match &self.machine {
            Some(MachineArgument::Udp(port)) => {
                Ok(MachineChoice::attached(model, Source::Udp, format!("udp:{port}")))
            }
            Some(MachineArgument::EtherCat(interface)) => {
                let address = format!("ethercat:{interface}");
                Ok(MachineChoice::attached(model, Source::EtherCat, address))
            }
            Some(MachineArgument::Virtual(_)) | None => {
                let file = self.machine.as_ref().and_then(MachineArgument::file);
                MachineChoice::of(model, &self.crane, file)
            }
        }
    }

    /// Attendant of the session: with a dashboard, otherwise with the plan of the courses.
    ///
    /// # Errors
    ///
    /// If the dashboard cannot be started.
    fn attendant(
        &self,
        cranes: &MachineChoice,
        desk: &Arc<Desk>,
        course: RequestedCourse,
        change: StrategyChange,
    ) -> Result<RunAttendant> {
        let log = match &self.log {
            Some(path) => {
                let begun = LogWriter::begin(path);
                begun.map_err(|error| output::written(path, Err(error))).ok()
            }
            None => None,
        };
        let session = Session::new(&cranes.model);
        let mut attendant = RunAttendant::new(session, Arc::clone(desk), course).with_log(log);
        if !self.simulated_time || self.dashboard.is_some() {
            let is_simulated_here = !self.simulated_time && !cranes.source.is_attached();
            attendant = attendant.with_state_report(is_simulated_here);
        }
        let Some(address) = self.dashboard else {
            if self.listen {
                return Ok(attendant);
            }
            let plan = CoursePlan {
                remaining: self.cycles.unwrap_or(1),
                resets_faults: self.carry_on,
                waits_for_operator: !self.auto && !self.simulated_time,
            };
            if plan.waits_for_operator {
                release_at_enter(attendant.release_flag());
            }
            return Ok(attendant.with_strategy_change(change).with_plan(plan));
        };
        let setup = Setup {
            model: &cranes.model,
            scenarios: scenarios(&cranes.machine).iter().map(|s| s.name.to_string()).collect(),
            speeds_mm_s: speeds_mm_s(cranes),
            first: Choice { strategy: self.strategy, course: self.first_course(cranes) },
            is_virtual: !cranes.source.is_attached(),
            in_real_time: !self.simulated_time,
        };
        let dashboard = Dashboard::open(address, self.allow_remote, &setup, Arc::clone(desk))
            .into_diagnostic()?;
        output::note(&format!("dashboard: {}", dashboard.address()));
        Ok(attendant.with_dashboard(dashboard, RequestedCourse::constructor(cranes)))
    }

    /// First course of the dashboard.
    fn first_course(&self, cranes: &MachineChoice) -> dashboard::Course {
        match &self.scenario {
            Some(name) => dashboard::Course::Scenario { name: name.clone() },
            None => {
                let speed_mm_s = self.speed_mm_s.unwrap_or(cranes.model.numbers.fast * 1e3);
                dashboard::Course::Motion { speed_mm_s }
            }
        }
    }

    /// Runs the session until the desk is closed and the load is held. Returns the deadline statistics of a run in real
    /// time, and the result of an attachment.
    ///
    /// # Errors
    ///
    /// If the tasks cannot run, or the simulation of the machine fails.
    fn run_session(
        &self,
        cranes: &MachineChoice,
        attached: Option<AttachedMachine>,
        setup: &ControlSetup,
        desk: &Arc<Desk>,
        attendant: &mut RunAttendant,
    ) -> Result<(Option<RealTime>, Option<AttachmentResult>)> {
        let lookout = Lookout { desk, attendant, ending: Ending::OnceClosed };
        let pace = if self.dashboard.is_some() { Pace::Clock } else { Pace::Free };
        match (attached, self.simulated_time) {
            (Some(AttachedMachine { tasks, connection, .. }), _) => {
                connection.run(&cranes.model, tasks, lookout, pace)
            }
            (None, true) => {
                if self.dashboard.is_some() {
                    handle_ctrl_c(desk)?;
                }
                let run = setup.lockstep(cranes)?;
                lockstep::run(run, &cranes.machine, lookout, pace).into_diagnostic()?;
                Ok((None, None))
            }
            (None, false) => {
                handle_ctrl_c(desk)?;
                Ok((Some(process::run_in_real_time(cranes, setup, lookout)?), None))
            }
        }
    }
}

/// Refuses `--learned`.
fn replaced_by_the_estimator(_: &str) -> Result<PathBuf, String> {
    Err("the state estimator of scheduled-lqr, which runs in every run, replaced what was learned; --parameters keeps its estimates in a \
         file"
        .into())
}
