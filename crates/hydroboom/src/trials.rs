//! `hydroboom trials`

use crate::crane_file::CraneFile;
use crate::machine_choice::MachineChoice;
use crate::paths::OutputFolder;
use crate::{benchmark_gains, output, renamed_option};
use clap::{Args, ValueEnum};
use hydroboom_control::strategy::Strategy;
use hydroboom_lab::baselines::Baseline;
use hydroboom_lab::closed_loop::controller_choice::ControllerChoice;
use hydroboom_lab::closed_loop::metrics::TrackingError;
use hydroboom_lab::closed_loop::robustness::{HEAVIEST, Outcome, robustness, run, shaping};
use hydroboom_lab::motion_test::REMARK_ON_MARK;
use hydroboom_lab::report;
use indicatif::ProgressBar;
use miette::{IntoDiagnostic, Result};
use serde_json::json;

/// Kind of trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum TrialKind {
    /// Robustness: delays, noise, friction, limits, load changes in motion.
    Robustness,
    /// Residual vibration of the tip with the published trapezoid, S-curves and input shaping.
    Shaping,
}

/// Run trials on the virtual crane of the crane file (without --crane the paper's): robustness of the controllers, or
/// residual vibration by reference profile.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom trials robustness --baselines --out trials\n  hydroboom trials shaping"
)]
pub struct Trials {
    /// Kind of trial.
    #[arg(value_enum, required_unless_present = "rivals")]
    what: Option<TrialKind>,
    #[command(flatten)]
    crane: CraneFile,
    /// Add baselines to the benchmark and the scheduled LQR: the benchmark with designed gains, without and with an
    /// input shaper, LQG, linear and nonlinear MPC (docs/reference/baselines.md).
    #[arg(long)]
    baselines: bool,
    /// Its name before.
    #[arg(long, hide = true)]
    rivals: bool,
    /// Use the benchmark gains of the crane file. By default, gains of `hydroboom design --benchmark` replace the
    /// placeholders of a new file, and the paper's gains on another crane for which they are not tuned.
    #[arg(long)]
    gains_as_given: bool,
    /// Folder for trials.html.
    #[arg(long, value_name = "DIR")]
    out: Option<OutputFolder>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Trials {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If an input is invalid, a baseline cannot be designed, or a crane cannot be built.
    pub fn run(self) -> Result<()> {
        renamed_option::refuse(self.rivals, "--rivals", "--baselines")?;
        let choice = MachineChoice::read(&self.crane, None)?;
        // from the empty hook to the heaviest payload of the trials
        let payloads = [0.0, HEAVIEST * choice.machine.numbers.payload];
        let (choice, gains) = match self.gains_as_given {
            true => (choice, None),
            false => benchmark_gains::for_comparison(choice, payloads)?,
        };
        gains.iter().for_each(|remark| output::warn(remark));
        let (model, crane) = (&choice.model, &choice.machine);
        let trials = match self.what {
            Some(TrialKind::Shaping) => shaping(model, crane),
            Some(TrialKind::Robustness) | None => robustness(model, crane),
        };
        let trials = trials.into_diagnostic()?;
        let mut controllers: Vec<ControllerChoice> =
            vec![Strategy::BenchmarkClosedLoop.into(), Strategy::ScheduledLqr.into()];
        if self.baselines {
            let baselines = Baseline::all(model).into_diagnostic()?;
            controllers.extend(baselines.map(ControllerChoice::Baseline));
        }
        let bar = ProgressBar::new((trials.len() * controllers.len()) as u64);
        let outcomes = run(model, &trials, &controllers, &|| bar.inc(1));
        bar.finish_and_clear();
        if let Some(folder) = &self.out {
            let page = report::trials_page(&choice.name(), choice.equality(), &outcomes);
            output::page_in_folder(folder, "trials", &page, None);
        }
        if self.json {
            return output::json(&json!({ "trials": outcomes, "plant": choice.json() }));
        }
        let rows: Vec<Vec<String>> = outcomes.iter().map(row).collect();
        let [rms_true, rms_measured, peak_true, peak_measured] = TrackingError::HEADS;
        let header = [
            "trial",
            "strategy",
            rms_true,
            rms_measured,
            peak_true,
            peak_measured,
            "motor peak [rpm]",
            "ripple at rest [rpm]",
            "tip deflection [mm]",
            "tip vibration at rest [mm]",
            "",
        ];
        let is_marked = outcomes.iter().any(Outcome::is_marked);
        let mark = if is_marked { format!("\n{REMARK_ON_MARK}") } else { String::new() };
        output::text(&format!(
            "on \"{}\"; the controllers know \"{}\" only\n{}{}{mark}",
            choice.name(),
            model.name,
            choice.equality().map_or(String::new(), |equality| format!("{equality}\n")),
            output::table(&header, &rows)
        ))
    }
}

/// Row of a controller in a trial; dashes for the errors of an unstable or unfinished run.
fn row(o: &Outcome) -> Vec<String> {
    let error = |mm: f64| output::optional(Some(mm).filter(|mm| o.stable && mm.is_finite()), 3);
    vec![
        o.trial.clone(),
        o.marked_name(),
        error(o.error.rms_true_mm),
        error(o.error.rms_measured_mm),
        error(o.error.peak_true_mm),
        error(o.error.peak_measured_mm),
        format!("{:.0}", o.effort.motor_speed_rpm),
        format!("{:.1}", o.effort.motor_ripple_rpm),
        format!("{:.1}", o.effort.tip_deflection_mm),
        format!("{:.3}", o.effort.residual_vibration_mm),
        o.verdict(),
    ]
}
