//! `hydroboom estimator`

use crate::crane_file::CraneFile;
use crate::interruptible::{Interruptible, of_requested};
use crate::machine_choice::MachineChoice;
use crate::output;
use crate::strategy_argument::strategies;
use clap::Args;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_lab::closed_loop::consistency_statistics::{COVERAGE, FEWEST_INSTANTS};
use hydroboom_lab::closed_loop::estimator_consistency::{
    Consistency, ErrorRow, InnovationRow, consistency,
};
use hydroboom_lab::closed_loop::scenario::{CourseChoice, scenarios};
use miette::{IntoDiagnostic, Result, bail};
use serde_json::json;

/// Name of the motion at the slow speed.
const SLOW: &str = "slow";
/// Name of the motion at the fast speed.
const FAST: &str = "fast";
/// Scenario of eight hours, which is run only if named.
const SHIFT: &str = "shift";

/// Test the consistency of the state estimator on virtual cranes: innovations and estimation errors against its
/// covariance.
#[derive(Args)]
#[command(after_help = "Examples:\n  hydroboom estimator --family 12 --seed 7\n  \
    hydroboom estimator --family 4 --course payload-change,load-in-motion --strategy benchmark-closed-loop\n  \
    hydroboom estimator --family 12 --set estimator.payload_drift_percent=2 --json")]
