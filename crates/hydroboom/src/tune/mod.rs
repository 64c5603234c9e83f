//! `hydroboom tune`

use crate::crane_file::CraneFile;
use crate::log_mapping::{LogMapping, LogWindow};
use crate::output;
use clap::Args;
use hydroboom_description::schema::KEYS;
use hydroboom_identify::{COMPARED, Experiment, Fit, Free, Tuned, fit};
use hydroboom_measurement::{Signals, digest};
use indicatif::ProgressBar;
use miette::{IntoDiagnostic, Result, miette};
use serde_json::json;
use std::path::PathBuf;
use toml_edit::{DocumentMut, InlineTable, Item, Value};

/// Move keys of a crane file until the model shows what logs do, and say how sure that is.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  hydroboom tune --log lift.csv --free boom.youngs_modulus_gpa,friction.coulomb_n \
    --out tuned.toml\n  hydroboom tune --crane my-crane.toml --log slow.csv --log fast.csv --free auto --out tuned.toml"
)]
pub struct Tune {
    #[command(flatten)]
    crane: CraneFile,
    /// A log; can be repeated, and then all are fitted at once.
    #[arg(long, value_name = "FILE", required = true)]
    log: Vec<PathBuf>,
    #[command(flatten)]
    mapping: LogMapping,
    #[command(flatten)]
    window: LogWindow,
    /// Keys to move, with commas between them; `auto` for those that a log of position and pressures usually tells
    /// something of.
    #[arg(long, value_name = "KEYS", value_delimiter = ',', required = true)]
    free: Vec<String>,
    /// Crane file to write, with provenance `tuned` and the digests of the logs.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Tune {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let crane = self.crane.read()?;
        if self.crane.is_overridden() && self.out.is_some() {
            return Err(miette!(
                help = "write the values into the crane file first",
                "--set is not written to --out"
            ));
        }
        let free = match self.free.as_slice() {
            [only] if only == "auto" => Free::usual(&crane),
            named => named
                .iter()
                .map(|path| Free::from_path(path.trim()).into_diagnostic())
                .collect::<Result<Vec<Free>>>()?,
        };
        if let Some(zero) = free.iter().find(|key| key.value(&crane) <= 0.0) {
            miette::bail!("{} is zero: keys are moved by shares of their value", zero.path());
        }
        let (mut experiments, mut digests, mut notes) = (Vec::new(), Vec::new(), Vec::new());
        for path in &self.log {
            let (log, mapping) = self.mapping.read(path)?;
            let n = &crane.numbers;
            let suspicions = mapping.suspicions(&log, n.stroke, n.motor_speed);
            notes.extend(suspicions.into_iter().map(|s| format!("suspicious: {}", s.text)));
            let signals = Signals::of(&log, &mapping).into_diagnostic()?;
            let experiment =
                Experiment::new(&crane, &log, &signals, self.window.of()).into_diagnostic()?;
            notes.extend(experiment.remarks.iter().map(|r| format!("{}: {r}", path.display())));
            experiments.push(experiment);
            digests.push(digest(path).into_diagnostic()?);
        }
        let bar = ProgressBar::new_spinner();
        let found = fit(&crane, &experiments, &free, &|runs, sum| {
            bar.set_message(format!("{runs} runs, {sum:.0} left"));
            bar.tick();
        });
        bar.finish_and_clear();
        let found = found.into_diagnostic()?;
        if let Some(path) = &self.out {
            let text = self.written(&found, &digests)?;
            output::file(path, text.as_bytes())?;
        }
        match self.json {
            true => output::json(&json!({
                "crane": crane.name, "logs": self.log, "sha256": digests, "notes": notes,
                "runs": found.evaluations, "converged": found.has_converged,
                "keys": found.tuned.iter().map(in_json).collect::<Vec<_>>(),
                "correlation": found.correlation,
                "differences": found.improvements.iter().map(|i| json!({
                    "log": i.log,
                    "rms": COMPARED.iter().zip(&i.rms).filter_map(|(signal, rms)| {
                        let (unit, size) = signal.shown();
                        rms.map(|(before, after)| json!({
                            "signal": signal.key(), "unit": unit, "before": before / size, "after": after / size,
                        }))
                    }).collect::<Vec<_>>(),
                })).collect::<Vec<_>>(),
            })),
            false => output::text(&self.said(&found, &notes)),
        }
    }

    /// The crane file with the keys that were moved; all else, comments too, as it was.
    fn written(&self, found: &Fit, digests: &[String]) -> Result<String> {
        let mut document: DocumentMut = self.crane.text()?.parse().into_diagnostic()?;
        let logs: Vec<String> = self
            .log
            .iter()
            .zip(digests)
            .map(|(path, digest)| {
                let name =
                    path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into());
                format!("{name} (sha256 {})", &digest[..16])
            })
            .collect();
        for t in &found.tuned {
            let key = &KEYS[t.key.place];
            let (low, high) = t.interval();
            let mut entry = InlineTable::new();
            entry.insert("value", five_digits(key.to_unit(t.value.1)).into());
            entry.insert("provenance", "tuned".into());
            let how = match t.is_determined {
                true => format!("95 %: {:.4e} to {:.4e}", key.to_unit(low), key.to_unit(high)),
                false => "the logs do not determine it".into(),
            };
            entry.insert("source", format!("to {}; {how}", logs.join(", ")).into());
            document[key.section][key.name] = Item::Value(Value::InlineTable(entry));
        }
        Ok(document.to_string())
    }

    fn said(&self, found: &Fit, notes: &[String]) -> String {
        let rows: Vec<Vec<String>> = found
            .tuned
            .iter()
            .map(|t| {
                let key = &KEYS[t.key.place];
                let (low, high) = t.interval();
                let number = |v: f64| format!("{:.5}", Shown(key.to_unit(v)));
                vec![
                    key.path(),
                    number(t.value.0),
                    number(t.value.1),
                    format!("{} to {}", number(low), number(high)),
                    format!("{:.1}", t.prior * 100.0),
                    match t.from_logs.is_finite() {
                        true => format!("{:.2}", t.from_logs * 100.0),
                        false => "nothing".into(),
                    },
                    if t.is_determined { "yes" } else { "NO" }.into(),
                    t.partner
                        .as_ref()
                        .map_or(String::new(), |(k, c)| format!("{} ({c:+.2})", k.path())),
                ]
            })
            .collect();
        let header = [
            "key",
            "before",
            "after",
            "95 %",
            "known to [%]",
            "logs say to [%]",
            "determined",
            "traded most against",
        ];
        let mut said = format!(
            "{} keys moved, {} runs of the model{}\n{}\n",
            found.tuned.len(),
            found.evaluations,
            if found.has_converged { "" } else { "; the search did not end by itself" },
            output::table(&header, &rows)
        );
        for improvement in &found.improvements {
            let parts: Vec<String> = COMPARED
                .iter()
                .zip(&improvement.rms)
                .filter_map(|(signal, rms)| {
                    let (unit, size) = signal.shown();
                    rms.map(|(a, b)| {
                        format!("{} {:.3} to {:.3} {unit}", signal.symbol(), a / size, b / size)
                    })
                })
                .collect();
            said += &format!("\n{}, RMS: {}", improvement.log, parts.join(", "));
        }
        let open: Vec<String> =
            found.tuned.iter().filter(|t| !t.is_determined).map(|t| t.key.path()).collect();
        if !open.is_empty() {
            said += &format!(
                "\nthe logs do not determine {}: what was known of them decides",
                open.join(", ")
            );
        }
        for note in notes {
            said += &format!("\nnote: {note}");
        }
        if let Some(path) = &self.out {
            said += &format!("\nwritten: {}", path.display());
        }
        said
    }
}

/// A number with five digits that count.
struct Shown(f64);

impl std::fmt::Display for Shown {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let size = self.0.abs();
        match size != 0.0 && !(1e-3..1e6).contains(&size) {
            true => write!(f, "{:.4e}", self.0),
            false => {
                let digits = (4 - size.max(1e-3).log10().floor() as i32).clamp(0, 7) as usize;
                write!(f, "{:.digits$}", self.0)
            }
        }
    }
}

fn five_digits(value: f64) -> f64 {
    format!("{value:.4e}").parse().unwrap_or(value)
}

fn in_json(t: &Tuned) -> serde_json::Value {
    let key = &KEYS[t.key.place];
    let (low, high) = t.interval();
    json!({
        "key": key.path(), "before": key.to_unit(t.value.0), "after": key.to_unit(t.value.1),
        "interval_95": [key.to_unit(low), key.to_unit(high)], "known_to_percent": t.prior * 100.0,
        "logs_say_to_percent": t.from_logs.is_finite().then_some(t.from_logs * 100.0),
        "determined": t.is_determined,
        "partner": t.partner.as_ref().map(|(k, _)| k.path()), "correlation": t.partner.as_ref().map(|(_, c)| c),
    })
}
