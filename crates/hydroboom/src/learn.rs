//! `hydroboom learn`

use crate::crane_file::CraneFile;
use crate::interruptible::{Interruptible, of_asked};
use crate::log_mapping::{LogMapping, LogWindow};
use crate::machine_choice::MachineChoice;
use crate::number;
use crate::output;
use crate::paths::{InputFile, OutputFolder};
use crate::verdict_text;
use clap::Args;
use hydroboom_control::command::AxisCommand;
use hydroboom_description::Description;
use hydroboom_lab::LabError;
use hydroboom_lab::closed_loop::monte_carlo::{Percentiles, member};
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use hydroboom_lab::cycle_learning::experiment::{
    CycleReport, Method, MethodError, learning_experiment,
};
use hydroboom_lab::cycle_learning::identified_payload::IdentifiedPayload;
use hydroboom_lab::cycle_learning::log_learning::{LoggedMachine, identify_log, learn_for};
use hydroboom_lab::motion_test::{REMARK_ON_MARK, UNSTABLE_MARK};
use hydroboom_measurement::Signals;
use miette::{IntoDiagnostic, Result, bail, miette};
use serde_json::json;
use std::path::Path;

/// Identify a crane from one closed-loop cycle or from a log, and compare feedforward and iterative learning control.
///
/// The cycle runs under the scheduled LQR. Then the machine is commanded without feedback, by feedforward from the
/// described model, from the estimates of the state estimator and from the identified model, and by the commands of
/// the cycle with corrections of iterative learning control. Each starts from the initial state of the cycle, and once
/// more without a reset, from the state of the oil at its end.
///
/// It takes minutes on two cores, with a short motion about half a minute. Ctrl-C ends it with the results so far, and
/// status 1.
///
/// With --log the machine is identified from the log, and the cycles run on the virtual crane of the identified model.
/// A log that no model near the crane file reproduces is refused. docs/reference/iterative-learning-control.md has
/// method, conditions and limits.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom learn\n  hydroboom learn --family 20\n  hydroboom learn --member 134\n  \
    hydroboom learn --log run.csv --out proposed\n  hydroboom learn --set learning.cycles=3 --set learning.knot_periods=3\n\n\
    What is identified is printed as overrides, if it may be used: hydroboom motion --set payload.mass_kg=... takes it.\n\
    Commands of --out: hydroboom virtual --input FILE applies them to the virtual crane, simulate --input to the model;\n\
    no command sends them to a machine."
)]
pub struct Learn {
    #[command(flatten)]
    crane: CraneFile,
    /// Crane file of the plant, or a file with a `[set]` table of overrides of the virtual crane. Default: the virtual
    /// crane of the crane file (typical drive, valve, sensors and fieldbus where the file has none), without --crane
    /// the paper's.
    #[arg(long, value_name = "FILE", conflicts_with = "family")]
    plant: Option<InputFile>,
    /// Number of virtual cranes of a Monte Carlo family, in place of one plant.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u64).range(1..=10_000))]
    family: Option<u64>,
    /// One crane of the family, by its number; can be repeated.
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u64).range(0..10_000), conflicts_with_all = ["plant", "family"])]
    member: Vec<u64>,
    /// Seed of the family.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Log to identify the machine from: of `run`, of `motion --log`, or of a machine.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["plant", "family", "member"])]
    log: Option<InputFile>,
    #[command(flatten)]
    mapping: LogMapping,
    #[command(flatten)]
    window: LogWindow,
    /// Folder for the proposed feedforward commands of the identified model: a CSV file for each speed, as input of
    /// `hydroboom simulate --input`.
    #[arg(long, value_name = "DIR", requires = "log")]
    out: Option<OutputFolder>,
    /// Speed of the crane's motion. Default: its slow and its fast speed.
    #[arg(long, value_parser = number::within(number::SPEED, "mm/s"))]
    speed_mm_s: Option<f64>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Learn {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        match self.log.clone() {
            Some(log) => self.run_log(&log),
            None => self.run_cycles(),
        }
    }

    fn run_cycles(self) -> Result<()> {
        let choice = MachineChoice::read_plant(&self.crane, self.plant.as_deref())?;
        let (model, nominal) = (&choice.model, &choice.machine);
        let members = self.family.map_or(self.member, |count| (0..count).collect());
        let one = |k: &u64| Ok((format!("crane {k}"), member(nominal, self.seed, *k)?.crane));
        let mut cranes: Vec<_> =
            members.iter().map(one).collect::<Result<_, LabError>>().into_diagnostic()?;
        if cranes.is_empty() {
            cranes.push((choice.name(), nominal.clone()));
        }
        let courses = courses(model, self.speed_mm_s)?;
        let asked = cranes.len() * courses.len();
        let work = Interruptible::new(asked as u64, "cycles")?;
        let all = learning_experiment(model, &cranes, &courses, &|share| work.done(share))
            .into_diagnostic()?;
        drop(work);
        if all.is_empty() {
            bail!("none of {asked} cycles had been run when it was interrupted");
        }
        if self.json {
            output::json(&json!({
                "asked": asked, "learned": all, "stable": stability(&all, asked), "plant": choice.json(),
            }))?;
            return ended(&all, asked);
        }
        let equality = choice.equality().map_or(String::new(), |said| format!("\n\n{said}"));
        output::text(&format!("{}{equality}", told(&all, asked)))?;
        ended(&all, asked)
    }

    fn run_log(self, path: &Path) -> Result<()> {
        let model = self.crane.read()?;
        let (log, mapping) = self.mapping.read(path, &model)?;
        let signals = Signals::of(&log, &mapping).into_diagnostic()?;
        for remark in &log.remarks {
            output::note(&format!("{}: {remark}", path.display()));
        }
        let courses = courses(&model, self.speed_mm_s)?;
        let work = Interruptible::new(100, "%")?;
        let go_on = |share: f64| work.done(share);
        let machine = match identify_log(&model, (&log, &signals), self.window.of(), &go_on) {
            Err(LabError::Stopped) => bail!("interrupted before the machine was identified"),
            found => found.into_diagnostic()?,
        };
        if !machine.refusals.is_empty() {
            drop(work);
            return self.refused(&machine);
        }
        let all = match learn_for(&model, &machine, &courses, &go_on) {
            Err(LabError::Stopped) => Vec::new(),
            found => found.into_diagnostic()?,
        };
        drop(work);
        let written: Vec<String> =
            all.iter().filter_map(|report| self.proposed(report, &model)).collect();
        if self.json {
            let (usable, unusable_because) = usability(&all);
            output::json(&json!({
                "asked": courses.len(), "log": path, "identified": machine.identified,
                "payload": machine.payload, "usable": usable, "unusable_because": unusable_because,
                "verdict": verdict_text::in_json(&machine.judged), "refused": [], "remarks": machine.remarks,
                "learned": all, "proposed": written,
            }))?;
            return ended(&all, courses.len());
        }
        let of_commands = match (&self.out, written.is_empty()) {
            (None, _) => String::new(),
            (Some(_), true) => "\n\nno commands are proposed".into(),
            (Some(_), false) => format!(
                "\n\ncommands without feedback for this machine from rest, within the crane's margins on its model: {}",
                written.join(", ")
            ),
        };
        output::text(&format!(
            "{}\n\n{}{of_commands}",
            of_log(&machine),
            told(&all, courses.len())
        ))?;
        ended(&all, courses.len())
    }

    /// Prints the identification from a log and the reasons why nothing is proposed.
    fn refused(&self, machine: &LoggedMachine) -> Result<()> {
        let why = machine.refusals.join("\n");
        match self.json {
            true => output::json(&json!({
                "identified": machine.identified, "payload": machine.payload,
                "usable": false, "unusable_because": why,
                "verdict": verdict_text::in_json(&machine.judged),
                "refused": machine.refusals, "remarks": machine.remarks, "learned": [], "proposed": [],
            }))?,
            false => output::text(&of_log(machine))?,
        }
        Err(miette!(
            help = "`hydroboom validate` shows log and model beside each other; --crane names the machine's crane file",
            "no correction is proposed:\n{why}"
        ))
    }

    /// Writes the proposed commands of a report; returns the file's name.
    fn proposed(&self, report: &CycleReport, model: &Description) -> Option<String> {
        let (folder, commands) = (self.out.as_ref()?, report.proposal.as_ref()?);
        let speed = report.course.split_whitespace().next().unwrap_or("course");
        output::folder(folder);
        let path = folder.join(format!("feedforward-{speed}-mm-s.csv"));
        let text = input_text(commands, model.numbers.control_period);
        output::file(&path, text.as_bytes()).then(|| path.display().to_string())
    }
}

