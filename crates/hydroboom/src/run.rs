//! `hydroboom run`

use crate::crane_file::{CraneFile, text};
use crate::output;
use crate::virtual_crane::StrategyName;
use clap::Args;
use hydroboom_control::{Cause, Motion, State, Strategy};
use hydroboom_description::Description;
use hydroboom_lab::paper;
use hydroboom_realtime::control_task::{ControlTask, Record, limits};
use hydroboom_realtime::desk::Desk;
use hydroboom_realtime::executive::{self, Placement, RealTime};
use hydroboom_realtime::lockstep::Lockstep;
use hydroboom_realtime::log::LogWriter;
use hydroboom_realtime::operator::Operator;
use hydroboom_realtime::shared::Shared;
use hydroboom_realtime::simulation_task::SimulationTask;
use hydroboom_realtime::timing::Timing;
use miette::{IntoDiagnostic, Result, WrapErr, miette};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;

/// Run the motion in real time on the virtual crane, which plays the machine in a process of its own.
#[derive(Args)]
#[command(after_help = "Examples:\n  hydroboom run --auto\n  hydroboom run --auto --strategy \
    benchmark-closed-loop --speed-mm-s 25\n  hydroboom run --auto --simulated-time\n\n\
    Ctrl-C stops under control, a second Ctrl-C holds the load at once.\n\
    The supervisor is no safety function in the sense of ISO 13849: at a real machine a hardware \
    emergency stop stays.")]
pub struct Run {
    #[command(flatten)]
    crane: CraneFile,
    /// Crane file of the virtual crane that plays the machine; the embedded one when not given.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    /// How the motor's speed is found.
    #[arg(long, value_enum, default_value = "simulation-feedforward-closed-loop")]
    strategy: StrategyName,
    /// Change to this strategy in the middle of the motion, without a bump.
    #[arg(long, value_enum, value_name = "STRATEGY")]
    then: Option<StrategyName>,
    /// Speed of the motion; the model's fast one when not given.
    #[arg(long)]
    speed_mm_s: Option<f64>,
    /// Start at once, without waiting for Enter.
    #[arg(long)]
    auto: bool,
    /// Log to write, MCAP: Foxglove and PlotJuggler open it, `hydroboom log to-csv` converts it.
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// In simulated time: the same tasks, as fast as they go, every time the same.
    #[arg(long)]
    simulated_time: bool,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// What a run came to.
struct Done {
    records: Vec<Record>,
    real_time: Option<RealTime>,
}

impl Run {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let model = self.crane.read()?;
        let machine = match &self.machine {
            Some(path) => Description::parse(&path.display().to_string(), &text(path)?)?,
            None => Description::uia_virtual()?,
        };
        let speed = self.speed_mm_s.map_or(model.numbers.fast, |mm_s| mm_s * 1e-3);
        if !(speed > 0.0 && speed.is_finite()) {
            miette::bail!("--speed-mm-s is a positive number");
        }
        let motion = machine.motion(speed);
        let strategy = Strategy::from(self.strategy);
        let switch = Switch {
            first: strategy,
            then: self.then.map_or(strategy, Strategy::from),
            at: 0.5 * motion.duration(),
        };
        let mut log = match &self.log {
            Some(path) => Some(LogWriter::begin(path).into_diagnostic()?),
            None => None,
        };
        let simulated = in_simulated_time(&model, &machine, motion, &switch)?;
        if self.simulated_time {
            simulated.records.iter().for_each(|record| add(&mut log, record));
            log.map_or(Ok(()), LogWriter::finish).into_diagnostic()?;
            return self.report(&model, speed, &switch, &simulated, None);
        }
        let done = self.in_real_time(&model, motion, &switch, &mut log)?;
        log.map_or(Ok(()), LogWriter::finish).into_diagnostic()?;
        self.report(&model, speed, &switch, &done, Some(&simulated))
    }

    fn in_real_time(
        &self,
        model: &Description,
        motion: Motion<f64>,
        switch: &Switch,
        log: &mut Option<LogWriter>,
    ) -> Result<Done> {
        let memory = Memory::new()?;
        let shared = Shared::create(&memory.path)
            .into_diagnostic()
            .wrap_err_with(|| memory.path.display().to_string())?;
        let mut host = Host::start(&memory.path, self.machine.as_deref())?;
        let n = &model.numbers;
        let control = ControlTask::new(model, motion, limits(model, motion.speed), switch.first);
        let start = model.start(motion.start);
        let simulation = SimulationTask::new(model, &start).into_diagnostic()?;
        let desk = Arc::new(Desk::new(switch.first));
        attend(&desk, self.auto)?;

        let mut records = Vec::with_capacity(100_000);
        let mut state = None;
        let periods = (n.simulation_period, n.control_period);
        let placement = Placement::default();
        let real_time = executive::run(
            control,
            simulation,
            Box::new(shared),
            &desk,
            periods,
            &placement,
            |record| {
                desk.choose(switch.at_time(record.course_time));
                let now = record.decision.state;
                if state.replace(now) != Some(now) {
                    eprintln!("{:8.3} s  {}", record.time, said(now, record.decision.cause));
                }
                add(log, record);
                records.push(*record);
            },
        )
        .into_diagnostic()?;
        host.end();
        Ok(Done { records, real_time: Some(real_time) })
    }