pub struct Estimator {
    #[command(flatten)]
    crane: CraneFile,
    /// Number of virtual cranes, drawn at random around the machine.
    #[arg(long, value_name = "COUNT", default_value_t = 12, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    family: u64,
    /// Seed of the family.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of the first crane.
    #[arg(long, value_name = "NUMBER", default_value_t = 0, value_parser = clap::value_parser!(u64).range(..=1_000_000_000))]
    from: u64,
    /// Courses: slow, fast (the motion at both speeds), or names from `hydroboom scenarios`. Default: all but shift.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    course: Vec<String>,
    /// Strategy that controls the cranes while the estimator runs.
    #[arg(long, value_parser = strategies(), default_value = Strategy::ScheduledLqr.name())]
    strategy: Strategy,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Estimator {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If an input is invalid, a crane cannot be built, or no crane had completed its courses at an interruption.
    pub fn run(self) -> Result<()> {
        let choice = MachineChoice::read(&self.crane, None)?;
        let (model, nominal) = (&choice.model, &choice.machine);
        let courses = self.courses(nominal);
        let cranes = self.from..self.from + self.family;
        // an unknown course is reported before the progress bar appears
        for course in &courses {
            course.of(nominal).into_diagnostic()?;
        }
        let work = Interruptible::new(self.family, "cranes")?;
        let go_on = |share: f64| work.done(share);
        let controller = self.strategy.into();
        let result = consistency(model, nominal, controller, &courses, (cranes, self.seed), &go_on);
        drop(work);
        let result = result.into_diagnostic()?;
        if result.cranes.is_empty() {
            bail!("interrupted before any of {} cranes had completed its courses", self.family);
        }
        if self.json {
            return output::json(&json!({
                "asked": self.family, "seed": self.seed, "from": self.from,
                "strategy": self.strategy.name(), "consistency": result, "plant": choice.json(),
            }));
        }
        let done = of_requested(result.cranes.len(), self.family as usize);
        output::text(&format!(
            "{done} virtual cranes around \"{}\", seed {}, first {}, under {}\n{}",
            choice.name(),
            self.seed,
            self.from,
            self.strategy.name(),
            text(&result)
        ))
    }

    /// Named courses; by default the motion at both speeds, and all scenarios but the shift.
    fn courses(&self, nominal: &Description) -> Vec<CourseChoice> {
        let n = &nominal.numbers;
        let of = |name: &str| match name {
            SLOW => CourseChoice::Motion(n.slow),
            FAST => CourseChoice::Motion(n.fast),
            other => CourseChoice::Scenario(other.into()),
        };
        if !self.course.is_empty() {
            return self.course.iter().map(|name| of(name)).collect();
        }
        let scenarios = scenarios(nominal);
        let names = scenarios.iter().map(|scenario| scenario.name).filter(|name| *name != SHIFT);
        [SLOW, FAST].into_iter().chain(names).map(of).collect()
    }
}

/// Tables of the innovations (NIS), and of the estimation errors (NEES) in all and by course.
fn text(result: &Consistency) -> String {
    let failed = match result.failed.is_empty() {
        true => String::new(),
        false => format!("\n\nnot finished, and not counted:\n  {}", result.failed.join("\n  ")),
    };
    let of = |is: &dyn Fn(&ErrorRow) -> bool| {
        let cells: Vec<_> = result.errors.iter().filter(|row| is(row)).map(error_cells).collect();
        let header = [
            "",
            "quantity",
            "unit",
            "instants",
            "mean NEES",
            "mean error",
            "RMS error",
            "mean sigma",
            "sigma/RMS",
            "in 2 sigma [%]",
            "",
        ];
        output::table(&header, &cells)
    };
    let cells: Vec<_> = result.innovations.iter().map(innovation_cells).collect();
    let header = [
        "course",
        "measured",
        "windows",
        "mean NIS",
        "0.5 to 2 [%]",
        "chi-square band [%]",
        "autocorrelation: median",
        "largest",
        "at [ms]",
        "",
    ];
    let longest =
        result.inconsistent.iter().max_by(|a, b| a.longest_s.total_cmp(&b.longest_s)).map(|t| {
            format!(
                "; mean NIS above estimator.nis_inconsistent for {:.2} s at most ({})",
                t.longest_s, t.course
            )
        });
    format!(
        "Innovations (NIS): windows of 1 s without a load change; expected: 90 % from 0.5 to 2. Autocorrelation of largest \
         magnitude at lags from 20 to 200 ms; 0 is expected{}\n{}\n\n\
         Errors (NEES): expected: 90 to 99 % within 2 sigma, sigma at most twice the RMS error; \
         no verdict below {FEWEST_INSTANTS} instants\n{}\n\n\
         The same by course, without the half second after a load change\n{}{failed}",
        longest.unwrap_or_default(),
        output::table(&header, &cells),
        of(&|row| row.course.is_none()),
        of(&|row| row.course.is_some()),
    )
}

/// Verdict on a row: empty if it is consistent.
fn verdict(is_consistent: Option<bool>) -> String {
    match is_consistent {
        Some(true) => "",
        Some(false) => "inconsistent",
        None => "too few",
    }
    .into()
}

/// Row of a measured quantity along a course.
fn innovation_cells(row: &InnovationRow) -> Vec<String> {
    let s = &row.summary;
    vec![
        row.course.clone().unwrap_or_else(|| "all".into()),
        row.measured.into(),
        s.windows.to_string(),
        format!("{:.2}", s.mean_nis),
        format!("{:.0}", s.within_percent),
        format!("{:.0}", s.within_chi_square_percent),
        format!("{:.2}", s.median_autocorrelation),
        format!("{:.2}", s.largest_autocorrelation),
        format!("{:.0}", row.largest_at_lag_ms),
        verdict(Some(row.is_consistent)),
    ]
}

/// Row of an estimated quantity, in all or along a course.
fn error_cells(row: &ErrorRow) -> Vec<String> {
    let s = &row.summary;
    let small = |value: f64| match value.abs() < 10.0 {
        true => format!("{value:.3}"),
        false => format!("{value:.1}"),
    };
    let of = row.course.clone().or_else(|| row.phase.map(String::from));
    vec![
        of.unwrap_or_else(|| "all but 0.5 s after a load change".into()),
        row.quantity.name().into(),
        row.unit.into(),
        s.instants.to_string(),
        match row.quantity.is_effect_of_parameter() {
            true => "-".into(),
            false => format!("{:.2}", s.mean_nees),
        },
        small(s.mean_error),
        small(s.rms_error),
        small(s.mean_deviation),
        format!("{:.2}", s.deviation_over_rms),
        format!("{:.0}", s.coverage_percent),
        match row.is_consistent {
            Some(false) if s.coverage_percent < *COVERAGE.start() => {
                "inconsistent: sigma too small"
            }
            Some(false) => "inconsistent: sigma too large",
            Some(true) => "",
            None => "too few",
        }
        .into(),
    ]
}