/// The crane's motion at the requested speed \[mm/s\], or at both of its own.
fn courses(model: &Description, speed: Option<f64>) -> Result<Vec<CourseChoice>> {
    let n = &model.numbers;
    let speeds = match speed {
        None => vec![n.slow, n.fast],
        asked => vec![number::speed_of_motion(model, asked)?],
    };
    Ok(speeds.into_iter().map(CourseChoice::Motion).collect())
}

/// Commands as an input of `simulate`.
fn input_text(commands: &[AxisCommand<f64>], period: f64) -> String {
    let row = |(k, c): (usize, &AxisCommand<f64>)| {
        format!("{},{},{}\n", k as f64 * period, c.motor_speed * 60.0, c.holding_valve)
    };
    let rows: String = commands.iter().enumerate().map(row).collect();
    format!("time_s,motor_speed_rpm,valve\n{rows}")
}

/// Text on the identification from a log.
fn of_log(machine: &LoggedMachine) -> String {
    let mut said = verdict_text::sentence(&machine.judged);
    machine.remarks.iter().for_each(|remark| said += &format!("\n{remark}"));
    said
}

/// Reports, or their medians if there are many.
fn told(all: &[CycleReport], asked: usize) -> String {
    let told = match all.len() > MOST_SHOWN {
        true => medians(all),
        false => {
            let one = |(k, report): (usize, &CycleReport)| {
                // for one log the identified parameters are the same for every speed
                let again = all[k + 1..].iter().any(|next| next.identified == report.identified);
                let same: Vec<&CycleReport> =
                    all.iter().filter(|other| other.identified == report.identified).collect();
                let of = match same.len() == all.len() {
                    true => String::new(),
                    false => format!(" from the cycle at {}", report.course.trim()),
                };
                let identified = if again { String::new() } else { overrides(&same, &of) };
                format!("{}{identified}", of_one(report))
            };
            all.iter().enumerate().map(one).collect::<Vec<_>>().join("\n\n")
        }
    };
    let whole = all.iter().filter(|report| report.whole).count();
    match whole == asked {
        true => told,
        false => format!("{told}\n\n{} cycles", of_asked(whole, asked)),
    }
}

