//! `hydroboom ablate`

use crate::crane_file::CraneFile;
use crate::interruptible::{Interruptible, of_requested};
use crate::machine_choice::MachineChoice;
use crate::output;
use clap::Args;
use hydroboom_lab::closed_loop::ablation::{MECHANISMS, ablation};
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use miette::{IntoDiagnostic, Result};
use serde_json::json;

/// Switch the mechanisms of the scheduled LQR off, one at a time, on virtual cranes of a family.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom ablate\n  hydroboom ablate --family 24 --seed 9 --scenario payload-change\n\nThe ratio is the true RMS error without the mechanism over that with all, on the same crane. Above 1 the mechanism reduces the error, below 1 it increases it."
)]
pub struct Ablate {
    #[command(flatten)]
    crane: CraneFile,
    /// Cranes of the family.
    #[arg(long, value_name = "COUNT", default_value_t = 8, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    family: u64,
    /// Seed of the family.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Run this scenario; can be repeated. When not given: the motion at both speeds, payload-change and load-in-motion.
    #[arg(long, value_name = "NAME")]
    scenario: Vec<String>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Ablate {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If an input is invalid, or a crane of the family cannot be built.
    pub fn run(self) -> Result<()> {
        let choice = MachineChoice::read(&self.crane, None)?;
        let (model, nominal) = (&choice.model, &choice.machine);
        let named = |name: &str| CourseChoice::Scenario(name.into());
        let courses: Vec<CourseChoice> = match self.scenario.is_empty() {
            true => [model.numbers.slow, model.numbers.fast]
                .map(CourseChoice::Motion)
                .into_iter()
                .chain(["payload-change", "load-in-motion"].map(named))
                .collect(),
            false => self.scenario.iter().map(|name| named(name)).collect(),
        };
        for course in &courses {
            course.of(nominal).into_diagnostic()?;
        }
        let work = Interruptible::new(100, "percent")?;
        let go_on = |share: f64| work.done(share);
        let rows = ablation(model, nominal, &courses, self.family, self.seed, &go_on);
        drop(work);
        let rows = rows.into_diagnostic()?;
        if self.json {
            return output::json(&json!({
                "ablation": rows, "cranes": self.family, "seed": self.seed,
                "plant": choice.json(),
            }));
        }
        let done = rows.len() / courses.len().max(1);
        let cells: Vec<Vec<String>> = rows
            .iter()
            .map(|row| {
                vec![
                    row.mechanism.into(),
                    row.course.clone(),
                    format!("{:.2}", row.mean_ratio),
                    format!("{:.2}", row.largest_ratio),
                    row.oscillating.to_string(),
                    row.overrides.join(" "),
                ]
            })
            .collect();
        let header = ["without", "course", "mean ratio", "largest", "oscillating", "by"];
        output::text(&format!(
            "{} mechanisms on {} virtual cranes around \"{}\", seed {}\n{}",
            of_requested(done, MECHANISMS.len()),
            self.family,
            choice.name(),
            self.seed,
            output::table(&header, &cells)
        ))
    }
}
