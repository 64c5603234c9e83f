//! `hydroboom run`

pub mod attachment;
pub mod bus;
mod bus_log;
mod page;
mod process;
mod replay;
mod report;
mod watch;

use crate::benchmark_gains;
use crate::commissioning_basis::{demand, of_bus, of_local};
use crate::crane_file::CraneFile;
use crate::machine_argument::MachineArgument;
use crate::machine_choice::{MachineChoice, Source};
use crate::number;
use crate::output;
use crate::paths::{InputFile, OutputFile};
use crate::virtual_crane::strategies;
use attachment::{Attached, AttachmentResult};
use clap::Args;
use hydroboom_control::estimation::retained_parameters::RetainedParameters;
use hydroboom_control::reference::trajectory::Trajectory;
use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::limits::{Limits, MachineStatus};
use hydroboom_dashboard::{self as dashboard, Choice, Dashboard, Setup};
use hydroboom_description::Description;
use hydroboom_design::limits;
use hydroboom_design::scheduled_lqr::scheduled_lqr_controller;
use hydroboom_design::stability::stability_of;
use hydroboom_fieldbus::raw_socket::RawSocket;
use hydroboom_fieldbus::start_up::InitialState;
use hydroboom_fieldbus::table::Table;
use hydroboom_lab::closed_loop::scenario::{CourseChoice, scenarios};
use hydroboom_lab::paper;
use hydroboom_realtime::commissioning::record::Basis;
use hydroboom_realtime::control_task::{ControlTask, Fallback};
use hydroboom_realtime::course::Course;
use hydroboom_realtime::desk::Desk;
use hydroboom_realtime::executive::{self, Placement, RealTime, Tasks};
use hydroboom_realtime::flow_baseline::FlowBaseline;
use hydroboom_realtime::lockstep::{self, Lockstep, Pace};
use hydroboom_realtime::log::LogWriter;
use hydroboom_realtime::parameter_file;
use hydroboom_realtime::session::{Ending, Lookout, Session};
use hydroboom_realtime::shared::Shared;
use hydroboom_realtime::simulation_task::SimulationTask;
use miette::{IntoDiagnostic, Result, WrapErr, miette};
use process::{Host, Memory};
use report::{Report, processor};
use std::net::SocketAddr;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::sync::Arc;
use watch::{CourseResult, Courses, Plan, RequestedCourse, Switch, Watch};

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

/// Warns before any motion of loops that are unstable on the machine.
fn warn_of_unstable(cranes: &Cranes, strategies: [Strategy; 2]) -> Result<()> {
    let loops = stability_of(&strategies, &cranes.model, &cranes.machine).into_diagnostic()?;
    for unstable in loops.iter().filter(|of| !of.stable) {
        output::warn(&unstable.to_string());
    }
    Ok(())
}

/// Model and machine of a run.
type Cranes = MachineChoice;