/// Error of an interrupted command, whose results so far are printed by then.
fn ended(all: &[CycleReport], asked: usize) -> Result<()> {
    let whole = all.iter().filter(|report| report.whole).count();
    match whole == asked {
        true => Ok(()),
        false => bail!("interrupted: {whole} of {asked} cycles are complete"),
    }
}

/// Whether the closed loops of all cycles are stable; none if none is known to be unstable, and some were not
/// judged.
fn stability(all: &[CycleReport], asked: usize) -> Option<bool> {
    let judged = |is: bool| all.iter().filter(|report| report.stable == Some(is)).count();
    match (judged(false), judged(true)) {
        (0, stable) => (stable == asked).then_some(true),
        _ => Some(false),
    }
}

/// Number of cycles above which medians are shown.
const MOST_SHOWN: usize = 4;

/// Heads of the table of methods.
const HEADS: [&str; 4] = ["method", "initial state", "RMS true [mm]", "RMS measured [mm]"];

fn named(of: &MethodError) -> [String; 2] {
    let name = match of.cycles {
        None => of.method.name().into(),
        Some(1) => format!("{}, 1 cycle", of.method.name()),
        Some(cycles) => format!("{}, {cycles} cycles", of.method.name()),
    };
    [name, if of.reset { "at rest" } else { "without reset" }.into()]
}

