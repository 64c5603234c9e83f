//! `hydroboom learn`

use crate::crane_file::CraneFile;
use crate::interruptible::{Interruptible, of_asked};
use crate::machine_choice::MachineChoice;
use crate::output;
use crate::paths::InputFile;
use clap::Args;
use hydroboom_lab::LabError;
use hydroboom_lab::closed_loop::monte_carlo::{Percentiles, member};
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use hydroboom_lab::cycle_learning::experiment::{
    CycleReport, Method, MethodError, learning_experiment,
};
use miette::{IntoDiagnostic, Result, bail};
use serde_json::json;

/// Identify a virtual crane from one closed-loop cycle, and compare what feedforward and iterative learning control make of it.
///
/// The cycle runs under the scheduled LQR. Then the machine is commanded without feedback: by the model as described, with the estimates of the
/// state estimator, by the model identified from the cycle, and by the cycle's own commands, corrected by iterative learning control; from the rest
/// that the cycle began from, and without a reset, from the oil's state that the cycle has left.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom learn\n  hydroboom learn --family 20\n  hydroboom learn --member 134\n  \
    What is identified is printed as overrides: hydroboom motion --set payload.mass_kg=... takes it."
)]
pub struct Learn {
    #[command(flatten)]
    crane: CraneFile,
    /// Crane file of the plant; when not given, the virtual crane: that of the crane file (typical drive,
    /// valve, sensors and fieldbus stand in for what it leaves out), the paper's without --crane.
    #[arg(long, value_name = "FILE", conflicts_with = "family")]
    plant: Option<InputFile>,
    /// Number of virtual cranes of a Monte Carlo family, in its place.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u64).range(1..=10_000))]
    family: Option<u64>,
    /// One of them alone, by its number; can be repeated.
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u64).range(0..10_000), conflicts_with_all = ["plant", "family"])]
    member: Vec<u64>,
    /// Seed of the family.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Learn {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let choice = MachineChoice::read(&self.crane, self.plant.as_deref())?;
        let (model, nominal) = (&choice.model, &choice.machine);
        let members = self.family.map_or(self.member, |count| (0..count).collect());
        let one = |k: &u64| Ok((format!("crane {k}"), member(nominal, self.seed, *k)?.crane));
        let mut cranes: Vec<_> =
            members.iter().map(one).collect::<Result<_, LabError>>().into_diagnostic()?;
        if cranes.is_empty() {
            cranes.push((choice.name(), nominal.clone()));
        }
        let courses = [model.numbers.slow, model.numbers.fast].map(CourseChoice::Motion);
        let asked = cranes.len() * courses.len();
        let work = Interruptible::new(asked as u64, "cycles")?;
        let all =
            learning_experiment(model, &cranes, &courses, &|| work.one_more()).into_diagnostic()?;
        drop(work);
        if all.is_empty() {
            bail!("none of {asked} cycles had been run when it was interrupted");
        }
        if self.json {
            let stable = all.iter().all(|report| report.stable);
            return output::json(&json!({
                "asked": asked, "learned": all, "stable": stable, "plant": choice.json(),
            }));
        }
        let interrupted = match all.len() == asked {
            true => String::new(),
            false => format!("\n\n{} cycles", of_asked(all.len(), asked)),
        };
        let told = match all.len() > MOST_SHOWN {
            true => medians(&all),
            false => all.iter().map(of_one).collect::<Vec<_>>().join("\n\n"),
        };
        let equality = choice.equality().map_or(String::new(), |said| format!("\n\n{said}"));
        output::text(&format!("{told}{interrupted}{equality}"))
    }
}

/// Of more cycles the medians are shown.
const MOST_SHOWN: usize = 4;

/// Heads of what is told of each method.
const HEADS: [&str; 4] = ["method", "initial state", "RMS true [mm]", "RMS measured [mm]"];

fn named(of: &MethodError) -> [String; 2] {
    let name = match of.cycles {
        None => of.method.name().into(),
        Some(1) => format!("{}, 1 cycle", of.method.name()),
        Some(cycles) => format!("{}, {cycles} cycles", of.method.name()),
    };
    [name, if of.reset { "at rest" } else { "without reset" }.into()]
}

/// What a cycle tells of a machine.
fn of_one(report: &CycleReport) -> String {
    let rows = report.methods.iter().map(|of| {
        let [name, begins] = named(of);
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
    report.remarks.iter().for_each(|remark| said += &format!("\n{remark}"));
    let options: Vec<String> =
        report.identified.iter().map(|assignment| format!("--set {assignment}")).collect();
    let lines: Vec<String> = options.chunks(3).map(|three| three.join(" ")).collect();
    if !lines.is_empty() {
        said += &format!(
            "\n\nidentified, as overrides of the model for any command:\n  {}",
            lines.join(" \\\n  ")
        );
    }
    said
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
        let [truly, as_measured] = [truth, measured].map(|all| Percentiles::of(all).median);
        let [below, finished] = [below, finished].map(|n| format!("{n} of {}", all.len()));
        vec![name, begins, format!("{truly:.3}"), format!("{as_measured:.3}"), below, finished]
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
    let unstable = all.iter().filter(|report| !report.stable).count();
    let of = match unstable {
        0 => String::new(),
        count => format!("; {count} closed loops are unstable"),
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
