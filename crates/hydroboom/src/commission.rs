//! `hydroboom commission`

use crate::commissioning_basis::{of_bus, of_local, of_virtual};
use crate::crane_file::CraneFile;
use crate::machine_argument::MachineArgument;
use crate::machine_choice::MachineChoice;
use crate::output;
use crate::paths::{InputFile, OutputFile};
use crate::run::{attachment, bus};
use crate::signals_text::signals_text;
use clap::Args;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_design::limits;
use hydroboom_fieldbus::bus_task::{BusThread as FieldbusThread, Started};
use hydroboom_fieldbus::start_up::InitialState;
use hydroboom_files::try_place;
use hydroboom_realtime::commissioning::finding::Outcome;
use hydroboom_realtime::commissioning::record::{self, Basis};
use hydroboom_realtime::commissioning::sequence::Sequence;
use hydroboom_realtime::commissioning::settings::Settings;
use hydroboom_realtime::commissioning::simulated_machine::{Mistakes, SimulatedMachine};
use hydroboom_realtime::commissioning::step::Step;
use hydroboom_realtime::commissioning::task::{self, Person, Told};
use hydroboom_realtime::desk::Desk;
use hydroboom_realtime::executive::Placement;
use hydroboom_realtime::machine::Machine;
use miette::{IntoDiagnostic, Result, miette};
use serde_json::{Value, json};
use std::io::IsTerminal;
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::time::{Duration, SystemTime};