impl Run {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let model = self.crane.read()?;
        if let Some(log) = &self.replay {
            return replay::replay(&model, log, self.json);
        }
        let bus = self.open_bus(&model)?;
        let mut cranes = match &self.machine {
            Some(MachineArgument::Udp(port)) => {
                Cranes::attached(model, Source::Udp, format!("udp:{port}"))
            }
            Some(MachineArgument::EtherCat(interface)) => {
                Cranes::attached(model, Source::EtherCat, format!("ethercat:{interface}"))
            }
            Some(MachineArgument::Virtual(_)) | None => {
                let file = self.machine.as_ref().and_then(MachineArgument::file);
                Cranes::of(model, &self.crane, file)?
            }
        };
        let is_attached = cranes.source.is_attached();
        let wanted = cranes.course(self.speed_mm_s, self.scenario.as_deref())?;
        let strategy = self.strategy;
        let then = self.then.unwrap_or(strategy);
        if strategy.estimates() || then.estimates() {
            // a crane without this design is refused here, instead of a silent fallback to the benchmark
            scheduled_lqr_controller(&cranes.model).into_diagnostic()?;
        }
        warn_of_unstable(&cranes, [strategy, then])?;
        let has_benchmark =
            |of: &Strategy| !matches!(of, Strategy::VelocityFeedforward | Strategy::ScheduledLqr);
        if [strategy, then].iter().any(has_benchmark) {
            let payload_changes = wanted.payload_changes.iter().map(|(_, mass)| *mass);
            let payloads = [&cranes.model, &cranes.machine].map(|crane| crane.numbers.payload);
            let (low, high) =
                payload_changes.chain(payloads).fold((f64::INFINITY, 0.0), |(low, high), kg| {
                    (f64::min(low, kg), f64::max(high, kg))
                });
            if let Some(remark) = benchmark_gains::kept(&cranes.model, [low, high])? {
                output::warn(&remark);
            }
        }
        let switch = Switch { first: strategy, then, at: 0.5 * wanted.path.duration() };
        let limits = self.limits(&cranes.model)?;
        let retained = self.retained(&cranes.model)?;
        let is_needless = self.simulated_time || self.dashboard.is_some() || is_attached;
        let alone = cranes.beforehand(&wanted, switch, is_needless)?;
        let desk = Arc::new(Desk::new(strategy));
        if self.listen {
            desk.listen_only();
            output::note("listening: the drives are never enabled; Ctrl-C ends");
        }
        let begin = (strategy, limits, retained);
        if is_attached && !wanted.payload_changes.is_empty() {
            output::note("a person at the machine has to make the scenario's payload changes");
        }
        let mut bus_log = None;
        let attached = match (&self.machine, bus) {
            (Some(MachineArgument::Udp(port)), _) => {
                attend(&desk)?;
                // everything is prepared before the session begins, because the machine must be answered
                // from then on
                let tasks = cranes.control_and_simulation(begin)?;
                let (mut bus, side) = attachment::open(*port, &cranes.model)?;
                if !attachment::wait_for_machine(&mut bus, &desk)? {
                    return Ok(());
                }
                let basis = of_local(&cranes.model, &bus);
                self.demand(&basis)?;
                cranes = cranes.said_to_be_simulated(basis.is_simulated);
                Some((tasks, Attached::begin(bus, side, self.simulated_time)))
            }
            (Some(MachineArgument::EtherCat(interface)), Some((table, socket))) => {
                attend(&desk)?;
                let tasks = cranes.control_and_simulation(begin)?;
                let mut is_simulated = false;
                // nothing is commanded while listening, so that OP is not needed
                let state = if self.listen { InitialState::SafeOp } else { InitialState::Op };
                let (attached, log) = bus::start(interface, table, socket, state, |table, facts| {
                    let basis = of_bus(&cranes.model, table, facts);
                    is_simulated = basis.is_simulated;
                    self.demand(&basis)
                })?;
                cranes = cranes.said_to_be_simulated(is_simulated);
                bus_log = Some(log);
                Some((tasks, attached))
            }
            _ => None,
        };
        let mut watch = self.watch(&cranes, &desk, wanted, switch)?.with_bus_log(bus_log);
        let lookout = Lookout { desk: &desk, attendant: &mut watch, ending: Ending::OnceClosed };
        let (real_time, bus) = match (attached, self.simulated_time) {
            (Some((tasks, attached)), _) => {
                let pace = if self.dashboard.is_some() { Pace::Clock } else { Pace::Free };
                attached.run(&cranes.model, tasks, lookout, pace)?
            }
            (None, true) => {
                let (strategy, limits, retained) = begin;
                let pace = if self.dashboard.is_some() { Pace::Clock } else { Pace::Free };
                if self.dashboard.is_some() {
                    attend(&desk)?;
                }
                let run = cranes.lockstep(strategy)?.within(limits);
                let run = match retained {
                    Some(retained) => run.with_retained_parameters(retained),
                    None => run,
                };
                lockstep::run(run, &cranes.machine, lookout, pace).into_diagnostic()?;
                (None, None)
            }
            (None, false) => {
                attend(&desk)?;
                (Some(in_real_time(&cranes, begin, lookout)?), None)
            }
        };
        if let (Some(path), Some(lost)) = (&self.log, watch.close_log()) {
            output::written(path, Err(lost));
        }
        // each output is written even if another one fails
        let recorded = self.record(&cranes.model, &watch);
        self.retain(&cranes.model, &watch);
        let done = (real_time.as_ref(), bus.as_ref());
        let concluded = self.conclude(&cranes, &watch, alone.as_ref(), done);
        recorded.and(concluded)
    }

    /// Refuses to move a real machine that was not commissioned as it is now.
    fn demand(&self, now: &Basis) -> Result<()> {
        if self.listen { Ok(()) } else { demand(self.commissioning.as_deref(), now) }
    }

    /// Table and network interface of a bus, where the machine is on one.
    fn open_bus(&self, model: &Description) -> Result<Option<(Table, RawSocket)>> {
        match (&self.machine, &self.bus) {
            (Some(MachineArgument::EtherCat(_)), _) if self.simulated_time => Err(miette!(
                help = "leave --simulated-time out; virtual and udp:PORT run in simulated time",
                "devices on a bus have clocks of their own, and cannot run in simulated time"
            )),
            (Some(MachineArgument::EtherCat(interface)), file) => {
                let table = bus::table(file.as_deref(), &self.crane, model)?;
                Ok(Some((table, bus::open(interface)?)))
            }
            (_, Some(_)) => Err(miette!(
                help = "name the interface, as in --machine ethercat:eth1",
                "--bus is the table of devices at a network interface, and the machine is none"
            )),
            (_, None) => Ok(None),
        }
    }

    /// Limits of the crane, its delivered flow against the baseline where one is named.
    fn limits(&self, model: &Description) -> Result<Limits> {
        let mut limits = limits(model, model.numbers.fast).into_diagnostic()?;
        if let Some(path) = &self.baseline {
            let baseline = FlowBaseline::read(model, path).into_diagnostic()?;
            limits.flow = baseline.narrowed(limits.flow);
        }
        Ok(limits)
    }

    /// Estimator parameters of an earlier run, if their file exists.
    fn retained(&self, model: &Description) -> Result<Option<RetainedParameters<f64>>> {
        match &self.parameters {
            Some(path) if path.exists() => {
                let retained = parameter_file::read(model, path).into_diagnostic()?;
                let said = parameter_file::summary(model, &retained);
                output::note(&format!("{}: loaded, {said}", path.display()));
                Ok(Some(retained))
            }
            Some(path) => {
                let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
                if folder.is_some_and(|folder| !folder.is_dir()) {
                    return Err(miette!("{}: its folder does not exist", path.display()));
                }
                output::note(&format!(
                    "{}: does not exist yet; the estimator starts with the crane file",
                    path.display()
                ));
                Ok(None)
            }
            None => Ok(None),
        }
    }

    /// Writes the estimator's parameters for the next run; those of a diverged estimator are not kept.
    fn retain(&self, model: &Description, watch: &Watch) {
        let Some(path) = &self.parameters else { return };
        let diverged = Some(Fallback::Estimator.name());
        if watch.results.iter().any(|result| result.fallback_cause == diverged) {
            output::note(&format!("{}: not written, since the estimator diverged", path.display()));
            return;
        }
        let estimates = watch.session().last().and_then(|record| record.estimates);
        let Some(estimates) = estimates else {
            output::note(&format!("{}: not written, since nothing was estimated", path.display()));
            return;
        };
        if !output::file(path, parameter_file::text(model, &estimates.parameters).as_bytes()) {
            return;
        }
        let said = parameter_file::summary(model, &estimates.parameters);
        output::note(&format!("{}: written, {said}", path.display()));
    }

    /// Records the baseline of delivered flow from the last course.
    fn record(&self, model: &Description, watch: &Watch) -> Result<()> {
        let Some(path) = &self.record_baseline else { return Ok(()) };
        let fault = watch.results.last().and_then(|result| result.fault);
        if let (Some(fault), _) | (None, Some(fault)) =
            (fault, watch.session().fault().map(|fault| fault.cause.code()))
        {
            output::note(&format!("no baseline: the course was stopped by {fault}"));
            return Ok(());
        }
        let monitor = limits(model, model.numbers.fast).into_diagnostic()?.flow;
        let baseline =
            FlowBaseline::of_course(model, &monitor, &watch.records).into_diagnostic()?;
        if !output::file(path, baseline.text().as_bytes()) {
            return Ok(());
        }
        output::note(&format!(
            "baseline of delivered flow: gain {:.4}, leakage {:.2} times the described, residual {:.2} mm: {}",
            baseline.gain,
            baseline.leakage,
            baseline.residual * 1e3,
            path.display()
        ));
        Ok(())
    }

    /// Attendant of the run.
    fn watch(
        &self,
        cranes: &Cranes,
        desk: &Arc<Desk>,
        wanted: RequestedCourse,
        switch: Switch,
    ) -> Result<Watch> {
        let log = match &self.log {
            Some(path) => {
                let begun = LogWriter::begin(path);
                begun.map_err(|error| output::written(path, Err(error))).ok()
            }
            None => None,
        };
        let session = Session::new(&cranes.model);
        let mut watch = Watch::new(session, Arc::clone(desk), wanted).with_log(log);
        if !self.simulated_time || self.dashboard.is_some() {
            watch = watch.speaking();
        }
        let Some(address) = self.dashboard else {
            if self.listen {
                return Ok(watch);
            }
            let plan = Plan {
                left: self.cycles.unwrap_or(1),
                carry_on: self.carry_on,
                waits: !self.auto && !self.simulated_time,
            };
            if plan.waits {
                wait_for_enter(watch.starter());
            }
            return Ok(watch.with_switch(switch).with_plan(plan));
        };
        let setup = Setup {
            model: &cranes.model,
            scenarios: scenarios(&cranes.machine).iter().map(|s| s.name.to_string()).collect(),
            speeds_mm_s: cranes.speeds_mm_s(),
            first: Choice { strategy: self.strategy, course: self.chosen_course(cranes) },
            is_virtual: !cranes.source.is_attached(),
            in_real_time: !self.simulated_time,
        };
        let dashboard = Dashboard::open(address, self.allow_remote, &setup, Arc::clone(desk))
            .into_diagnostic()?;
        output::note(&format!("dashboard: {}", dashboard.address()));
        Ok(watch.with_dashboard(dashboard, cranes.courses()))
    }

    /// First course of the dashboard.
    fn chosen_course(&self, cranes: &Cranes) -> dashboard::Course {
        match &self.scenario {
            Some(name) => dashboard::Course::Scenario { name: name.clone() },
            None => {
                let speed_mm_s = self.speed_mm_s.unwrap_or(cranes.model.numbers.fast * 1e3);
                dashboard::Course::Motion { speed_mm_s }
            }
        }
    }

    /// Prints the results and writes the report.
    fn conclude(
        &self,
        cranes: &Cranes,
        watch: &Watch,
        simulated: Option<&CourseResult>,
        (real_time, bus): (Option<&RealTime>, Option<&AttachmentResult>),
    ) -> Result<()> {
        let results = &watch.results;
        let report = Report {
            cranes,
            results,
            simulated: simulated.filter(|_| real_time.is_some()),
            paper: self
                .paper(cranes, results)
                .filter(|_| self.crane.is_papers_crane().unwrap_or(false)),
            synchronised: watch.session().synchronised_in_all(),
            real_time,
            bus,
        };
        if let Some(path) = &self.report {
            let page = page::run_page(
                cranes,
                results,
                report.paper,
                &watch.records,
                real_time,
                &processor(),
            );
            output::page(path, &page.into_diagnostic()?, None);
        }
        match self.json {
            true => output::json(&report.json())?,
            false => {
                let mut said = report.text();
                for (what, path) in [("log", &self.log), ("report", &self.report)] {
                    if let Some(path) = path {
                        said += &output::named(what, path);
                    }
                }
                output::text(&said)?;
            }
        }
        if let (Some(log), Some(frames)) = (&self.log, bus.and_then(AttachmentResult::frames)) {
            // never the log's own path
            let extension = if log.extension().is_some_and(|own| own == "pcapng") {
                "bus.pcapng"
            } else {
                "pcapng"
            };
            let capture = log.with_extension(extension);
            if output::file(&capture, frames) {
                output::note(&format!("the last frames before the fault: {}", capture.display()));
            }
        }
        let Some(fault) = watch.session().fault() else { return Ok(()) };
        if let Some(path) = &self.report {
            let data = path.with_extension("fault.csv");
            if output::file(&data, hydroboom_realtime::log::csv(&fault.records).as_bytes()) {
                output::note(&format!("the last second before the fault: {}", data.display()));
            }
        }
        if self.dashboard.is_some() || self.carry_on {
            return Ok(());
        }
        let reported = fault.records.last().and_then(|record| record.status);
        let reported = match reported {
            Some(MachineStatus::Fault { code }) => format!(", the machine's code {code:#06x}"),
            _ => String::new(),
        };
        let advice = match bus.and_then(AttachmentResult::fault) {
            Some(sentence) => sentence.to_string(),
            None => fault.cause.advice().to_string(),
        };
        Err(miette!(
            help = advice,
            "the supervisor stopped it at {:.3} s: {}{reported}",
            fault.time,
            fault.cause.code()
        ))
    }

    /// Values measured by the paper in the same test.
    fn paper(&self, cranes: &Cranes, results: &[CourseResult]) -> Option<[f64; 2]> {
        let result = results.first().filter(|r| r.then.is_none() && self.scenario.is_none())?;
        let speed = self.speed_mm_s.unwrap_or(cranes.model.numbers.fast * 1e3);
        let column = paper::SPEEDS_MM_S.iter().position(|v| (v - speed).abs() < 1e-6)?;
        let (rms, peak) = paper::tracking_mm(result.strategy.parse().ok()?)?;
        Some([rms[column], peak[column]])
    }
}

