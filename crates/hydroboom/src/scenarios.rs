//! `hydroboom scenarios`

use crate::controller_model::controller_model;
use crate::crane_file::CraneFile;
use crate::output;
use crate::paths::InputFile;
use clap::Args;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_design::stability::{LoopStability, stability_of};
use hydroboom_lab::closed_loop::metrics::TrackingError;
use hydroboom_lab::closed_loop::scenario::{CourseChoice, Scenario, scenarios};
use hydroboom_lab::motion_test::UNSTABLE_MARK;
use hydroboom_lab::virtual_run::{Summary, strategies};
use indicatif::ProgressBar;
use miette::{IntoDiagnostic, Result};
use serde_json::json;

/// List the test scenarios, or run one of them under all strategies.
#[derive(Args)]
#[command(after_help = "Examples:\n  hydroboom scenarios\n  hydroboom scenarios reversal\n  \
    hydroboom virtual --scenario payload-change --log out.csv")]
pub struct Scenarios {
    #[command(flatten)]
    crane: CraneFile,
    /// Scenario to run on the virtual crane; the list when not given.
    name: Option<String>,
    /// Crane file of the controllers' model. Default: the file of --crane without --set, the paper's crane for its
    /// virtual crane.
    #[arg(long, value_name = "FILE")]
    model: Option<InputFile>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Scenarios {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If an input is invalid, there is no such scenario, or a simulation fails.
    pub fn run(self) -> Result<()> {
        let crane = self.crane.read_or(Description::uia_virtual)?;
        let Some(name) = &self.name else { return list(&crane, self.json) };
        let scenario = CourseChoice::Scenario(name.clone()).of(&crane).into_diagnostic()?;
        let model = controller_model(&self.crane, self.model.as_deref())?;
        let bar = ProgressBar::new(1000);
        let results = strategies(&model, &crane, scenario.as_ref(), |share| {
            bar.set_position((share * 1000.0) as u64);
        });
        bar.finish_and_clear();
        let results = results.into_diagnostic()?;
        let loops = stability_of(&Strategy::ALL, &model, &crane).into_diagnostic()?;
        if self.json {
            let rows: Vec<_> = results
                .iter()
                .map(
                    |(strategy, summary)| json!({ "strategy": strategy.name(), "result": summary }),
                )
                .collect();
            let stable = results.iter().all(|(_, s)| s.stable != Some(false))
                && loops.iter().all(|of| of.stable);
            return output::json(
                &json!({ "scenario": name, "results": rows, "stable": stable, "loops": loops }),
            );
        }
        let rows: Vec<Vec<String>> =
            results.iter().map(|(strategy, s)| row(*strategy, s, &loops)).collect();
        let remarks: String = results
            .iter()
            .filter_map(|(strategy, s)| Some((strategy, s.sustained_oscillation?)))
            .map(|(strategy, oscillation)| {
                format!(
                    "\n{}: UNSTABLE, in sustained oscillation of {oscillation}",
                    strategy.name()
                )
            })
            .chain(loops.iter().filter(|of| !of.stable).map(|of| format!("\n{of}")))
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
        output::text(&format!(
            "{name} on \"{}\"\n{}{remarks}",
            crane.name,
            output::table(&header, &rows)
        ))
    }
}

/// Row of a strategy, marked if unstable; without errors for a run in sustained oscillation.
fn row(strategy: Strategy, s: &Summary, loops: &[LoopStability]) -> Vec<String> {
    let has_unstable_loop = loops.iter().any(|of| !of.stable && of.is_of(strategy));
    let is_stable = s.stable != Some(false);
    let mark = if is_stable && !has_unstable_loop { "" } else { UNSTABLE_MARK };
    let mut row = vec![format!("{}{mark}", strategy.name())];
    row.extend(s.error.cells().map(|mm| match is_stable {
        true => format!("{mm:.3}"),
        false => "unstable".into(),
    }));
    row.extend([format!("{:.1}", s.torque_nm), format!("{:.1}", s.oil_c)]);
    row
}

/// Prints the scenarios of a crane.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_in_sustained_oscillation_is_marked_and_has_no_errors() {
        let error = TrackingError {
            rms_true_mm: 0.5,
            rms_measured_mm: 0.6,
            peak_true_mm: 1.5,
            peak_measured_mm: 1.6,
        };
        let of = |stable: bool| Summary {
            duration_s: 10.0,
            error,
            stable: Some(stable),
            sustained_oscillation: None,
            stroke_mm: 50.0,
            pressure_a_bar: 70.0,
            torque_nm: 12.0,
            oil_c: 40.0,
            estimates: None,
        };
        let cells = row(Strategy::BenchmarkClosedLoop, &of(true), &[]);
        assert_eq!(
            cells,
            ["benchmark-closed-loop", "0.500", "0.600", "1.500", "1.600", "12.0", "40.0"]
        );
        let cells = row(Strategy::BenchmarkClosedLoop, &of(false), &[]);
        assert_eq!(cells[0], "benchmark-closed-loop (!)");
        assert_eq!(cells[1..5], ["unstable"; 4]);
    }
}
