//! `hydroboom bench`

use crate::{crane_file::CraneFile, output};
use clap::Args;
use hydroboom_description::Description;
use hydroboom_lab::{benchmark, study};
use miette::{IntoDiagnostic, Result};
use serde_json::json;
use std::time::Instant;

/// Measure the computing time of a simulation step on this machine.
#[derive(Args)]
#[command(after_help = "Example: hydroboom bench --json")]
pub struct Bench {
    #[command(flatten)]
    crane: CraneFile,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Bench {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If the crane file is invalid, or an experiment of the study fails.
    pub fn run(self) -> Result<()> {
        let description = self.crane.read()?;
        let timing = benchmark::timing(&description).into_diagnostic()?;
        let clock = Instant::now();
        study::study(&description, Some(&Description::uia_virtual()?), true, &|_| {})
            .into_diagnostic()?;
        let study_s = clock.elapsed().as_secs_f64();
        if self.json {
            return output::json(&json!({
                "step_ns": timing.step_ns,
                "lanes_step_ns": timing.lanes_step_ns,
                "instruction_set": timing.instruction_set,
                "study_s": study_s,
                "segments": timing.segments,
            }));
        }
        let rows: Vec<Vec<String>> = timing
            .segments
            .iter()
            .map(|s| vec![s.n.to_string(), format!("{:.0}", s.step_ns)])
            .collect();
        output::text(&format!(
            "one 50 us step of the published model, 3 segments: {:.1} ns\n\
             the same in lanes, per instance: {:.1} ns ({})\nstudy: {study_s:.2} s\n\n\
             implicit step\n{}",
            timing.step_ns,
            timing.lanes_step_ns,
            timing.instruction_set,
            output::table(&["segments", "ns"], &rows)
        ))
    }
}
