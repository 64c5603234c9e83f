//! `hydroboom validate`

mod page;
mod segment;
mod segment_json;
mod segment_text;

use crate::crane_file::CraneFile;
use crate::log_mapping::{LogMapping, LogWindow, suspicions};
use crate::output;
use crate::paths::{InputFile, OutputFile};
use clap::Args;
use hydroboom_description::Description;
use hydroboom_identify::Experiment;
use hydroboom_measurement::{Signals, Suspicion};
use miette::{IntoDiagnostic, Result};
use segment::SegmentComparison;
use segment_json::segment_in_json;
use segment_text::segment_text;
use serde_json::{Value, json};

/// Drive the model by a log's motor speed and valve; report the differences of position and pressures, faulty signals,
/// and keys that would reduce the differences.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom validate --log lift.csv\n  hydroboom validate --crane my-crane.toml \
    --log lift.csv --mapping lift.toml --report lift.html\n  hydroboom log inspect lift.csv shows what a log has"
)]
pub struct Validate {
    #[command(flatten)]
    crane: CraneFile,
    /// The log: CSV, TwinCAT Scope, Simulink, MAT, MDF, MCAP.
    #[arg(long, value_name = "FILE")]
    log: InputFile,
    #[command(flatten)]
    mapping: LogMapping,
    #[command(flatten)]
    window: LogWindow,
    /// Report to write (HTML).
    #[arg(long, value_name = "FILE")]
    report: Option<OutputFile>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Validate {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If an input is invalid, the log lacks a signal, or the model cannot be simulated.
    pub fn run(self) -> Result<()> {
        let crane = self.crane.read_any()?;
        let (log, mapping) = self.mapping.read(&self.log, &crane)?;
        let suspicions = suspicions(&log, &mapping, &crane);
        let signals = Signals::of(&log, &mapping).into_diagnostic()?;
        let each = Experiment::each(&crane, &log, &signals, self.window.of()).into_diagnostic()?;
        let segments = each.into_iter().map(|segment| SegmentComparison::new(&crane, segment));
        let segments = segments.collect::<Result<Vec<_>>>()?;
        let mut notes = log.remarks.clone();
        notes.extend(segments.iter().flat_map(|segment| segment.experiment.remarks.clone()));
        notes.extend(suspicions.iter().map(|Suspicion { text, .. }| format!("suspicious: {text}")));
        if let Some(path) = &self.report {
            let page = page::page(&self.log, &crane, &segments, &notes);
            output::page(path, &page.into_diagnostic()?, None);
        }
        if self.json {
            return output::json(&self.in_json(&crane, &segments, &notes));
        }
        let mut text = String::new();
        for segment in &segments {
            text += &segment_text(segment, &crane.name);
            text += if segments.len() > 1 { "\n" } else { "" };
        }
        for note in &notes {
            text += &format!("\nnote: {note}");
        }
        if let Some(path) = &self.report {
            text += &output::named("report", path);
        }
        output::text(&text)
    }

    /// JSON. For a log of several segments: the signals of the longest one, then each segment.
    fn in_json(
        &self,
        crane: &Description,
        segments: &[SegmentComparison],
        notes: &[String],
    ) -> Value {
        let duration = |segment: &&SegmentComparison| segment.experiment.duration();
        let longest = segments.iter().max_by(|a, b| duration(a).total_cmp(&duration(b)));
        let mut value = longest.map_or_else(|| json!({}), segment_in_json);
        value["log"] = json!(self.log);
        value["crane"] = json!(crane.name);
        value["notes"] = json!(notes);
        if segments.len() > 1 {
            value["segments"] = segments.iter().map(segment_in_json).collect();
        }
        value
    }
}
