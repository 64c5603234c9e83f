//! `hydroboom motion`

use crate::crane_file::{CraneFile, text};
use crate::output;
use clap::Args;
use hydroboom_lab::motion_test::{Row, Strategy, run};
use hydroboom_lab::study::NOMINAL;
use miette::{IntoDiagnostic, Result};
use serde_json::json;
use std::path::PathBuf;

/// Tests 1 to 3: four strategies at both speeds, on a plant that may differ from the model.
#[derive(Args)]
#[command(after_help = "Example: hydroboom motion --plant-set payload.mass_kg=340")]
pub struct MotionTests {
    #[command(flatten)]
    crane: CraneFile,
    /// Crane file of the plant, or a file with a `[set]` table of overrides; the model when not given.
    #[arg(long, value_name = "FILE")]
    plant: Option<PathBuf>,
    /// Override a key of the plant only; can be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    plant_set: Vec<String>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl MotionTests {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let model = self.crane.read()?;
        let mut name = NOMINAL.to_string();
        let mut plant = model.clone();
        if let Some(path) = &self.plant {
            name = path.display().to_string();
            let content = text(path)?;
            plant = match content.contains("[set]") {
                true => model.overridden(&name, &content)?.0,
                false => hydroboom_description::Description::parse(&name, &content)?,
            };
        }
        for assignment in &self.plant_set {
            plant.set(assignment)?;
        }
        if !self.plant_set.is_empty() {
            name = "changed".into();
        }
        let changes: Vec<_> = model
            .entries()
            .zip(plant.entries())
            .filter(|((_, a, _), (_, b, _))| a != b)
            .map(|((key, a, _), (_, b, _))| (key.path(), a, b, key.unit))
            .collect();

        let mut rows = Vec::new();
        for strategy in Strategy::ALL {
            for speed in [model.numbers.slow, model.numbers.fast] {
                let done = run(&model, &plant, strategy, speed).into_diagnostic()?;
                rows.push(Row::of(&name, &done));
            }
        }
        if self.json {
            let changes: Vec<_> = changes
                .iter()
                .map(|(key, a, b, unit)| json!({"key": key, "model": a, "plant": b, "unit": unit}))
                .collect();
            return output::json(&json!({ "motion": rows, "plant_changes": changes }));
        }
        let mut said = String::new();
        for (key, a, b, unit) in &changes {
            said += &format!("{key}: model {a} {unit}, plant {b} {unit}\n");
        }
        output::text(&format!("{said}{}", table(&rows)))
    }
}

/// Tables 7 to 9, "paper | here".
pub fn table(rows: &[Row]) -> String {
    let cells: Vec<Vec<String>> = rows
        .iter()
        .map(|r| {
            vec![
                r.strategy.name().into(),
                r.plant.clone(),
                format!("{:.0}", r.speed_mm_s),
                output::optional(r.paper_rms_mm, 2),
                format!("{:.3}", r.rms_mm),
                output::optional(r.paper_peak_mm, 2),
                format!("{:.3}", r.peak_mm),
            ]
        })
        .collect();
    let header = ["strategy", "plant", "mm/s", "RMS paper", "RMS here", "peak paper", "peak here"];
    format!(
        "Tables 7 to 9: tracking error x - x_ref [mm]; the paper measured a real crane\n{}",
        output::table(&header, &cells)
    )
}
