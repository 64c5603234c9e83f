//! `hydroboom learn`

mod assessment;
mod report_text;

use crate::crane_file::CraneFile;
use crate::interruptible::Interruptible;
use crate::log_mapping::{LogMapping, LogWindow};
use crate::machine_choice::MachineChoice;
use crate::number;
use crate::output;
use crate::paths::{InputFile, OutputFolder};
use crate::verdict_text;
use assessment::{check_completeness, stability, usability};
use clap::Args;
use hydroboom_control::command::AxisCommand;
use hydroboom_description::Description;
use hydroboom_lab::LabError;
use hydroboom_lab::closed_loop::monte_carlo::member;
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use hydroboom_lab::cycle_learning::experiment::{CycleReport, learning_experiment};
use hydroboom_lab::cycle_learning::log_learning::{LoggedMachine, identify_log, learn_for};
use hydroboom_measurement::Signals;
use miette::{IntoDiagnostic, Result, bail, miette};
use report_text::reports_text;
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
    ///
    /// # Errors
    ///
    /// If an input is invalid, a crane cannot be simulated, no model reproduces the log, or the command was
    /// interrupted.
    pub fn run(self) -> Result<()> {
        match self.log.clone() {
            Some(log) => self.run_log(&log),
            None => self.run_cycles(),
        }
    }

    /// Identifies virtual cranes from a closed-loop cycle of each, and learns on them.
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
        let requested = cranes.len() * courses.len();
        let work = Interruptible::new(requested as u64, "cycles")?;
        let reports = learning_experiment(model, &cranes, &courses, &|share| work.done(share))
            .into_diagnostic()?;
        drop(work);
        if reports.is_empty() {
            bail!("none of {requested} cycles had been run when it was interrupted");
        }
        if self.json {
            output::json(&json!({
                "asked": requested, "learned": reports, "stable": stability(&reports, requested),
                "plant": choice.json(),
            }))?;
        } else {
            let equality =
                choice.equality().map_or(String::new(), |equality| format!("\n\n{equality}"));
            output::text(&format!("{}{equality}", reports_text(&reports, requested)))?;
        }
        check_completeness(&reports, requested)
    }

    /// Identifies a machine from its log, and learns on the virtual crane of the identified model.
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
            identified => identified.into_diagnostic()?,
        };
        if !machine.refusals.is_empty() {
            drop(work);
            return self.refuse(&machine);
        }
        let reports = match learn_for(&model, &machine, &courses, &go_on) {
            Err(LabError::Stopped) => Vec::new(),
            reports => reports.into_diagnostic()?,
        };
        drop(work);
        let written: Vec<String> =
            reports.iter().filter_map(|report| self.write_commands(report, &model)).collect();
        let requested = courses.len();
        if self.json {
            let (usable, unusable_because) = usability(&reports);
            output::json(&json!({
                "asked": requested, "log": path, "identified": machine.identified,
                "payload": machine.payload, "usable": usable, "unusable_because": unusable_because,
                "verdict": verdict_text::in_json(&machine.judged), "refused": [], "remarks": machine.remarks,
                "learned": reports, "proposed": written,
            }))?;
        } else {
            output::text(&format!(
                "{}\n\n{}{}",
                identification_text(&machine),
                reports_text(&reports, requested),
                self.commands_text(&written)
            ))?;
        }
        check_completeness(&reports, requested)
    }

    /// Prints the identification from a log and the reasons why nothing is proposed.
    ///
    /// # Errors
    ///
    /// Always: the reasons.
    fn refuse(&self, machine: &LoggedMachine) -> Result<()> {
        let reasons = machine.refusals.join("\n");
        match self.json {
            true => output::json(&json!({
                "identified": machine.identified, "payload": machine.payload,
                "usable": false, "unusable_because": reasons,
                "verdict": verdict_text::in_json(&machine.judged),
                "refused": machine.refusals, "remarks": machine.remarks, "learned": [], "proposed": [],
            }))?,
            false => output::text(&identification_text(machine))?,
        }
        Err(miette!(
            help = "`hydroboom validate` shows log and model beside each other; --crane names the machine's crane file",
            "no correction is proposed:\n{reasons}"
        ))
    }

    /// Writes the proposed commands of a report as an input of `simulate`; returns the file's name, none without a
    /// folder, a proposal, or if the file could not be written.
    fn write_commands(&self, report: &CycleReport, model: &Description) -> Option<String> {
        let (folder, commands) = (self.out.as_ref()?, report.proposal.as_ref()?);
        let speed = report.course.split_whitespace().next().unwrap_or("course");
        output::folder(folder);
        let path = folder.join(format!("feedforward-{speed}-mm-s.csv"));
        let text = commands_csv(commands, model.numbers.control_period);
        output::file(&path, text.as_bytes()).then(|| path.display().to_string())
    }

    /// Text on the files of proposed commands; empty if none were asked for.
    fn commands_text(&self, written: &[String]) -> String {
        match (&self.out, written.is_empty()) {
            (None, _) => String::new(),
            (Some(_), true) => "\n\nno commands are proposed".into(),
            (Some(_), false) => format!(
                "\n\ncommands without feedback for this machine from rest, within the crane's margins on its model: {}",
                written.join(", ")
            ),
        }
    }
}

