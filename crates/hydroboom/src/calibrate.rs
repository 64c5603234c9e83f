//! `hydroboom calibrate`

use crate::crane_file::text;
use crate::output;
use crate::paths::{InputFile, OutputFile};
use clap::Args;
use hydroboom_description::{Description, UIA_VIRTUAL};
use hydroboom_lab::calibrate::{Effort, Found, Journal, PARAMETERS, published, search, trade_off};
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, Result};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Calibrate unpublished parameters of the virtual crane to published results of the real one.
#[derive(Args)]
#[command(after_help = "Example: hydroboom calibrate --out my-virtual.toml\n\
    It takes about a quarter of an hour. It may be interrupted: the same command continues there.\n\
    hydroboom calibrate --trade-off friction.coulomb_n=300,787,1300   (searches and writes nothing)")]
pub struct Calibrate {
    /// Virtual crane to start from, which also keeps all that is not calibrated; the embedded one
    /// when not given.
    #[arg(long, value_name = "FILE")]
    crane: Option<InputFile>,
    /// Crane file to write.
    #[arg(long, value_name = "FILE", default_value = "uia-virtual.toml")]
    out: OutputFile,
    /// Where evaluations are kept, to go on after an interruption; beside the crane file when not
    /// given.
    #[arg(long, value_name = "FILE")]
    journal: Option<OutputFile>,
    /// Generations of the global search.
    #[arg(long, default_value_t = 70)]
    generations: usize,
    /// Cranes in each generation.
    #[arg(long, default_value_t = 15)]
    population: usize,
    /// Iterations of the local search.
    #[arg(long, default_value_t = 4)]
    iterations: usize,
    /// Do not calibrate, but show every published result for several values of one key.
    #[arg(long, value_name = "KEY=VALUE,...", conflicts_with_all = ["generations", "population", "iterations", "journal", "out"])]
    trade_off: Option<String>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Calibrate {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// If an input is invalid, a simulation of the model fails, or the journal cannot be read.
    pub fn run(self) -> Result<()> {
        let model = Description::uia_single_boom()?;
        let (name, template_text) = match &self.crane {
            Some(path) => (path.display().to_string(), text(path)?),
            None => ("cranes/uia-virtual.toml (embedded)".to_string(), UIA_VIRTUAL.to_string()),
        };
        let template = Description::parse(&name, &template_text)?;
        if let Some(values) = &self.trade_off {
            return print_trade_off(&model, &template, values, self.json);
        }
        let effort = Effort {
            generations: self.generations,
            population: self.population.max(4),
            iterations: self.iterations,
        };
        let path =
            self.journal.as_deref().map_or_else(|| journal_beside(&self.out), Path::to_path_buf);
        let heading = format!("{:016x}", fingerprint(&template_text));
        let mut journal = Journal::open(&path, &heading).into_diagnostic()?;

        // every iteration of the local search evaluates one point per parameter
        let local = effort.iterations * (PARAMETERS.len() + 2) + PARAMETERS.len();
        let expected = effort.generations * effort.population + local;
        let bar = ProgressBar::new(expected as u64).with_style(
            ProgressStyle::with_template("{bar:40} {pos} of about {len} cranes, {msg}, {eta} left")
                .into_diagnostic()?,
        );
        let calibration = search(&model, &template, &effort, &mut journal, &|progress| {
            bar.set_position(progress.evaluations as u64);
            bar.set_message(format!("best {:.2}", progress.best));
        });
        bar.finish_and_clear();
        let calibration = calibration.into_diagnostic()?;
        let crane_file = calibration.crane_file(&template_text).into_diagnostic()?;
        drop(journal);
        if output::file(&self.out, crane_file.as_bytes()) {
            // the result is written, so that the journal is not needed any more
            std::fs::remove_file(&path).into_diagnostic()?;
        }
        match self.json {
            true => output::json(&json!({
                "written": self.out, "evaluations": calibration.evaluations,
                "reached": calibration.reached(), "parameters": calibration.calibrated(),
            })),
            false => output::text(
                &(calibration_text(&calibration) + &output::named("written", &self.out)),
            ),
        }
    }
}

/// Default path of the journal, next to the crane file.
fn journal_beside(out: &Path) -> PathBuf {
    let mut path = out.as_os_str().to_owned();
    path.push(".journal");
    path.into()
}

/// Prints the published results with several values of one key, given as KEY=VALUE,VALUE,...
///
/// # Errors
///
/// If the text is another one, a value is outside the key's range, or a simulation fails.
fn print_trade_off(
    model: &Description,
    crane: &Description,
    key_and_values: &str,
    as_json: bool,
) -> Result<()> {
    let wrong = || miette::miette!("--trade-off is KEY=VALUE,VALUE,..., not \"{key_and_values}\"");
    let (key, values) = key_and_values.split_once('=').ok_or_else(wrong)?;
    let values = values
        .split(',')
        .map(|value| value.trim().parse::<f64>().map_err(|_| wrong()))
        .collect::<Result<Vec<_>>>()?;
    for value in &values {
        // an invalid value is reported with the key's range and a suggestion
        crane.clone().set(&format!("{key}={value}"))?;
    }
    let bar = ProgressBar::new(values.len() as u64);
    let results = trade_off(model, crane, key, &values, &|done| bar.set_position(done as u64));
    bar.finish_and_clear();
    let results = results.into_diagnostic()?;
    let published = published();
    if as_json {
        return output::json(&json!({
            "key": key, "values": values, "published": published, "shown": results,
        }));
    }
    let rows: Vec<Vec<String>> = published
        .iter()
        .enumerate()
        .map(|(k, p)| {
            let cells = results.iter().map(|values| {
                let off = (values[k] / p.value - 1.0).abs();
                let mark = if off <= p.tolerance { "" } else { " *" };
                format!("{:.3}{mark}", values[k])
            });
            [p.name.clone(), format!("{:.3}", p.value)].into_iter().chain(cells).collect()
        })
        .collect();
    let header: Vec<String> = ["result".to_string(), "published".into()]
        .into_iter()
        .chain(values.iter().map(|value| format!("{value}")))
        .collect();
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    output::text(&format!(
        "{key}; * misses what is published by more than its tolerance\n{}",
        output::table(&header, &rows)
    ))
}

/// Fingerprint of a template: 64-bit FNV-1a (Fowler, Noll, Vo).
fn fingerprint(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// Tables of the published results that are reached, and of the calibrated parameters.
fn calibration_text(calibration: &Found) -> String {
    let reached: Vec<Vec<String>> = calibration
        .reached()
        .iter()
        .map(|r| {
            vec![
                r.name.clone(),
                r.table.into(),
                format!("{:.3}", r.published),
                format!("{:.3}", r.reached),
                format!("{:+.1}", r.difference_percent),
                format!("{:.0}", r.tolerance_percent),
                if r.within { String::new() } else { "missed".into() },
            ]
        })
        .collect();
    let calibrated: Vec<Vec<String>> = calibration
        .calibrated()
        .iter()
        .map(|c| {
            vec![
                c.key.into(),
                format!("{:e}", c.value),
                format!("{:e} .. {:e}", c.range[0], c.range[1]),
                format!("{:.2}", c.deviation),
                if c.determined { "yes".into() } else { "no".into() },
                format!("{} ({:+.2})", c.partner, c.correlation),
            ]
        })
        .collect();
    format!(
        "Published, measured on the real crane, and the virtual crane\n{}\n\n\
         Parameters; the deviation is a share of the range, were each tolerance a standard deviation\n{}",
        output::table(
            &["result", "table", "published", "virtual crane", "off [%]", "wanted [%]", ""],
            &reached
        ),
        output::table(
            &["key", "value", "plausible", "deviation", "determined", "strongest correlation"],
            &calibrated
        )
    )
}
