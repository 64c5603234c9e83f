//! `hydroboom sensitivity`

mod analysis;
mod analysis_json;
mod analysis_text;
mod page;
mod scheduled_lqr;

use crate::crane_file::CraneFile;
use crate::number;
use crate::output;
use crate::paths::OutputFile;
use analysis::Analysis;
use clap::Args;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_identify::Free;
use hydroboom_sensitivity::{Case, Output, Study};
use miette::{IntoDiagnostic, Result, miette};

/// Rank a crane's parameters by their effect on tracking errors, pressures and the eigenfrequency, at both ends of each
/// parameter's range, by exact derivatives, and globally by Sobol indices.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom sensitivity\n  hydroboom sensitivity --outputs eigenfrequency,tracking-benchmark-closed-loop \
    --rows 256 --report sensitivity.html\n  hydroboom sensitivity --keys payload.mass_kg,pump.flow_gain --speed-mm-s 25\n  hydroboom sensitivity --strategy scheduled-lqr"
)]
pub struct Sensitivity {
    #[command(flatten)]
    crane: CraneFile,
    /// Outputs, with commas between them: eigenfrequency, tracking-STRATEGY, pressure-STRATEGY; all when not given.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    outputs: Vec<String>,
    /// Tracking error and p_A of these strategies, separated by commas, in place of --outputs. The scheduled LQR has no
    /// derivatives and indices.
    #[arg(long, value_name = "NAMES", value_delimiter = ',', conflicts_with = "outputs")]
    strategy: Vec<Strategy>,
    /// Keys to vary, separated by commas. Default: those that logs usually determine.
    #[arg(long, value_name = "KEYS", value_delimiter = ',')]
    keys: Vec<String>,
    /// Speed of the motion; the crane's fast one when not given: 0.1 to 10000 mm/s.
    #[arg(long, value_name = "SPEED", value_parser = number::within(number::SPEED, "mm/s"))]
    speed_mm_s: Option<f64>,
    /// Rows of the global study, each of as many runs as there are keys, and two more; 0 leaves it out.
    #[arg(long, value_name = "COUNT", default_value_t = 0)]
    rows: usize,
    /// Seed of the global study.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Report to write (HTML).
    #[arg(long, value_name = "FILE")]
    report: Option<OutputFile>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Sensitivity {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If an input is invalid, or an output of the described machine cannot be computed.
    pub fn run(self) -> Result<()> {
        let crane = self.crane.read()?;
        let speed = number::speed_of_motion(&crane, self.speed_mm_s)?;
        let (differentiated, rerun): (Vec<Output>, Vec<Output>) =
            self.selected_outputs()?.into_iter().partition(|output| output.has_slopes());
        let case = Case::new(&crane, speed, &differentiated).into_diagnostic()?;
        let free = self.free_keys(&crane)?;
        let mut analysis = Analysis::new(&crane, case, differentiated, &free)?;
        if !rerun.is_empty() {
            analysis.add_rerun_outputs(&crane, speed, &rerun)?;
        }
        if self.rows > 0 {
            analysis.add_indices(&free, Study { rows: self.rows, seed: self.seed })?;
        }
        if let Some(path) = &self.report {
            let seed = (self.rows > 0).then_some(self.seed);
            output::page(path, &page::page(&crane, &analysis).into_diagnostic()?, seed);
        }
        if self.json {
            return output::json(&analysis_json::analysis_in_json(&crane, &analysis));
        }
        let mut text = analysis_text::analysis_text(&analysis);
        if let Some(path) = &self.report {
            text += &format!("\nreport: {}", path.display());
        }
        output::text(&text)
    }

    /// Outputs by their names, otherwise those of the strategies, otherwise all.
    ///
    /// # Errors
    ///
    /// If there is no output of a name.
    fn selected_outputs(&self) -> Result<Vec<Output>> {
        if self.outputs.is_empty() {
            return Ok(match self.strategy.as_slice() {
                [] => Output::ALL.into_iter().chain(Output::OF_SCHEDULED_LQR).collect(),
                some => {
                    some.iter().flat_map(|s| [Output::Tracking(*s), Output::Pressure(*s)]).collect()
                }
            });
        }
        let named = self.outputs.iter().map(|name| {
            Output::from_name(name.trim()).ok_or_else(|| {
                let all = Output::ALL.into_iter().chain(Output::OF_SCHEDULED_LQR);
                let all: Vec<String> = all.map(Output::name).collect();
                miette!(help = format!("one of: {}", all.join(", ")), "no output \"{name}\"")
            })
        });
        named.collect()
    }

    /// Keys that vary.
    ///
    /// # Errors
    ///
    /// If a key is unknown, or zero.
    fn free_keys(&self, crane: &Description) -> Result<Vec<Free>> {
        let named: Vec<Free> = match self.keys.as_slice() {
            [] => Free::usual(crane),
            keys => keys
                .iter()
                .map(|path| Free::from_path(path.trim()).into_diagnostic())
                .collect::<Result<_>>()?,
        };
        match named.iter().find(|key| key.value(crane) <= 0.0) {
            Some(zero) => {
                Err(miette!("{} is zero: keys vary by shares of their value", zero.path()))
            }
            None => Ok(named),
        }
    }
}
