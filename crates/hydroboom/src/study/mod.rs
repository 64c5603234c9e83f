//! `hydroboom study`

mod study_text;

use crate::crane_file::{CraneFile, text};
use crate::machine_choice::MachineChoice;
use crate::motion::run_log::write_run_log;
use crate::paths::{InputFile, OutputFolder};
use crate::{benchmark_gains, output};
use clap::Args;
use hydroboom_description::Description;
use hydroboom_lab::{report, study};
use miette::{IntoDiagnostic, Result};
use std::time::Instant;
use study_text::study_text;

/// Run the paper's experiments, print "paper | here", write a report with figures.
#[derive(Args)]
#[command(after_help = "Example: hydroboom study --out study")]
pub struct Study {
    #[command(flatten)]
    crane: CraneFile,
    /// Crane file of a virtual crane as a further plant. Default: the embedded one for the paper's crane, otherwise
    /// none.
    #[arg(long, value_name = "FILE", visible_alias = "virtual-crane")]
    plant: Option<InputFile>,
    /// Use the benchmark gains of the crane file. By default, gains of `hydroboom design --benchmark` replace the
    /// placeholders of a new file, and the paper's gains on another crane for which they are not tuned.
    #[arg(long)]
    gains_as_given: bool,
    /// Folder for report.html, and for its figures as SVG and CSV.
    #[arg(long, value_name = "DIR", default_value = "study")]
    out: OutputFolder,
    /// Folder for the time series of every motion, as CSV.
    #[arg(long, value_name = "DIR")]
    log: Option<OutputFolder>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Study {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If a crane file is invalid, or an experiment fails.
    pub fn run(self) -> Result<()> {
        let clock = Instant::now();
        // the plant of the published experiments is the model: drive and sensors of the file belong to a
        // machine
        let mut description = self.crane.read()?.without_equipment();
        let is_papers_crane = self.crane.is_papers_crane()?;
        let virtual_crane = self.virtual_crane(is_papers_crane)?;
        let mut gains = None;
        if !self.gains_as_given {
            let payload = [description.numbers.payload; 2];
            let choice = MachineChoice::model_itself(&description);
            let (choice, remark) = benchmark_gains::for_comparison(choice, payload)?;
            (description, gains) = (choice.model, remark);
        }
        let progress =
            |done: &str| output::note(&format!("{:5.1} s  {done}", clock.elapsed().as_secs_f64()));
        let result = study::study(&description, virtual_crane.as_ref(), is_papers_crane, &progress);
        let mut result = result.into_diagnostic()?;
        result.remark_on_gains = gains;
        let page = report::page(&description, &result).into_diagnostic()?;
        let path = output::page_in_folder(&self.out, "report", &page, None);
        if let Some(folder) = &self.log {
            output::folder(folder);
            for (plant, run) in &result.runs {
                write_run_log(folder, plant, run);
            }
        }
        if self.json {
            return output::json(&serde_json::to_value(&result).into_diagnostic()?);
        }
        output::text(&format!(
            "{}\n{} ({:.1} s)",
            study_text(&result),
            output::named("report", &path),
            clock.elapsed().as_secs_f64()
        ))
    }

    /// Virtual crane that stands in for the real one: of a file, otherwise the embedded one for the paper's crane, with
    /// a note on what overrides change.
    ///
    /// # Errors
    ///
    /// If its file cannot be read.
    fn virtual_crane(&self, is_papers_crane: bool) -> Result<Option<Description>> {
        let virtual_crane = match &self.plant {
            Some(path) => Some(Description::parse(&path.display().to_string(), &text(path)?)?),
            None if self.crane.is_embedded() && is_papers_crane => {
                Some(Description::uia_virtual()?)
            }
            None => None,
        };
        if self.crane.is_embedded() && !is_papers_crane && virtual_crane.is_none() {
            output::note(
                "with these values it is another crane than the paper's: the paper's figures, and the virtual crane that stands in for its crane, are left out",
            );
        } else if self.crane.is_overridden() && virtual_crane.is_some() {
            output::note(
                "--set is of the model, the nominal and the off-model plant: the virtual crane keeps the values of its own file",
            );
        }
        Ok(virtual_crane)
    }
}