    fn report(
        &self,
        model: &Description,
        speed: f64,
        switch: &Switch,
        done: &Done,
        simulated: Option<&Done>,
    ) -> Result<()> {
        let [rms, peak] = errors(&done.records);
        let paper = paper::SPEEDS_MM_S
            .iter()
            .position(|v| (v - speed * 1e3).abs() < 1e-6)
            .filter(|_| switch.first == switch.then)
            .map(|column| {
                let (rms, peak) = paper::tracking_mm(switch.first);
                [rms[column], peak[column]]
            });
        let end = done.records.last().map(|r| r.decision);
        let cause = end.and_then(|d| d.cause);
        if self.json {
            let timing = done.real_time.as_ref().map(|r| {
                json!({
                    "simulation": timing_json(&r.simulation), "control": timing_json(&r.control),
                    "lost": r.lost, "records_dropped": r.dropped,
                })
            });
            output::json(&json!({
                "strategy": switch.first.name(), "then": switch.then.name(),
                "speed_mm_s": speed * 1e3, "rms_mm": rms, "peak_mm": peak,
                "paper": paper, "simulated_time": simulated.map(|s| errors(&s.records)),
                "fault": cause.map(Cause::code), "timing": timing, "processor": processor(),
            }))?;
        } else {
            let row = |name: &str, [rms, peak]: [f64; 2]| {
                vec![name.to_string(), format!("{rms:.3}"), format!("{peak:.3}")]
            };
            let mut rows = vec![row("here", [rms, peak])];
            if let Some(simulated) = simulated {
                rows.push(row("the same in simulated time", errors(&simulated.records)));
            }
            if let Some(paper) = paper {
                rows.push(row("paper, measured on its crane", paper));
            }
            let title = match switch.first == switch.then {
                true => switch.first.name().to_string(),
                false => format!("{}, then {}", switch.first.name(), switch.then.name()),
            };
            let mut said = format!(
                "{title} at {:.0} mm/s on the virtual crane: tracking error x - x_ref\n{}",
                speed * 1e3,
                output::table(&["", "RMS [mm]", "peak [mm]"], &rows)
            );
            if let Some(real_time) = &done.real_time {
                said += &timing_table(model, real_time);
            }
            if let Some(log) = &self.log {
                said += &format!("\nlog: {}", log.display());
            }
            output::text(&said)?;
        }
        match cause {
            None => Ok(()),
            Some(cause) => {
                Err(miette!(help = cause.advice(), "the supervisor stopped it: {}", cause.code()))
            }
        }
    }
}

/// Adds a record; a log that cannot be written is given up, and the run goes on.
fn add(log: &mut Option<LogWriter>, record: &Record) {
    if let Some(writer) = log
        && let Err(error) = writer.add(record)
    {
        eprintln!("the log ends here: {error}");
        *log = None;
    }
}

/// Which strategy when.
struct Switch {
    first: Strategy,
    then: Strategy,
    /// Time of the course \[s\].
    at: f64,
}

impl Switch {
    fn at_time(&self, course_time: Option<f64>) -> Strategy {
        if course_time.is_some_and(|time| time >= self.at) { self.then } else { self.first }
    }
}

fn in_simulated_time(
    model: &Description,
    machine: &Description,
    motion: Motion<f64>,
    switch: &Switch,
) -> Result<Done> {
    let mut run = Lockstep::new(model, machine, motion, switch.first).into_diagnostic()?;
    let mut operator = Operator::new(true);
    let mut records: Vec<Record> = Vec::with_capacity(100_000);
    while !operator.is_done() {
        let strategy = switch.at_time(records.last().and_then(|r| r.course_time));
        records.push(run.period(&mut operator, strategy).into_diagnostic()?);
    }
    Ok(Done { records, real_time: None })
}

/// RMS and peak of the tracking error \[mm\].
fn errors(records: &[Record]) -> [f64; 2] {
    let errors = || records.iter().filter_map(Record::error);
    let sum: f64 = errors().map(|e| e * e).sum();
    let peak = errors().fold(0.0, |peak: f64, e| if e.abs() > peak.abs() { e } else { peak });
    [(sum / errors().count().max(1) as f64).sqrt() * 1e3, peak * 1e3]
}