/// Text of one report.
fn of_one(report: &CycleReport) -> String {
    let rows = report.methods.iter().map(|of| {
        let [mut name, begins] = named(of);
        if of.method == Method::ClosedLoop && report.is_marked() {
            name += UNSTABLE_MARK;
        }
        match (&report.sustained_oscillation, of.method) {
            (Some(oscillation), Method::ClosedLoop) => {
                vec![name, begins, "unstable".into(), oscillation.to_string()]
            }
            _ => vec![
                name,
                begins,
                output::optional(of.rms_true_mm, 3),
                output::optional(of.rms_measured_mm, 3),
            ],
        }
    });
    let mut said = format!("{}, {}\n", report.crane, report.course.trim());
    said += &output::table(&HEADS, &rows.collect::<Vec<_>>());
    if let Some(convergence) = &report.convergence {
        said += &format!(
            "\n\nlearning from the same state: a cycle leaves at most {:.3} of the distance to where it settles on the identified model, {:.3} at {} (below 1 is needed)",
            convergence.model, convergence.worst, convergence.worst_case
        );
    }
    if report.is_marked() {
        said += &format!("\n{REMARK_ON_MARK}");
    }
    if report.stable.is_none() {
        said += "\nstability of the closed loop: not judged";
    }
    report.remarks.iter().for_each(|remark| said += &format!("\n{remark}"));
    if !report.whole {
        said += "\ninterrupted: what is not in the table was not run";
    }
    said
}

/// Identified parameters of cycles that have the same, as options if they may be used; `of` names their source.
fn overrides(same: &[&CycleReport], of: &str) -> String {
    let Some(first) = same.first().filter(|first| !first.identified.is_empty()) else {
        return String::new();
    };
    let payload = first.payload.as_ref().map_or(String::new(), payload_text);
    let refused = same.iter().find_map(|report| Some((report, report.unusable_because.as_ref()?)));
    if let Some((report, reason)) = refused {
        return format!(
            "\n\nidentified{of}, and not to be used as overrides: at {}, {reason} (\"identified\" in --json has the values){payload}",
            report.course.trim()
        );
    }
    let options: Vec<String> =
        first.identified.iter().map(|assignment| format!("--set {assignment}")).collect();
    let lines: Vec<String> = options.chunks(3).map(|three| three.join(" ")).collect();
    format!(
        "\n\nidentified{of}, as overrides of the model for any command:\n  {}{payload}",
        lines.join(" \\\n  ")
    )
}

/// Text on an identified payload.
fn payload_text(payload: &IdentifiedPayload) -> String {
    let interval = match payload.interval_95_kg {
        Some([low, high]) => format!(", 95 %: {low:.1} to {high:.1} kg"),
        None => String::new(),
    };
    format!(
        "\nthe payload of {:.1} kg{interval} is the load's moment at the model's lever, payload.x_mm = {:.0}: a load at another lever has another mass",
        payload.mass_kg, payload.lever_mm
    )
}

/// Whether what was identified may be used after all cycles of a log, and the first reason why not.
fn usability(all: &[CycleReport]) -> (bool, Option<String>) {
    let refused = all.iter().find_map(|report| report.unusable_because.clone());
    match all.is_empty() {
        true => (false, Some("no cycle was run with it".into())),
        false => (refused.is_none(), refused),
    }
}