/// Longest course that is simulated beforehand \[s\].
const LONGEST_BEFOREHAND: f64 = 120.0;

/// Start of a run: strategy, limits, and the estimator's parameters of an earlier run.
type Begin = (Strategy, Limits, Option<RetainedParameters<f64>>);

/// Runs the virtual crane in a process of its own, in real time.
fn in_real_time(cranes: &Cranes, begin: Begin, lookout: Lookout<'_>) -> Result<RealTime> {
    let memory = Memory::new()?;
    let open = |result: std::io::Result<Shared>| {
        result.into_diagnostic().wrap_err_with(|| memory.path.display().to_string())
    };
    let shared = open(Shared::create(&memory.path))?;
    let tampering = open(Shared::open(&memory.path))?;
    let mut host = Host::start(&memory.path, cranes.arguments())?;
    let (control, simulation) = cranes.control_and_simulation(begin)?;
    let n = &cranes.model.numbers;
    let tasks = Tasks {
        control,
        simulation,
        machine: Box::new(shared),
        periods: (n.simulation_period, n.control_period),
        placement: Placement::default(),
    };
    let mut number = 0;
    let real_time = executive::run(tasks, lookout, &mut |what| {
        number += 1;
        tampering.tamper(number, what);
    })
    .into_diagnostic()?;
    host.end();
    Ok(real_time)
}

