//! `hydroboom scenarios`

use crate::crane_file::{CraneFile, text};
use crate::output;
use crate::paths::InputFile;
use clap::Args;
use hydroboom_description::Description;
use hydroboom_lab::closed_loop::metrics::TrackingError;
use hydroboom_lab::closed_loop::scenario::{CourseChoice, Scenario, scenarios};
use hydroboom_lab::virtual_run::strategies;
use indicatif::ProgressBar;
use miette::{IntoDiagnostic, Result};
use serde_json::json;

/// List what cranes do all day, or run one of these scenarios under all strategies.
#[derive(Args)]
#[command(after_help = "Examples:\n  hydroboom scenarios\n  hydroboom scenarios reversal\n  \
    hydroboom virtual --scenario payload-change --log out.csv")]
pub struct Scenarios {
    #[command(flatten)]
    crane: CraneFile,
    /// Scenario to run on the virtual crane; the list when not given.
    name: Option<String>,
    /// Crane file of the model that the controllers know; the paper's crane when not given.
    #[arg(long, value_name = "FILE")]
    model: Option<InputFile>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Scenarios {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let crane = self.crane.read_or(Description::uia_virtual)?;
        let Some(name) = &self.name else { return list(&crane, self.json) };
        let scenario = CourseChoice::Scenario(name.clone()).of(&crane).into_diagnostic()?;
        let model = match &self.model {
            Some(path) => Description::parse(&path.display().to_string(), &text(path)?)?,
            None => Description::uia_single_boom()?,
        };
        let bar = ProgressBar::new(1000);
        let results = strategies(&model, &crane, scenario.as_ref(), |share| {
            bar.set_position((share * 1000.0) as u64);
        });
        bar.finish_and_clear();
        let results = results.into_diagnostic()?;
        if self.json {
            let rows: Vec<_> = results
                .iter()
                .map(
                    |(strategy, summary)| json!({ "strategy": strategy.name(), "result": summary }),
                )
                .collect();
            return output::json(&json!({ "scenario": name, "results": rows }));
        }
        let rows: Vec<Vec<String>> = results
            .iter()
            .map(|(strategy, s)| {
                vec![
                    strategy.name().into(),
                    format!("{:.3}", s.error.rms_true_mm),
                    format!("{:.3}", s.error.rms_measured_mm),
                    format!("{:.3}", s.error.peak_true_mm),
                    format!("{:.3}", s.error.peak_measured_mm),
                    format!("{:.1}", s.torque_nm),
                    format!("{:.1}", s.oil_c),
                ]
            })
            .collect();
        let [rms_true, rms_measured, peak_true, peak_measured] = TrackingError::HEADS;
        let header = [
            "strategy",
            rms_true,
            rms_measured,
            peak_true,
            peak_measured,
            "motor torque [N m]",
            "oil at the end [C]",
        ];
        output::text(&format!("{name} on \"{}\"\n{}", crane.name, output::table(&header, &rows)))
    }
}

fn list(crane: &Description, as_json: bool) -> Result<()> {
    let outlines: Vec<_> = scenarios(crane).iter().map(Scenario::outline).collect();
    if as_json {
        return output::json(&json!({ "scenarios": outlines }));
    }
    let rows: Vec<Vec<String>> = outlines
        .iter()
        .map(|o| {
            vec![
                o.name.into(),
                o.moves.to_string(),
                format!("{:.0}", o.duration_s),
                format!("{:.0}", o.speed_mm_s),
                o.meaning.into(),
            ]
        })
        .collect();
    let header = ["scenario", "moves", "duration [s]", "speed [mm/s]", "meaning"];
    output::text(&output::table(&header, &rows))
}
