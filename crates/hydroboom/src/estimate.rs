//! `hydroboom estimate`

use crate::crane_file::CraneFile;
use crate::log_mapping::{LogMapping, LogWindow, suspicions};
use crate::output;
use crate::paths::{InputFile, OutputFile};
use clap::Args;
use hydroboom_files::FileError;
use hydroboom_lab::log::Log;
use hydroboom_lab::log_estimation::{ESTIMATES, INNOVATIONS, LogEstimate, estimate};
use hydroboom_lab::log_estimation::{readable, unit};
use hydroboom_lab::report::estimation_page;
use hydroboom_measurement::{Signal, Signals};
use miette::{IntoDiagnostic, Result, bail};
use serde_json::{Map, Value, json};
use std::path::Path;

/// Estimate states and parameters along a recorded log, with bounds; judge consistency, name faulty signals and
/// unobservable quantities.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom estimate --log lift.csv --out lift.html\n  hydroboom estimate --crane my-crane.toml --log lift.mcap \
    --csv estimates.csv --json\n  hydroboom log inspect lift.csv shows what a log has"
)]
pub struct Estimate {
    #[command(flatten)]
    crane: CraneFile,
    /// The log: CSV, TwinCAT Scope, Simulink, MAT, MDF, MCAP.
    #[arg(long, value_name = "FILE")]
    log: InputFile,
    #[command(flatten)]
    mapping: LogMapping,
    #[command(flatten)]
    window: LogWindow,
    /// Page with figures to write (HTML).
    #[arg(long, value_name = "FILE")]
    out: Option<OutputFile>,
    /// Estimates over time to write: CSV, or MAT where the name ends so.
    #[arg(long, value_name = "FILE")]
    csv: Option<OutputFile>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Estimate {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If an input is invalid, the log lacks the piston position, or a needed signal is unusable.
    pub fn run(self) -> Result<()> {
        let crane = self.crane.read_any()?;
        let (log, mapping) = self.mapping.read(&self.log, &crane)?;
        let signals = Signals::of(&log, &mapping).into_diagnostic()?;
        let needed = [Signal::Stroke, Signal::PressureA, Signal::PressureB, Signal::MotorSpeed];
        let suspicions = suspicions(&log, &mapping, &crane);
        let wrong: Vec<_> =
            suspicions.iter().filter(|s| s.is_unusable && needed.contains(&s.signal)).collect();
        if let Some(first) = wrong.first() {
            let all = wrong.iter().map(|s| s.text.as_str()).collect::<Vec<_>>().join("; ");
            bail!(
                help = format!(
                    "hydroboom log inspect {} --mapping-out FILE, then [log.{}] in it",
                    self.log.display(),
                    first.signal.key()
                ),
                "{}: nothing can be estimated from it: {all}",
                self.log.display()
            );
        }
        signals.need(Signal::Stroke, &log).into_diagnostic()?;
        let window = self.window.of();
        let estimate = estimate(&crane, &signals, (window.from, window.to)).into_diagnostic()?;
        let mut notes = log.remarks.clone();
        notes.extend(suspicions.iter().map(|s| format!("suspicious: {}", s.text)));
        let name = self.log.display().to_string();
        if let Some(path) = &self.out {
            let page = estimation_page(&name, &crane.name, &estimate, &notes).into_diagnostic()?;
            output::page(path, &page, None);
        }
        if let Some(path) = &self.csv {
            output::written(path, write(path, &estimate));
        }
        if self.json {
            return output::json(&in_json(&name, &crane.name, &estimate, &notes));
        }
        output::text(&self.text(&crane.name, &estimate, &notes))
    }

    /// Verdict, estimates at the end with their bounds, statistics of the innovations, and notes.
    fn text(&self, crane: &str, estimate: &LogEstimate, notes: &[String]) -> String {
        let verdict = &estimate.verdict;
        let mut text = format!(
            "{}: {:.1} s beside \"{crane}\"\nverdict: {}",
            self.log.display(),
            estimate.duration,
            verdict.sentence()
        );
        for finding in &verdict.findings {
            text += &format!("\nfinding: {}", finding.text);
        }
        let two = |value: f64| format!("{value:.2}");
        if let Some(last) = estimate.last_released() {
            let rows: Vec<Vec<String>> = ESTIMATES
                .iter()
                .enumerate()
                .filter(|(k, _)| last.estimate[*k].is_finite())
                .map(|(k, (name, _))| {
                    vec![
                        format!("{} [{}]", readable(name), unit(name)),
                        two(last.estimate[k]),
                        two(2.0 * last.deviation[k]),
                        two(2.0 * estimate.initial_deviation[k]),
                    ]
                })
                .collect();
            let heading = estimate.last_heading();
            let header = [heading.as_str(), "estimate", "bound (2 sigma)", "at the start"];
            text += &format!("\n{}", output::table(&header, &rows));
        }
        let rows: Vec<Vec<String>> =
            [("position", &verdict.position), ("load pressure", &verdict.load_pressure)]
                .map(|(name, s)| {
                    vec![
                        name.into(),
                        s.windows.to_string(),
                        two(s.mean_nis),
                        format!("{:.0}", s.consistent_percent),
                        two(s.mean_over_sigma),
                    ]
                })
                .to_vec();
        let header = ["innovations", "seconds", "mean NIS", "consistent [%]", "mean [sigma]"];
        text += &format!("\n\n{}\n", output::table(&header, &rows));
        for quantity in &verdict.unobservable {
            text += &format!("\nunobservable: {quantity}");
        }
        for note in notes.iter().chain(&estimate.remarks) {
            text += &format!("\nnote: {note}");
        }
        for path in self.out.iter().chain(&self.csv) {
            text += &output::named("written", path);
        }
        text
    }
}

/// Names of the columns over time.
fn columns() -> Vec<String> {
    let of = |prefix: &str, names: &mut dyn Iterator<Item = &str>| -> Vec<String> {
        names.map(|name| format!("{prefix}{name}")).collect()
    };
    let mut header = vec!["time_s".to_string(), "held".into()];
    header.extend(of("estimated_", &mut ESTIMATES.iter().map(|(name, _)| *name)));
    header.extend(of("deviation_", &mut ESTIMATES.iter().map(|(name, _)| *name)));
    header.extend(of("innovation_", &mut INNOVATIONS.iter().map(|(name, _)| *name)));
    header.extend(of("innovation_deviation_", &mut INNOVATIONS.iter().map(|(name, _)| *name)));
    header.push("mean_nis".into());
    header
}

/// Writes the estimates over time.
fn write(path: &Path, estimate: &LogEstimate) -> Result<(), FileError> {
    let mut log = Log::begin(path, &columns());
    for row in &estimate.rows {
        let mut values = vec![row.time, f64::from(u8::from(row.is_held))];
        values.extend(row.estimate);
        values.extend(row.deviation);
        values.extend(row.innovation);
        values.extend(row.innovation_deviation);
        values.push(row.mean_nis);
        log.row(&values);
    }
    log.finish()
}

/// Verdict and estimates as JSON.
fn in_json(log: &str, crane: &str, estimate: &LogEstimate, notes: &[String]) -> Value {
    let verdict = &estimate.verdict;
    let mut at_end = Map::new();
    if let Some(last) = estimate.last_released() {
        for (k, (name, _)) in ESTIMATES.iter().enumerate() {
            let value = json!({
                "estimated": last.estimate[k], "deviation": last.deviation[k],
                "initial_deviation": estimate.initial_deviation[k],
            });
            at_end.insert((*name).to_string(), value);
        }
    }
    let prior = estimate.unknown_flow_prior.map(|prior| {
        json!({ "deviation_l_min": prior.initial_deviation * 60e3, "random_walk_l_min_per_sqrt_s": prior.random_walk * 60e3 })
    });
    json!({
        "log": log, "crane": crane, "begin_s": estimate.begin, "duration_s": estimate.duration,
        "filter_period_ms": estimate.period * 1e3,
        "position_interval_ms": estimate.interval[0] * 1e3, "pressure_interval_ms": estimate.interval[1] * 1e3,
        "position_noise_mm": estimate.noise[0] * 1e3, "load_pressure_noise_bar": estimate.noise[1] * 1e-5,
        "unknown_flow_prior": prior,
        "verdict": verdict.sentence(), "consistent": verdict.is_consistent,
        "innovations": { "position": verdict.position, "load_pressure": verdict.load_pressure },
        "findings": verdict.findings, "unobservable": verdict.unobservable, "load_changes_s": verdict.load_changes_s,
        "estimated_at_s": estimate.last_released().map(|row| row.time), "at_end": at_end, "notes": notes.iter().chain(&estimate.remarks).collect::<Vec<_>>(),
    })
}