/// Interval of the check for Ctrl-C while a line is awaited.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// Commission a machine: its first motions in steps that are each bounded in movement, and a record of them.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom commission --machine virtual --simulated-time --record virtual.toml\n  \
    hydroboom commission --machine udp:8150 --crane my-crane.toml --record machine.toml\n  \
    hydroboom commission --machine ethercat:eth1 --bus bus.toml --crane my-crane.toml --record machine.toml\n\n\
    Ctrl-C stops at once. It is no safety function: the hardware emergency stop has to be in reach."
)]
pub struct Commission {
    #[command(flatten)]
    crane: CraneFile,
    /// The machine: virtual or virtual:FILE, the virtual crane (of that crane file); udp:PORT, another process on the
    /// local interface; or ethercat:INTERFACE, devices at that network interface.
    #[arg(
        long, value_name = "virtual[:FILE]|udp:PORT|ethercat:INTERFACE",
        value_parser = MachineArgument::parser()
    )]
    machine: MachineArgument,
    /// With ethercat:INTERFACE: table of the devices on the bus and of their signals. Default: the table
    /// [machine.ethercat] of the crane file.
    #[arg(long, value_name = "FILE")]
    bus: Option<InputFile>,
    /// Record to write (TOML): results, measured quantities, and the machine and files that they are valid for. `run`
    /// reads it by --commissioning.
    #[arg(long, value_name = "FILE")]
    record: OutputFile,
    /// Simulated time: with the virtual crane, as fast as possible; a simulated operator opens the stop circuit.
    #[arg(long)]
    simulated_time: bool,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Commission {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        if let Err(error) = try_place(&self.record) {
            return Err(miette!(
                help = "name a file that can be written with --record",
                "commissioning does not begin without its record: {error}"
            ));
        }
        let model = self.crane.read()?;
        let settings = Settings::default();
        let limits = limits(&model, settings.travel_speed).into_diagnostic()?;
        let begin = |is_identified| Sequence::new(limits, settings, is_identified);
        let person = Arc::new(Person::default());
        let is_virtual = matches!(self.machine, MachineArgument::Virtual(_));
        if self.simulated_time && !is_virtual {
            return Err(miette!(
                help = "leave --simulated-time out; only the virtual crane is commissioned in simulated time",
                "a machine with a clock of its own cannot be commissioned in simulated time"
            ));
        }
        if self.bus.is_some() && !matches!(self.machine, MachineArgument::EtherCat(_)) {
            return Err(miette!(
                help = "name the interface, as in --machine ethercat:eth1",
                "--bus is the table of an EtherCAT bus, and --machine names no network interface"
            ));
        }
        let (basis, sequence, machine) = match &self.machine {
            MachineArgument::Virtual(file) => {
                let choice = MachineChoice::of(model, &self.crane, file.as_deref())?;
                let basis = of_virtual(&choice.model, &choice.machine);
                let mut machine = SimulatedMachine::new(&choice.machine, Mistakes::default())
                    .into_diagnostic()?;
                let mut sequence = begin(true);
                attend(&person)?;
                let mut told = None;
                task::run_simulated(
                    &mut sequence,
                    &mut machine,
                    !self.simulated_time,
                    &person,
                    &mut |sequence, _| {
                        let step = sequence.step();
                        if told.replace(step) != Some(step) {
                            tell(Told::Step(step));
                        }
                    },
                )
                .into_diagnostic()?;
                (basis, sequence, choice.name())
            }
            MachineArgument::Udp(port) => {
                let desk = Arc::new(Desk::new(Strategy::BenchmarkClosedLoop));
                attend_both(&person, &desk)?;
                let (mut bus, side) = attachment::open(*port, &model)?;
                if !attachment::wait_for_machine(&mut bus, &desk)? {
                    return Ok(());
                }
                let basis = of_local(&model, &bus);
                let is_identified = bus.endpoint.machine().is_some();
                let thread = bus.spawn(Placement::default().control_core);
                let ran = consent(&basis, &person).and_then(|lines| {
                    run(begin(is_identified), Box::new(side), &model, &person, lines)
                });
                let report = thread.end();
                report.iter().flat_map(|report| &report.remarks).for_each(|r| output::note(r));
                (basis, ran?, format!("udp:{port}"))
            }
            MachineArgument::EtherCat(interface) => {
                let table = bus::table(self.bus.as_deref(), &self.crane, &model)?;
                let socket = bus::open(interface)?;
                attend(&person)?;
                let about = table.clone();
                let core = Placement::default().control_core;
                let started = FieldbusThread::start(InitialState::SafeOp, table, socket, core)
                    .into_diagnostic()?;
                let Started { thread, machine, facts, .. } = started;
                let basis = of_bus(&model, &about, &facts);
                let ran = consent(&basis, &person).and_then(|lines| {
                    run(begin(!facts.is_empty()), Box::new(machine), &model, &person, lines)
                });
                let report = thread.end();
                if let Some((_, sentence)) =
                    report.as_ref().and_then(|report| report.fault.as_ref())
                {
                    output::note(&format!("fault of the bus: {sentence}"));
                }
                report.iter().flat_map(|report| &report.remarks).for_each(|r| output::note(r));
                (basis, ran?, format!("ethercat:{interface}"))
            }
        };
        self.conclude(&basis, &sequence, &machine)
    }

    /// Writes the record, prints the results, and reports the step that failed.
    fn conclude(&self, basis: &Basis, sequence: &Sequence, machine: &str) -> Result<()> {
        let date = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
        let text = record::text(basis, machine, &date, sequence);
        output::file(&self.record, text.as_bytes());
        match self.json {
            true => output::json(&results(basis, sequence, machine))?,
            false => {
                let which = if basis.is_simulated { "simulated machine" } else { "machine" };
                let rows: Vec<Vec<String>> = Step::ALL
                    .iter()
                    .zip(sequence.outcomes())
                    .map(|(step, outcome)| {
                        let name = outcome.as_ref().map_or("not reached", Outcome::name);
                        vec![step.name().into(), name.into(), remark(*step, outcome, sequence)]
                    })
                    .collect();
                let table = output::table(&["step", "result", "measured"], &rows);
                let said = format!("Commissioning of the {which} at {machine}\n{table}");
                output::text(&(said + &output::named("record", &self.record)))?;
            }
        }
        if record::permits_motion(basis, sequence) {
            return Ok(());
        }
        if sequence.has_passed() {
            return Err(miette!(
                help = "let the machine report its state, then start commissioning again",
                "the stop circuit of this real machine was not tested, and `hydroboom run` requires it"
            ));
        }
        let step = sequence.step();
        let why = match &sequence.outcomes()[step.place()] {
            Some(Outcome::Failed(finding)) => finding.to_string(),
            _ => "the step did not finish".into(),
        };
        Err(miette!(
            help = "remove the cause, then start commissioning again from the beginning",
            "commissioning failed in step {}: {why}",
            step.name()
        ))
    }
}

/// What was measured in a step, or why it was skipped or failed.
fn remark(step: Step, outcome: &Option<Outcome>, sequence: &Sequence) -> String {
    match outcome {
        Some(Outcome::Skipped(reason)) => reason.to_string(),
        Some(Outcome::Failed(finding)) => finding.to_string(),
        _ => {
            let all = record::measured(step, sequence.quantities());
            // rest and noise of each signal are in the record
            let few = all.iter().filter(|(_, value)| value.is_finite() && all.len() < 8);
            let parts: Vec<String> = few.map(|(key, value)| format!("{key} {value:.3}")).collect();
            parts.join(", ")
        }
    }
}