impl Cranes {
    /// Control task and simulated crane.
    fn control_and_simulation(
        &self,
        (strategy, limits, retained): Begin,
    ) -> Result<(ControlTask, SimulationTask)> {
        let model = &self.model;
        let motion = self.machine.motion(model.numbers.fast);
        let control = ControlTask::new(model, Course::new(Arc::new(motion)), limits, strategy);
        let control = match retained {
            Some(retained) => control.with_retained_parameters(retained),
            None => control,
        };
        Ok((control, SimulationTask::new(model, motion.start).into_diagnostic()?))
    }

    /// Course at a speed \[mm/s\] or of a scenario.
    fn course(&self, speed_mm_s: Option<f64>, scenario: Option<&str>) -> Result<RequestedCourse> {
        let speed = speed_mm_s.map_or(self.model.numbers.fast, |mm_s| mm_s * 1e-3);
        let speeds = self.speeds_mm_s();
        if speed_mm_s.is_some_and(|mm_s| !speeds.contains(&mm_s)) {
            miette::bail!(
                "a speed of {:.3} mm/s: it is {:.1} to {:.0} mm/s",
                speed * 1e3,
                speeds.start(),
                speeds.end()
            );
        }
        let choice = match scenario {
            Some(name) => CourseChoice::Scenario(name.into()),
            None => CourseChoice::Motion(speed),
        };
        let course = choice.of(&self.machine).into_diagnostic()?;
        let payload_changes = course.loads().iter().map(|load| (load.time, load.mass)).collect();
        Ok(RequestedCourse {
            name: course.name(),
            path: Arc::from(course as Box<dyn Trajectory>),
            payload_changes,
        })
    }

