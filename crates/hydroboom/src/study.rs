//! `hydroboom study`

use crate::{crane_file::CraneFile, eigen, energy, motion, output};
use clap::Args;
use hydroboom_lab::{report, study};
use miette::{IntoDiagnostic, Result, WrapErr};
use std::path::PathBuf;
use std::time::Instant;

/// Run the paper's experiments, print "paper | here", write a report with figures.
#[derive(Args)]
#[command(after_help = "Example: hydroboom study --out study")]
pub struct Study {
    #[command(flatten)]
    crane: CraneFile,
    /// Folder for report.html.
    #[arg(long, value_name = "DIR", default_value = "study")]
    out: PathBuf,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Study {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let clock = Instant::now();
        let description = self.crane.read()?;
        let said = |done: &str| eprintln!("{:5.1} s  {done}", clock.elapsed().as_secs_f64());
        let result = study::study(&description, &said).into_diagnostic()?;
        let page = report::page(&description, &result).into_diagnostic()?;
        std::fs::create_dir_all(&self.out)
            .into_diagnostic()
            .wrap_err_with(|| format!("{} cannot be made", self.out.display()))?;
        let path = self.out.join("report.html");
        output::file(&path, page.as_bytes())?;
        if self.json {
            return output::json(&serde_json::to_value(&result).into_diagnostic()?);
        }
        let differences: Vec<Vec<String>> = result
            .differences
            .iter()
            .map(|d| {
                vec![
                    format!("{} [{}]", d.signal, d.unit),
                    format!("{:.3}", d.paper_rms),
                    format!("{:.3}", d.rms),
                    format!("{:.3}", d.paper_peak),
                    format!("{:.3}", d.peak),
                ]
            })
            .collect();
        let header = ["signal", "RMS paper", "RMS here", "peak paper", "peak here"];
        output::text(&format!(
            "{}\n\np_A oscillation, valve open [Hz]: paper {:.3}, here {:.3}\n\n\
             Table 6: paper: its simulation against the real crane; here: model against the \
             off-model plant\n{}\n\n{}\n\n{}\n\nreport: {} ({:.1} s)",
            eigen::table(&result.eigenfrequency),
            result.paper_pressure_oscillation_hz,
            result.pressure_oscillation_hz,
            output::table(&header, &differences),
            motion::table(&result.motion),
            energy::table(&result.energy.audits),
            path.display(),
            clock.elapsed().as_secs_f64()
        ))
    }
}