/// Results as JSON.
fn results(basis: &Basis, sequence: &Sequence, machine: &str) -> Value {
    let steps = Step::ALL.iter().zip(sequence.outcomes()).map(|(step, outcome)| {
        let all = record::measured(*step, sequence.quantities());
        let known = all.into_iter().filter(|(_, value)| value.is_finite());
        let measured: serde_json::Map<String, Value> =
            known.map(|(key, value)| (key, json!(value))).collect();
        let (reason, finding) = match outcome {
            Some(Outcome::Skipped(reason)) => (Some(reason.to_string()), None),
            Some(Outcome::Failed(finding)) => (None, Some(finding.to_string())),
            _ => (None, None),
        };
        json!({
            "axis": 0, "name": step.name(),
            "outcome": outcome.as_ref().map_or("not reached", Outcome::name),
            "reason": reason, "finding": finding, "measured": measured,
        })
    });
    json!({
        "machine": machine, "is_simulated": basis.is_simulated,
        "passed": record::permits_motion(basis, sequence),
        "steps": steps.collect::<Vec<_>>(),
    })
}

/// At a real machine the operator, at a terminal, begins. Returns the operator's further lines.
fn consent(basis: &Basis, person: &Person) -> Result<Receiver<()>> {
    if basis.is_simulated {
        output::note("simulated machine");
        return Ok(lines());
    }
    if !std::io::stdin().is_terminal() {
        return Err(miette!(
            help = "start it in a terminal, at the machine",
            "a real machine is commissioned by its operator at a terminal, and standard input is no terminal"
        ));
    }
    output::note(
        "this machine is real. Make sure that nobody is under or beside the load, that the hardware emergency stop is \
         in reach and was tested, and that a fall of the load to its mechanical stop does no harm. Enter begins, \
         Ctrl-C ends",
    );
    let lines = lines();
    loop {
        let line = lines.recv_timeout(POLL_INTERVAL);
        if person.is_ended() {
            return Err(miette!("not begun: aborted by the operator"));
        }
        match line {
            Ok(()) => return Ok(lines),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                return Err(miette!("not begun: standard input was closed"));
            }
        }
    }
}

/// Lines of standard input, each as a message. A thread of its own reads them, because Ctrl-C does not interrupt the
/// reading.
fn lines() -> Receiver<()> {
    let (sender, receiver) = mpsc::channel();
    std::thread::spawn(move || {
        let mut line = String::new();
        while std::io::stdin().read_line(&mut line).is_ok_and(|count| count > 0) {
            line.clear();
            if sender.send(()).is_err() {
                break;
            }
        }
    });
    receiver
}

/// Runs a sequence in real time; each of the operator's lines confirms a prompt.
fn run(
    sequence: Sequence,
    machine: Box<dyn Machine>,
    model: &Description,
    person: &Arc<Person>,
    lines: Receiver<()>,
) -> Result<Sequence> {
    let confirms = Arc::clone(person);
    std::thread::spawn(move || lines.iter().for_each(|()| confirms.confirm()));
    let (period, core) = (model.numbers.control_period, Placement::default().control_core);
    let (sequence, lost) = task::run(sequence, machine, period, core, person, &mut tell)
        .map_err(|why| miette!("commissioning ended by a defect of this program: {why}"))?;
    lost.iter().for_each(|remark| output::note(remark));
    Ok(sequence)
}

/// Prints a step or a prompt.
fn tell(told: Told) {
    match told {
        Told::Step(step) => output::note(&format!("{}: {}", step.name(), step.text())),
        Told::Rest(signals) => output::note(&format!(
            "signals at rest: {}. Compare them with the gauges: a wrong scale or zero of a pressure is not detected",
            signals_text(&signals)
        )),
        Told::Prompt(prompt, code) => output::note(&format!(">>> {}", prompt.text(code))),
    }
}

/// Ctrl-C ends the sequence with an immediate stop.
fn attend(person: &Arc<Person>) -> Result<()> {
    let person = Arc::clone(person);
    ctrlc::set_handler(move || person.end()).into_diagnostic()
}

/// The same while a machine is waited for.
fn attend_both(person: &Arc<Person>, desk: &Arc<Desk>) -> Result<()> {
    let (person, desk) = (Arc::clone(person), Arc::clone(desk));
    ctrlc::set_handler(move || {
        person.end();
        desk.close();
    })
    .into_diagnostic()
}