/// Starts at once or on Enter; Ctrl-C stops.
fn attend(desk: &Arc<Desk>, auto: bool) -> Result<()> {
    let on_signal = Arc::clone(desk);
    let mut pressed = false;
    ctrlc::set_handler(move || {
        if std::mem::replace(&mut pressed, true) {
            eprintln!("emergency stop");
            on_signal.emergency_stop();
        } else {
            eprintln!("stopping; once more for an emergency stop");
            on_signal.stop();
        }
    })
    .into_diagnostic()?;
    if auto {
        desk.start();
        return Ok(());
    }
    eprintln!("the load is held; Enter starts the motion, Ctrl-C ends");
    let on_enter = Arc::clone(desk);
    std::thread::spawn(move || {
        let mut line = String::new();
        if std::io::stdin().read_line(&mut line).is_ok_and(|count| count > 0) {
            on_enter.start();
        }
    });
    Ok(())
}

fn said(state: State, cause: Option<Cause>) -> String {
    match cause {
        Some(cause) => format!("{state:?}: {}: {}", cause.code(), cause.advice()),
        None => format!("{state:?}"),
    }
}

fn timing_json(t: &Timing) -> serde_json::Value {
    json!({
        "period_us": t.period as f64 * 1e-3, "steps": t.steps, "missed": t.missed,
        "execution_p50_us": t.execution_us(0.5), "execution_p999_us": t.execution_us(0.999),
        "execution_worst_us": t.worst.0 as f64 * 1e-3, "worst_at_s": t.worst.1 as f64 * 1e-9,
        "late_p50_us": t.lateness_us(0.5), "late_p999_us": t.lateness_us(0.999),
        "late_worst_us": t.lateness_us(1.0), "taken_by_others_ms": t.taken as f64 * 1e-6,
    })
}

fn timing_table(model: &Description, r: &RealTime) -> String {
    let row = |name: &str, t: &Timing| {
        vec![
            name.to_string(),
            format!("{:.0}", t.period as f64 * 1e-3),
            t.steps.to_string(),
            format!("{:.2}", t.execution_us(0.5)),
            format!("{:.2}", t.execution_us(0.999)),
            format!("{:.1} at {:.3} s", t.worst.0 as f64 * 1e-3, t.worst.1 as f64 * 1e-9),
            format!("{:.1}", t.lateness_us(0.5)),
            format!("{:.1}", t.lateness_us(0.999)),
            format!("{:.1}", t.lateness_us(1.0)),
            t.missed.to_string(),
            format!("{:.1}", t.taken as f64 * 1e-6),
        ]
    };
    let header = [
        "task",
        "period [us]",
        "steps",
        "execution p50 [us]",
        "p99.9",
        "worst",
        "late p50 [us]",
        "p99.9",
        "worst",
        "missed",
        "taken by others [ms]",
    ];
    let table =
        output::table(&header, &[row("simulation", &r.simulation), row("control", &r.control)]);
    let mut said = format!(
        "\n\nDeadlines on {}\n{table}\nexecution is the thread's time on its processor; what other threads took \
         stands apart, what a hypervisor took does not: the kernel does not tell it. The paper ran both tasks at {:.0} us and {:.0} us on its IPC and prints no execution \
         times.",
        processor(),
        model.numbers.simulation_period * 1e6,
        model.numbers.control_period * 1e6,
    );
    for lost in &r.lost {
        said += &format!("\nnot granted: {lost}");
    }
    if r.dropped > 0 {
        said += &format!("\n{} records were lost on their way here", r.dropped);
    }
    said
}

/// Processor and kernel, as the system names them.
fn processor() -> String {
    let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    let cpus = read("/proc/cpuinfo");
    let model = cpus.lines().find_map(|line| line.strip_prefix("model name"));
    let model = model.and_then(|rest| rest.split(':').nth(1)).unwrap_or("an unknown processor");
    let cores = cpus.lines().filter(|line| line.starts_with("processor")).count();
    format!("{}, {cores} cores, Linux {}", model.trim(), read("/proc/sys/kernel/osrelease").trim())
}

/// A place for the shared memory that goes away with us.
struct Memory {
    path: PathBuf,
}

impl Memory {
    fn new() -> Result<Self> {
        let folder = Path::new("/dev/shm");
        let folder = if folder.is_dir() { folder.into() } else { std::env::temp_dir() };
        let path = folder.join(format!("hydroboom-{}", std::process::id()));
        // of a process that had our number and was killed
        if path.exists() {
            std::fs::remove_file(&path).into_diagnostic()?;
        }
        Ok(Self { path })
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

/// The machine's process.
struct Host(Child);

impl Host {
    fn start(shared: &Path, crane: Option<&Path>) -> Result<Self> {
        let program = std::env::current_exe().into_diagnostic()?;
        let mut command = Command::new(program);
        command.arg("machine").arg("--shared").arg(shared).stdin(Stdio::null());
        if let Some(crane) = crane {
            command.arg("--crane").arg(crane);
        }
        // Ctrl-C is for us: the machine goes on, or nothing would be there to be stopped
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        Ok(Self(command.spawn().into_diagnostic().wrap_err("the machine's process")?))
    }

    fn end(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        self.end();
    }
}