/// Medians over many cycles.
fn medians(all: &[CycleReport]) -> String {
    let mut found: Vec<([String; 2], [Vec<f64>; 2])> = Vec::new();
    for of in all.iter().flat_map(|report| &report.methods) {
        let name = named(of);
        let place = found.iter().position(|(other, _)| *other == name).unwrap_or_else(|| {
            found.push((name, [Vec::new(), Vec::new()]));
            found.len() - 1
        });
        found[place].1[0].extend(of.rms_true_mm);
        found[place].1[1].extend(of.rms_measured_mm);
    }
    let rows = found.into_iter().map(|([name, begins], [truth, measured])| {
        let below = truth.iter().filter(|mm| **mm < 1.0).count();
        let finished = truth.len();
        let median = |all: Vec<f64>| Some(Percentiles::of(all).median).filter(|mm| mm.is_finite());
        let [truly, as_measured] = [truth, measured].map(|all| output::optional(median(all), 3));
        let [below, finished] = [below, finished].map(|n| format!("{n} of {}", all.len()));
        vec![name, begins, truly, as_measured, below, finished]
    });
    let [by, begins, ..] = HEADS;
    let heads = [
        by,
        begins,
        "median RMS true [mm]",
        "median RMS measured [mm]",
        "true below 1 mm",
        "finished",
    ];
    let table = output::table(&heads, &rows.collect::<Vec<_>>());
    let unstable = all.iter().filter(|report| report.is_marked()).count();
    let of = match unstable {
        0 => String::new(),
        count => format!(
            "; {count} closed loops are unstable, linearised, or were in sustained oscillation or not finished"
        ),
    };
    let remarks = all.iter().map(|report| report.remarks.len()).sum::<usize>();
    let more = match remarks {
        0 => String::new(),
        count => format!("; {count} remarks: \"remarks\" in --json"),
    };
    format!(
        "{} cycles{of}{more}\n{table}\n\nwhat is identified of each: \"identified\" in --json",
        all.len()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Report of a cycle whose closed loop alone was run.
    fn report(stable: Option<bool>) -> CycleReport {
        let closed_loop = MethodError {
            method: Method::ClosedLoop,
            cycles: None,
            reset: true,
            rms_true_mm: Some(0.5),
            rms_measured_mm: Some(0.6),
        };
        CycleReport {
            crane: "one".into(),
            course: "60 mm/s".into(),
            whole: stable.is_some(),
            stable,
            has_stable_loops: None,
            sustained_oscillation: None,
            methods: vec![closed_loop],
            convergence: None,
            identified: Vec::new(),
            payload: None,
            usable: false,
            unusable_because: Some("the machine was not identified".into()),
            proposal: None,
            remarks: Vec::new(),
        }
    }

    #[test]
    fn a_stability_that_was_not_judged_is_not_called_unstable() {
        let said = of_one(&report(None));
        assert!(said.contains("stability of the closed loop: not judged"), "{said}");
        assert!(!said.contains("unstable") && !said.contains("(!)"), "{said}");
        assert!(of_one(&report(Some(false))).contains("(!)"));
        assert!(!of_one(&report(Some(true))).contains("judged"));
        assert!(serde_json::to_value(report(None)).unwrap()["stable"].is_null());
        let [stable, unstable, open] = [Some(true), Some(false), None].map(report);
        assert_eq!(stability(&[stable.clone(), stable.clone()], 2), Some(true));
        assert_eq!(stability(std::slice::from_ref(&stable), 2), None);
        assert_eq!(stability(&[stable, open.clone()], 2), None);
        assert_eq!(stability(&[open, unstable], 3), Some(false));
    }

    #[test]
    fn an_interrupted_command_ends_with_an_error() {
        let [whole, part] = [Some(true), None].map(report);
        assert!(ended(std::slice::from_ref(&whole), 1).is_ok());
        let error = ended(&[whole, part], 3).unwrap_err().to_string();
        assert!(error.contains("interrupted: 1 of 3 cycles"), "{error}");
        assert!(ended(&[], 1).is_err());
    }

    /// Report of a cycle from which a payload was identified.
    fn identified(unusable_because: Option<&str>) -> CycleReport {
        CycleReport {
            identified: vec!["payload.mass_kg=307.5".into()],
            payload: Some(IdentifiedPayload {
                mass_kg: 307.5,
                lever_mm: 3600.0,
                interval_95_kg: Some([305.0, 310.0]),
            }),
            usable: unusable_because.is_none(),
            unusable_because: unusable_because.map(String::from),
            ..report(Some(true))
        }
    }

    #[test]
    fn only_usable_overrides_are_printed() {
        let (usable, unusable) = (identified(None), identified(Some("it errs more")));
        let said = told(std::slice::from_ref(&usable), 1);
        assert!(said.contains("--set payload.mass_kg=307.5"), "{said}");
        assert!(said.contains("307.5 kg, 95 %: 305.0 to 310.0 kg"), "{said}");
        assert!(said.contains("payload.x_mm = 3600"), "{said}");
        // one cycle with the same parameters is enough to refuse them
        for all in [vec![unusable.clone()], vec![usable.clone(), unusable.clone()]] {
            let said = told(&all, all.len());
            assert!(said.contains("not to be used") && said.contains("it errs more"), "{said}");
            assert!(!said.contains("--set"), "{said}");
            assert_eq!(usability(&all), (false, Some("it errs more".into())));
        }
        assert_eq!(usability(std::slice::from_ref(&usable)), (true, None));
        assert!(!usability(&[]).0);
        let json = serde_json::to_value(&unusable).unwrap();
        assert_eq!(
            (&json["usable"], &json["unusable_because"]),
            (&false.into(), &"it errs more".into())
        );
        assert_eq!(json["payload"]["interval_95_kg"][1], 310.0);
        assert_eq!(told(&[report(Some(true))], 1).matches("identified").count(), 0);
    }
}