    /// Range of the motion's speed \[mm/s\].
    fn speeds_mm_s(&self) -> RangeInclusive<f64> {
        0.1..=2e3 * self.model.numbers.fast
    }

    /// Builder of the courses requested at a dashboard.
    fn courses(&self) -> Courses {
        let cranes = self.clone();
        Box::new(move |course| match course {
            dashboard::Course::Motion { speed_mm_s } => cranes.course(Some(*speed_mm_s), None),
            dashboard::Course::Scenario { name } => cranes.course(None, Some(name)),
        })
    }

    fn lockstep(&self, strategy: Strategy) -> Result<Lockstep> {
        let motion = self.machine.motion(self.model.numbers.fast);
        Lockstep::new(&self.model, &self.machine, motion, strategy).into_diagnostic()
    }

    /// The course in simulated time for comparison; none if it is not requested or too long.
    fn beforehand(
        &self,
        wanted: &RequestedCourse,
        switch: Switch,
        is_needless: bool,
    ) -> Result<Option<CourseResult>> {
        if is_needless || wanted.path.duration() > LONGEST_BEFOREHAND {
            return Ok(None);
        }
        let desk = Arc::new(Desk::new(switch.first));
        let session = Session::new(&self.model);
        let plan = Plan { left: 1, carry_on: false, waits: false };
        let mut watch = Watch::new(session, Arc::clone(&desk), wanted.clone())
            .with_switch(switch)
            .with_plan(plan);
        let lookout = Lookout { desk: &desk, attendant: &mut watch, ending: Ending::OnceClosed };
        let run = self.lockstep(switch.first)?;
        lockstep::run(run, &self.machine, lookout, Pace::Free).into_diagnostic()?;
        Ok(watch.results.pop())
    }
}

/// Refuses `--learned`.
fn replaced_by_the_estimator(_: &str) -> Result<PathBuf, String> {
    Err("the state estimator of scheduled-lqr, which runs in every run, replaced what was learned; --parameters keeps its estimates in a \
         file"
        .into())
}

/// Handles Ctrl-C: the first one stops and ends the run, the second one holds the load at once.
fn attend(desk: &Arc<Desk>) -> Result<()> {
    let desk = Arc::clone(desk);
    let mut pressed = false;
    ctrlc::set_handler(move || {
        if std::mem::replace(&mut pressed, true) {
            output::note("emergency stop");
            desk.emergency_stop();
        } else {
            output::note("stopping; Ctrl-C again for an emergency stop");
            desk.close();
        }
    })
    .into_diagnostic()
}

/// Waits for Enter, which starts the planned course.
fn wait_for_enter(started: Arc<std::sync::atomic::AtomicBool>) {
    output::note("the load is held; Enter starts the motion, Ctrl-C ends");
    std::thread::spawn(move || {
        let mut line = String::new();
        if std::io::stdin().read_line(&mut line).is_ok_and(|count| count > 0) {
            started.store(true, std::sync::atomic::Ordering::Relaxed);
        }
    });
}