/// The crane's motion at the requested speed \[mm/s\], or at both of its own.
///
/// # Errors
///
/// If the motion is too short to reach the speed.
fn courses(model: &Description, speed: Option<f64>) -> Result<Vec<CourseChoice>> {
    let n = &model.numbers;
    let speeds = match speed {
        None => vec![n.slow, n.fast],
        requested => vec![number::speed_of_motion(model, requested)?],
    };
    Ok(speeds.into_iter().map(CourseChoice::Motion).collect())
}

/// Commands over time as CSV: time_s, motor_speed_rpm, valve. `period` is the control period \[s\].
fn commands_csv(commands: &[AxisCommand<f64>], period: f64) -> String {
    let row = |(k, c): (usize, &AxisCommand<f64>)| {
        format!("{},{},{}\n", k as f64 * period, c.motor_speed * 60.0, c.holding_valve)
    };
    let rows: String = commands.iter().enumerate().map(row).collect();
    format!("time_s,motor_speed_rpm,valve\n{rows}")
}

/// Text on the identification from a log: verdict and remarks.
fn identification_text(machine: &LoggedMachine) -> String {
    let mut text = verdict_text::sentence(&machine.judged);
    machine.remarks.iter().for_each(|remark| text += &format!("\n{remark}"));
    text
}

#[cfg(test)]
mod tests {
    use super::report_text::report_text;
    use super::*;
    use hydroboom_lab::cycle_learning::experiment::{Method, MethodError};
    use hydroboom_lab::cycle_learning::identified_payload::IdentifiedPayload;

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
        let text = report_text(&report(None));
        assert!(text.contains("stability of the closed loop: not judged"), "{text}");
        assert!(!text.contains("unstable") && !text.contains("(!)"), "{text}");
        assert!(report_text(&report(Some(false))).contains("(!)"));
        assert!(!report_text(&report(Some(true))).contains("judged"));
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
        assert!(check_completeness(std::slice::from_ref(&whole), 1).is_ok());
        let error = check_completeness(&[whole, part], 3).unwrap_err().to_string();
        assert!(error.contains("interrupted: 1 of 3 cycles"), "{error}");
        assert!(check_completeness(&[], 1).is_err());
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
        let text = reports_text(std::slice::from_ref(&usable), 1);
        assert!(text.contains("--set payload.mass_kg=307.5"), "{text}");
        assert!(text.contains("307.5 kg, 95 %: 305.0 to 310.0 kg"), "{text}");
        assert!(text.contains("payload.x_mm = 3600"), "{text}");
        // one cycle with the same parameters is enough to refuse them
        for all in [vec![unusable.clone()], vec![usable.clone(), unusable.clone()]] {
            let text = reports_text(&all, all.len());
            assert!(text.contains("not to be used") && text.contains("it errs more"), "{text}");
            assert!(!text.contains("--set"), "{text}");
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
        assert_eq!(reports_text(&[report(Some(true))], 1).matches("identified").count(), 0);
    }
}
