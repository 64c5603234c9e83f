//! `hydroboom learn`

use crate::crane_file::CraneFile;
use crate::interruptible::{Interruptible, of_asked};
use crate::machine_choice::MachineChoice;
use crate::output;
use crate::paths::InputFile;
use clap::Args;
use hydroboom_description::{Description, RangeSource};
use hydroboom_lab::LabError;
use hydroboom_lab::closed_loop::monte_carlo::{Percentiles, member};
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use hydroboom_lab::learning::{Rms, Taught, taught};
use miette::{IntoDiagnostic, Result, bail};
use serde_json::json;

/// What one cycle under the scheduled LQR tells of a virtual crane, and what open loop is worth with it: the plant is commanded what a model was commanded in a
/// rehearsal under the scheduled LQR, and not looked at. From the rest that the cycle began from, by the model as described, and by a model fitted to the
/// whole cycle in hindsight; the cycle's own commands amended by its errors; and, straight on from where the cycle ended, the rehearsal, and the very commands of
/// the cycle, which tell what a perfect model would come to that does not know in what state the cycle left the oil.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom learn\n  hydroboom learn --family 20\n  hydroboom learn --member 134\n  \
    What is known in hindsight is printed as overrides: hydroboom motion --set payload.mass_kg=... keeps it."
)]
pub struct Learn {
    #[command(flatten)]
    crane: CraneFile,
    /// Crane file of the plant; when not given, the virtual crane: that of the crane file (typical drive,
    /// valve, sensors and fieldbus stand in for what it leaves out), the paper's without --crane.
    #[arg(long, value_name = "FILE", conflicts_with = "family")]
    plant: Option<InputFile>,
    /// So many virtual cranes in its place.
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
        let all = taught(model, &cranes, &courses, &|| work.one_more()).into_diagnostic()?;
        drop(work);
        if all.is_empty() {
            bail!("none of {asked} cycles had been run when it was interrupted");
        }
        if self.json {
            return output::json(&json!({
                "asked": asked, "learned": all, "stable": all.iter().all(|t| t.stable), "plant": choice.json(),
            }));
        }
        let rows: Vec<Vec<String>> = all.iter().flat_map(rows).collect();
        let header = ["crane", "course", "how it was led", "RMS true [mm]", "RMS measured [mm]"];
        output::text(&format!(
            "{}{}{}{}",
            output::table(&header, &rows),
            summed_up(&all, asked),
            known_in_hindsight(&all, model),
            choice.equality().map_or(String::new(), |equality| format!("\n\n{equality}"))
        ))
    }
}

/// A way in which a machine was led: its name, and what came of it.
type Way = (&'static str, fn(&Taught) -> Option<Rms>);

/// Each way in which a course was run.
const WAYS: [Way; 6] = [
    ("closed loop", |t| t.closed_loop),
    ("open loop, model as described", |t| t.before),
    ("open loop, model in hindsight", |t| t.in_hindsight),
    ("the cycle's commands amended", |t| t.amended),
    ("straight on, model in hindsight", |t| t.straight_on),
    ("straight on, the cycle's commands", |t| t.told_again),
];

/// A row for each way.
fn rows(t: &Taught) -> Vec<Vec<String>> {
    let row = |(k, (name, of)): (usize, &Way)| {
        let errors = match t.sustained_oscillation.filter(|_| k == 0) {
            Some(oscillation) => [format!("unstable: {oscillation}"), "unstable".into()],
            None => {
                let rms = of(t);
                [rms.map(|rms| rms.rms_true_mm), rms.map(|rms| rms.rms_measured_mm)]
                    .map(|mm| output::optional(mm, 2))
            }
        };
        [vec![t.crane.clone(), t.course.clone(), name.to_string()], errors.to_vec()].concat()
    };
    WAYS.iter().enumerate().map(row).collect()
}

/// The overrides of each cycle, in lines that a shell takes; of many cycles where they are to be had.
fn known_in_hindsight(all: &[Taught], model: &Description) -> String {
    if all.len() > 4 {
        return "\n\nwhat is known of each in hindsight: set_in_hindsight in --json".into();
    }
    let of_one = |t: &Taught| {
        let options: Vec<String> = t
            .set_in_hindsight
            .iter()
            .map(|key_and_value| format!("--set {key_and_value}"))
            .collect();
        let lines: Vec<String> = options.chunks(3).map(|three| three.join(" ")).collect();
        let mut said = format!(
            "\n\nof {} at {} known in hindsight, as overrides of the model for any command:\n  {}",
            t.crane,
            t.course.trim(),
            lines.join(" \\\n  ")
        );
        let beyond = beyond_range(model, &t.set_in_hindsight);
        if !beyond.is_empty() {
            said += &format!(
                "\noutside the crane file's range, to be widened there first: {}",
                beyond.join(", ")
            );
        }
        said
    };
    all.iter().map(of_one).collect()
}

/// Keys whose override is outside the crane file's range.
fn beyond_range<'a>(model: &Description, set: &'a [String]) -> Vec<&'a str> {
    let is_beyond = |path: &str, text: &str| {
        let known = model.own_ranges().find(|(key, ..)| key.path() == path);
        let value: Option<f64> = text.parse().ok();
        known.zip(value).is_some_and(|((_, [low, high], from), value)| {
            from == RangeSource::File && !(low..=high).contains(&value)
        })
    };
    let pairs = set.iter().filter_map(|assignment| assignment.split_once('='));
    pairs.filter(|(path, text)| is_beyond(path, text)).map(|(path, _)| path).collect()
}

/// What a family comes to.
fn summed_up(all: &[Taught], asked: usize) -> String {
    if all.len() < 8 {
        return match all.len() == asked {
            true => String::new(),
            false => format!("\n\n{} cycles", of_asked(all.len(), asked)),
        };
    }
    let sum = |of: fn(&Taught) -> Option<Rms>| {
        let of_each =
            |error: fn(Rms) -> f64| all.iter().filter_map(of).map(error).collect::<Vec<f64>>();
        let [truth, measured] =
            [of_each(|rms| rms.rms_true_mm), of_each(|rms| rms.rms_measured_mm)];
        let below = truth.iter().filter(|mm| **mm < 1.0).count();
        let [truth, measured] = [truth, measured].map(|all| Percentiles::of(all).median);
        format!("RMS true {truth:.2} mm (below 1 mm on {below}), measured {measured:.2} mm")
    };
    let ways = WAYS[1..].iter().map(|(name, of)| format!("\n  {name}: {}", sum(*of)));
    format!("\n\nin the median of {}:{}", of_asked(all.len(), asked), ways.collect::<String>())
}
