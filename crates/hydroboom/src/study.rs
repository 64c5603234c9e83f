//! `hydroboom study`

use crate::crane_file::{CraneFile, text};
use crate::paths::{InputFile, OutputFolder};
use crate::{eigen, energy, motion, output};
use clap::Args;
use hydroboom_description::Description;
use hydroboom_lab::{report, study};
use miette::{IntoDiagnostic, Result};
use std::time::Instant;

/// Run the paper's experiments, print "paper | here", write a report with figures.
#[derive(Args)]
#[command(after_help = "Example: hydroboom study --out study")]
pub struct Study {
    #[command(flatten)]
    crane: CraneFile,
    /// Crane file of a virtual crane that stands in for the real one; the embedded one where no
    /// --crane is given, else none.
    #[arg(long, value_name = "FILE")]
    virtual_crane: Option<InputFile>,
    /// Folder for report.html, and for its figures as SVG and CSV.
    #[arg(long, value_name = "DIR", default_value = "study")]
    out: OutputFolder,
    /// Write the time series of every motion, as CSV, into this folder.
    #[arg(long, value_name = "DIR")]
    log: Option<OutputFolder>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Study {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let clock = Instant::now();
        // the plant of the published experiments is the model: drive and sensors of the file are a machine's
        let description = self.crane.read()?.without_equipment();
        let said =
            |done: &str| output::note(&format!("{:5.1} s  {done}", clock.elapsed().as_secs_f64()));
        let stand_in = match &self.virtual_crane {
            Some(path) => Some(Description::parse(&path.display().to_string(), &text(path)?)?),
            None if self.crane.is_embedded() => Some(Description::uia_virtual()?),
            None => None,
        };
        let result = study::study(&description, stand_in.as_ref(), &said).into_diagnostic()?;
        let page = report::page(&description, &result).into_diagnostic()?;
        let path = output::page_in_folder(&self.out, "report", &page, None);
        if let Some(folder) = &self.log {
            output::folder(folder);
            for (plant, run) in &result.runs {
                motion::write_log(folder, plant, run);
            }
        }
        if self.json {
            return output::json(&serde_json::to_value(&result).into_diagnostic()?);
        }
        let three = |v: f64| format!("{v:.3}");
        let differences: Vec<Vec<String>> = result
            .differences
            .iter()
            .map(|d| {
                vec![
                    format!("{} [{}]", d.signal, d.unit),
                    three(d.paper_rms),
                    output::optional(d.virtual_rms, 3),
                    three(d.off_model_rms),
                    three(d.paper_peak),
                    output::optional(d.virtual_peak, 3),
                    three(d.off_model_peak),
                ]
            })
            .collect();
        let header =
            ["signal", "RMS paper", "virtual", "off-model", "peak paper", "virtual", "off-model"];
        let mut said = eigen::table(&result.eigenfrequency);
        if let Some(hz) = result.virtual_eigenfrequency_hz {
            let hz = hz.map(three).join(", ");
            said += &format!("\nvirtual crane, beside \"paper measured\": {hz}");
        }
        said += &format!(
            "\n\np_A oscillation, valve open [Hz]: paper simulated {:.3}, here {:.3}; paper measured {:.3}, \
             virtual crane {}",
            result.paper_pressure_oscillation_hz,
            result.pressure_oscillation_hz,
            result.paper_measured_pressure_oscillation_hz,
            output::optional(result.virtual_pressure_oscillation_hz, 3),
        );
        said += &format!(
            "\n\nTable 6: plant less published model, at the fast speed; the paper's plant is its real \
             crane\n{}",
            output::table(&header, &differences)
        );
        said += &format!("\n\n{}", motion::table(&result.motion));
        let pair = |[rms, peak]: [f64; 2]| format!("{rms:.3} / {peak:.3}");
        let damping: Vec<Vec<String>> = result
            .double_damping
            .iter()
            .map(|d| {
                vec![
                    d.plant.clone(),
                    d.course.clone(),
                    pair(d.benchmark_mm),
                    pair(d.damped_twice_mm),
                    pair(d.damped_once_mm),
                ]
            })
            .collect();
        let header = ["plant", "course", "benchmark", "as published", "on p - p_sim"];
        said += &format!(
            "\n\nSimulation feedforward in closed loop damps twice, RMS / peak [mm]; last: pressure feedback on \
             what differs from the simulation\n{}",
            output::table(&header, &damping)
        );
        output::text(&format!(
            "{said}\n\n{}\n{} ({:.1} s)",
            energy::table(&result.energy.audits),
            output::named("report", &path),
            clock.elapsed().as_secs_f64()
        ))
    }
}
